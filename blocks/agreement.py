"""Parameters that a block shares with the one that it measures or gets positions from."""

import numpy as np


def agrees(source, **ours):
    """Whether a block at the other end of a wire has the same parameters, as far as they are known."""
    theirs = {name: source.parameters[name] for name in ours if source is not None and name in source.parameters}
    differing = [name for name in theirs if not np.array_equal(theirs[name], ours[name])]
    return not differing, "; ".join(f"{name} is {theirs[name].tolist()} there" for name in differing)


def radii_agree(x, radii):
    """Whether radii are those of the robots whose positions x is, where these are robots: they have mass and radius."""
    if x is None or not {"mass", "radius"} <= set(x.parameters) or x.members != len(radii):
        return True, "of whose positions these are, no radii are known"
    theirs = np.resize(x.parameters["radius"], len(radii))  # one value may hold for all
    differing = np.flatnonzero(theirs != radii)
    return not len(differing), "; ".join(
        f"the radius of robot {i + 1} is {theirs[i]:.4g} m there" for i in differing[:3]
    )
