"""Parameters that a block shares with the one that it measures or gets positions from: such as eta of (44)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cosim.wiring.conditions import Source


def agrees(source: Source | None, **ours: Any) -> tuple[bool, str]:
    """Whether a block at the other end of a wire has the same parameters, as far as they are known."""
    known = {} if source is None else source.parameters
    theirs = {name: known[name] for name in ours if name in known}
    differing = [name for name in theirs if not np.array_equal(theirs[name], ours[name])]
    return not differing, "; ".join(f"{name} is {theirs[name].tolist()} there" for name in differing)


def radii_agree(x: Source | None, radii: NDArray) -> tuple[bool, str]:
    """Whether radii are R_i of (42) where x is the position of robots, which have mass and radius."""
    if x is None or not {"mass", "radius"} <= set(x.parameters) or x.members != len(radii):
        return True, "of whose positions these are, no radii are known"
    theirs = np.resize(x.parameters["radius"], len(radii))  # one value may hold for all
    differing = np.flatnonzero(theirs != radii)
    return not len(differing), "; ".join(
        f"the radius of robot {i + 1} is {theirs[i]:.4g} m there" for i in differing[:3]
    )
