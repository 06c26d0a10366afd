"""Linear or logarithmic, and from where to where: what suits the values of a panel if nobody says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

DECADES = 2.5
"""A positive curve that spans more decades than this is drawn on a logarithmic axis, if nothing else is said."""
FLAT = 1e-10
"""A change that is smaller beside the values than this is rounding, and is drawn as a flat line."""


def is_wide(values: Sequence[np.ndarray]) -> bool:
    """Whether curves fit a logarithmic axis only: all of them together, or one alone, and none is negative."""
    if len(values) > 1 and any(np.any(v < 0) for v in values):
        return False
    return _spans_decades(values) or any(_spans_decades([v]) for v in values)


def _spans_decades(values: Sequence[np.ndarray]) -> bool:
    every = _finite(values)
    positive = every[every > 0]
    if not positive.size or every.min() < 0:
        return False
    return bool(np.log10(positive.max()) - np.log10(np.median(positive)) > DECADES)


def scale(axis: Any, which: str, values: Sequence[np.ndarray], log: bool, fitted: bool = True) -> None:
    """Set the scale of the `x` or the `y` axis; fitted: and its limits, where logarithms or flat lines need them."""
    from matplotlib.ticker import NullFormatter

    one = getattr(axis, f"{which}axis")
    if log:
        getattr(axis, f"set_{which}scale")("log", nonpositive="mask")
        one.set_minor_formatter(NullFormatter())
    if not fitted:
        return
    every = _finite(values)
    if log and which == "y":
        _limit_decades(axis, values)
    elif not log and every.size and np.ptp(every) <= FLAT * np.abs(every).max():
        middle = float(every.mean())
        getattr(axis, f"set_{which}lim")(middle - (0.1 * abs(middle) or 1.0), middle + (0.1 * abs(middle) or 1.0))


def _finite(values: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)


def _limit_decades(axis: Any, values: Sequence[np.ndarray]) -> None:
    """Leave out the few samples that dip far below all others."""
    lows = [np.quantile(v[(v > 0) & np.isfinite(v)], 0.002) for v in values if np.any((v > 0) & np.isfinite(v))]
    every = _finite(values)
    if lows and (low := 10 ** np.floor(np.log10(min(lows)))) > 0:
        high = every.max()
        axis.set_ylim(low, None if high > low else 10 * low)
