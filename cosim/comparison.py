"""Two results side by side: their metrics, and the first time and signal at which they part.

Only samples that both have are compared, at the times of the first one; two runs with different recording periods are
compared where they meet.
"""

from __future__ import annotations

from collections.abc import Iterator
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

    only: the signals that one of the two has alone; samples: how many times both have.
    """

    paths: tuple[Path, Path]
    metrics: tuple[dict[str, Any], dict[str, Any]]
    samples: int
    signals: list[str]
    only: tuple[list[str], list[str]]
    parted: Parting | None = None
    beyond: Parting | None = None
    largest: tuple[str, float] = ("", 0.0)


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
        result = Comparison((first, second), metrics, len(here), shared, (own[0], own[1]))
        for name in shared:
            _compare_signal(result, name, a.read(name)[here], b.read(name)[there], a.times[here], tolerance)
    return result


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
    if result.parted is None:
        yield f"{one} and {two} are the same, bit by bit"
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
