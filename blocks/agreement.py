"""Parameters that a measuring block shares with the block that it measures."""

import numpy as np


def agrees(source, **ours):
    """Whether a block at the other end of a wire has the same parameters, as far as they are known."""
    theirs = {name: source.parameters[name] for name in ours if source is not None and name in source.parameters}
    differing = [name for name in theirs if not np.array_equal(theirs[name], ours[name])]
    return not differing, "; ".join(f"{name} is {theirs[name].tolist()} there" for name in differing)
