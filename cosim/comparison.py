"""Two results side by side: their metrics, and the first time and signal at which they part.

Only samples that both have are compared, at the times of the first one; two runs with different recording periods are
compared where they meet. Signals and metrics that only one of them has, and an earlier end, are differences too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import ResultError
from cosim.results import Result

TIME_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Parting:
    """Where two results differ first: the signal's element (indices from 1), the time (s), and both values."""

    signal: str
    time: float
    values: tuple[Any, Any]


@dataclass
class Comparison:
    """What two results have in common. parted: bit by bit; beyond: by more than the tolerance of the comparison.

    only: the signals that one of the two has alone; samples: how many times both have; figures: the metrics that
    differ by more than the tolerance; ends: the last times (s), if one result could have gone on as far as the other.
    """

    paths: tuple[Path, Path]
    metrics: tuple[dict[str, Any], dict[str, Any]]
    samples: int
    signals: list[str]
    only: tuple[list[str], list[str]]
    figures: list[str]
    ends: tuple[float, float] | None = None
    parted: Parting | None = None
    beyond: Parting | None = None
    largest: tuple[str, float] = ("", 0.0)

    @property
    def agrees(self) -> bool:
        """Whether the results have the same signals, metrics and end, within the tolerance."""
        return not (self.beyond or self.figures or any(self.only) or self.ends)


def compare(first: Path, second: Path, tolerance: float = 1e-6) -> Comparison:
    """Compare two result files. tolerance: relative, to the largest value of the signal in the first.

    Raises: ResultError if one cannot be read, or if they have neither a time nor a signal in common.
    """
    with Result(first) as a, Result(second) as b:
        shared = [name for name in a.signals if name in b.signals and a.signals[name].shape == b.signals[name].shape]
        own = [[name for name in x.signals if name not in shared] for x in (a, b)]
        here, there = _common(a.times, b.times)
        if not len(here) or not shared:
            what = "time" if shared else "signal"
            raise ResultError(f"{first} and {second} have no {what} in common", fix="compare runs of one diagram")
        metrics = a.attrs.get("metrics", {}), b.attrs.get("metrics", {})
        figures = [name for name in dict.fromkeys((*metrics[0], *metrics[1])) if not _close(name, *metrics, tolerance)]
        result = Comparison((first, second), metrics, len(here), shared, (own[0], own[1]), figures)
        result.ends = _ends(a.times, b.times)
        for name in shared:
            _compare_signal(result, name, a.read(name)[here], b.read(name)[there], a.times[here], tolerance)
    return result


def _close(name: str, first: Mapping[str, Any], second: Mapping[str, Any], tolerance: float) -> bool:
    """Whether both have a metric, within the tolerance of the larger one."""
    if name not in first or name not in second:
        return False
    a, b = first[name], second[name]
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in (a, b))
    return a == b or (numbers and abs(a - b) <= tolerance * max(abs(a), abs(b)))


def _ends(a: np.ndarray, b: np.ndarray) -> tuple[float, float] | None:
    """The last times, if the shorter result would have had another sample by the end of the longer one."""
    shorter, longer = (a, b) if a[-1] < b[-1] else (b, a)
    period = shorter[-1] - shorter[-2] if len(shorter) > 1 else 0.0
    missing = longer[-1] - shorter[-1] - period
    tolerance = TIME_TOLERANCE * max(1.0, longer[-1])
    cut = longer[-1] - shorter[-1] > tolerance and missing > -tolerance
    return (float(a[-1]), float(b[-1])) if cut else None


def _common(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The indices of the times that both have."""
    if not len(a) or not len(b):
        return np.zeros(0, int), np.zeros(0, int)
    near = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    before = np.clip(near - 1, 0, None)
    near = np.where(np.abs(b[before] - a) < np.abs(b[near] - a), before, near)
    same = np.abs(b[near] - a) <= TIME_TOLERANCE * np.maximum(1.0, np.abs(a))
    return np.flatnonzero(same), near[same]


def _compare_signal(
    result: Comparison, name: str, a: np.ndarray, b: np.ndarray, times: np.ndarray, tolerance: float
) -> None:
    first = _first(name, _bits(a) != _bits(b), a, b, times)
    if first and (result.parted is None or first.time < result.parted.time):
        result.parted = first
    if a.dtype.kind != "f":
        far = a != b
    else:
        with np.errstate(invalid="ignore"):
            difference = np.abs(a - b)
            scale = np.nanmax(np.abs(np.where(np.isfinite(a), a, np.nan)), initial=0.0) or 1.0
            agree = (a == b) | (np.isnan(a) & np.isnan(b))
            relative = np.where(agree, 0.0, np.where(np.isnan(difference), np.inf, difference / scale))
        far = relative > tolerance
        if relative.size and relative.max() > result.largest[1]:
            result.largest = name, float(relative.max())
    first = _first(name, far, a, b, times)
    if first and (result.beyond is None or first.time < result.beyond.time):
        result.beyond = first


def _bits(values: np.ndarray) -> np.ndarray:
    """The same bits as whole numbers, for which 0.0 and -0.0 are two, and NaN is itself."""
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")


def _first(name: str, different: np.ndarray, a: np.ndarray, b: np.ndarray, times: np.ndarray) -> Parting | None:
    rows = different.reshape(len(times), -1)
    at = int(rows.any(axis=1).argmax())
    if not rows.size or not rows[at].any():
        return None
    index = np.unravel_index(int(rows[at].argmax()), different.shape[1:]) if different.ndim > 1 else ()
    place = f"[{','.join(str(int(i) + 1) for i in index)}]" if index else ""
    return Parting(f"{name}{place}", float(times[at]), (a[(at, *index)].item(), b[(at, *index)].item()))


def lines(result: Comparison, tolerance: float) -> Iterator[str]:
    """The comparison in words, a sentence a line."""
    one, two = result.paths
    yield f"{len(result.signals)} signals at {result.samples} times are in both"
    for path, names in zip(result.paths, result.only, strict=True):
        if names:
            yield f"only in {path}: {', '.join(names)}"
    if result.ends:
        yield f"{one} ends at {result.ends[0]:.6g} s, {two} at {result.ends[1]:.6g} s"
    if result.figures:
        yield f"metrics that differ by more than {tolerance:g}: {', '.join(result.figures)}"
    if result.parted is None:
        same = f"{one} and {two} are the same, bit by bit"
        yield same if result.agrees else "in what both have recorded they are the same, bit by bit"
        return
    yield f"they part at t = {result.parted.time:g} s: {_values(result.parted)}"
    if result.beyond is None:
        name, size = result.largest
        yield f"but never by more than {tolerance:g} of a signal's size; the most is {size:.2g}, in {name}"
    else:
        yield f"by more than {tolerance:g} of its size at t = {result.beyond.time:g} s: {_values(result.beyond)}"


def _values(parting: Parting) -> str:
    a, b = parting.values
    return f"{parting.signal} is {a!r} and {b!r}"
