"""Windows between two samples, of which nothing is known."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from cosim.language.formula_tree import Condition, Temporal, Until, conditions
from cosim.requirements.extrema import NEAR
from cosim.requirements.terms import Array


def gaps(times: Array, part: Temporal | Until, count: int) -> Array:
    """From which of the first `count` samples on a window has no sample."""
    first = np.searchsorted(times, (times[:count] + part.start) * (1.0 - NEAR), "left")
    last = np.searchsorted(times, (times[:count] + part.stop) * (1.0 + NEAR), "right")
    found: Array = first >= last
    return found


def gap(part: Condition, found: Mapping[Condition, Array], times: Array, begin: float = 0.0, end: float = 0.0) -> str:
    """A window with a gap that a condition asks for from `begin` to `end` (s), in words; "" if there is none."""
    if part in found:
        first = int(np.searchsorted(times, begin * (1.0 - NEAR), "left"))
        last = int(np.searchsorted(times, end * (1.0 + NEAR), "right"))
        if found[part][first:last].any():
            assert isinstance(part, Temporal | Until)
            return f"[{part.start:g}, {part.stop:g}]"
    stop = end + (part.stop if isinstance(part, Temporal | Until) else 0.0)
    stop = min(stop, float(times[-1])) if math.isinf(stop) else stop
    begins = [begin] * len(conditions(part))
    if isinstance(part, Temporal | Until):
        begins[-1] += part.start  # `left` of `until` is asked for from now on
    return next(
        (text for p, b in zip(conditions(part), begins, strict=True) if (text := gap(p, found, times, b, stop))), ""
    )
