"""The functions of this folder of numbers, and of arrays of them: the bits that compiled code gives."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.plain_math.definitions import FUNCTIONS

Array = np.ndarray[Any, Any]


def evaluated(name: str, *arguments: float | Array) -> float | Array:
    """A function of numbers, or of arrays (n,) element by element; NaN or infinite where it has no value."""
    function = FUNCTIONS[name]
    arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(argument, np.float64)) for argument in arguments))
    with np.errstate(all="ignore"):
        found = function.core(*arrays)
        if function.outside and function.wide and (outside := function.outside(*arrays)).any():
            found = np.where(outside, function.wide(*arrays), found)
    alone = all(np.ndim(argument) == 0 for argument in arguments)
    return float(found[0]) if alone else np.asarray(found)
