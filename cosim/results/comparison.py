"""Two results side by side: how they ended, their metrics, and the first time and signal at which they part.

Only samples that both have are compared, at the times of the first one; two runs with different recording periods are
compared where they meet. Signals and metrics that only one of them has, and another end, are differences too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import ResultError, WrongUnit
from cosim.language import units
from cosim.results.recorded import Recorded
from cosim.results.result_file import Result

MOST = float(np.finfo(float).max)
SPACING_TOLERANCE = 1e-6
"""The part of the time between two samples, or of a step, by which two times may differ and are the same."""
Judgements = Mapping[str, Mapping[str, Any]]
"""Verdicts on requirements by their names, as of `Verdict.as_json`."""
TIME_ULPS = 4
"""Units in the last place by which they may differ too: times are rounded products of rounded steps."""
ENDINGS = {
    "completed": "is completed",
    "terminated": "was terminated",
    "interrupted": "was interrupted",
    "running": "has no end: its run is going on, or was killed",
}


@dataclass(frozen=True)
class Parting:
    """Where two results differ first: the signal's element (indices from 1), the time (s), and both values."""

    signal: str
    time: float
    values: tuple[Any, Any]


@dataclass(frozen=True)
class Ending:
    """How a run ended, as of `ResultWriter.close`. time, step: of the last step, in s, None if the file does not say.

    Runs with different steps have different numbers of them and end alike: what counts is the simulated time. It is not
    that of the last sample, which a run that records rarely may have left far behind.
    """

    status: str
    message: str
    time: float | None
    step: float | None


@dataclass
class Comparison:
    """What two results have in common. parted: bit by bit; beyond: by more than the tolerance of the comparison.

    endings: of both runs. only: the signals that one of the two has alone; shapes, units, types: what both declare for
    signals where that differs; samples: how many times both have; figures: the metrics that differ by more than the
    tolerance; verdicts: the requirements that do, or of which one is kept and the other not; ends: the times (s) at
    which they end, None for nowhere, if they do not end together.
    """

    paths: tuple[Path, Path]
    endings: tuple[Ending, Ending]
    metrics: tuple[dict[str, Any], dict[str, Any]]
    samples: int
    signals: list[str]
    only: tuple[list[str], list[str]]
    figures: list[str]
    requirements: tuple[Judgements, Judgements] = field(default_factory=lambda: ({}, {}))
    verdicts: list[str] = field(default_factory=list)
    shapes: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    units: dict[str, tuple[str, str]] = field(default_factory=dict)
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    ends: tuple[float | None, float | None] | None = None
    parted: Parting | None = None
    beyond: Parting | None = None
    largest: tuple[str, float] = ("", 0.0)

    @property
    def agrees(self) -> bool:
        """Whether the runs ended alike, with the same signals, shapes, units, and metrics within the tolerance.

        Types of numbers may differ where the numbers do not.
        """
        declared = any(self.only) or self.shapes or self.units
        figures = self.figures or self.verdicts
        return not (self.beyond or figures or declared or self.ends or self.ended_differently)

    @property
    def same(self) -> bool:
        """Whether there is no difference at all, bit by bit."""
        return self.agrees and self.parted is None and not self.types

    @property
    def ended_differently(self) -> bool:
        """Whether they differ in status, or in the reason that they give; when they ended is beside it, in `ends`."""
        one, two = self.endings
        return (one.status, one.message) != (two.status, two.message)


def compare(first: Path, second: Path, tolerance: float = 1e-6) -> Comparison:
    """Compare two result files. tolerance: relative, to the largest value that the signal has in one of them.

    Raises: ResultError if one cannot be read, or if they have neither a signal nor a metric, or no time, in common.
    """
    with Result(first) as a, Result(second) as b:
        both = [name for name in a.signals if name in b.signals]
        own = [[name for name in x.signals if name not in both] for x in (a, b)]
        shapes = {n: (a.signals[n].shape, b.signals[n].shape) for n in both if a.signals[n].shape != b.signals[n].shape}
        shared = [name for name in both if name not in shapes]
        metrics = a.attrs.get("metrics", {}), b.attrs.get("metrics", {})
        here, there = _common(a.times, b.times)
        judged = _judged(a), _judged(b)
        if not both and not {*metrics[0], *judged[0]} & {*metrics[1], *judged[1]}:
            raise _nothing("signal", first, second)
        if shared and len(a.times) and len(b.times) and not len(here):
            raise _nothing("time", first, second)
        figures = [name for name in dict.fromkeys((*metrics[0], *metrics[1])) if not _both(name, *metrics, tolerance)]
        endings = _ending(a), _ending(b)
        result = Comparison((first, second), endings, metrics, len(here), shared, (own[0], own[1]), figures)
        result.requirements, result.shapes = judged, shapes
        result.verdicts = [n for n in dict.fromkeys((*judged[0], *judged[1])) if not _alike(n, *judged, tolerance)]
        result.ends = _ends(endings, a.times, b.times)
        for name in shared:
            _compare_declared(result, a.signals[name], b.signals[name])
            _compare_signal(result, name, a.read(name)[here], b.read(name)[there], a.times[here], tolerance)
    return result


def _nothing(what: str, first: Path, second: Path) -> ResultError:
    return ResultError(f"{first} and {second} have no {what} in common", fix="compare runs of one diagram")


def _ending(result: Result) -> Ending:
    settings, end = result.attrs.get("settings"), result.attrs.get("end")
    step = settings.get("step") if isinstance(settings, dict) else None
    told = str(result.attrs["status"]), str(result.attrs.get("message", ""))
    if isinstance(step, int | float) and isinstance(end, int | float):
        return Ending(*told, float(end), float(step))
    return Ending(*told, None, None)


def _both(name: str, first: Mapping[str, Any], second: Mapping[str, Any], tolerance: float) -> bool:
    """Whether both have a metric, and it is close."""
    return name in first and name in second and _close(first[name], second[name], tolerance)


def _judged(result: Result) -> Judgements:
    return {judged["name"]: judged for judged in result.attrs.get("requirements", [])}


def _alike(name: str, first: Judgements, second: Judgements, tolerance: float) -> bool:
    """Whether both have a requirement, keep it or not, and by a margin that is close."""
    if name not in first or name not in second:
        return False
    one, two = first[name], second[name]
    return one["holds"] is two["holds"] and _close(one["margin"], two["margin"], tolerance)


def _close(a: Any, b: Any, tolerance: float) -> bool:
    """Whether two metrics are within the tolerance of the larger number, or of the largest in lists of numbers.

    Events agree if the same happens at times that are close. NaN agrees with NaN, an infinity with its like.
    """
    if isinstance(a, dict) and isinstance(b, dict):
        who = [{key: value for key, value in event.items() if key != "time"} for event in (a, b)]
        return who[0] == who[1] and _close(a.get("time"), b.get("time"), tolerance)
    lists = isinstance(a, list) and isinstance(b, list)
    if lists and any(isinstance(item, dict) for item in (*a, *b)):
        return len(a) == len(b) and all(_close(x, y, tolerance) for x, y in zip(a, b, strict=True))
    return _near(a, b, tolerance * max(_size(a), _size(b)))


def _near(a: Any, b: Any, distance: float) -> bool:
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_near(x, y, distance) for x, y in zip(a, b, strict=True))
    if a == b or a is b:
        return True
    if not (_is_number(a) and _is_number(b)):
        return False
    finite = np.isfinite(a) and np.isfinite(b)
    return bool(abs(a - b) <= distance if finite else np.isnan(a) and np.isnan(b))


def _size(value: Any) -> float:
    """The largest finite size of a number, or of those in a list."""
    if isinstance(value, list):
        return max(map(_size, value), default=0.0)
    return abs(value) if _is_number(value) and np.isfinite(value) else 0.0


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _ends(endings: tuple[Ending, Ending], a: np.ndarray, b: np.ndarray) -> tuple[float | None, float | None] | None:
    """When both ended, if that differs; where a file does not say, it is judged by its samples."""
    (one, two), steps = (e.time for e in endings), [e.step for e in endings if e.step is not None]
    if one is None or two is None:
        return _last_samples(a, b)
    return (one, two) if abs(one - two) > _tolerance(max(one, two), min(steps)) else None


def _last_samples(a: np.ndarray, b: np.ndarray) -> tuple[float | None, float | None] | None:
    """The last times, if the shorter result would have had another sample by the end of the longer one."""
    if not len(a) or not len(b):
        ends = [float(x[-1]) if len(x) else None for x in (a, b)]
        return None if len(a) == len(b) else (ends[0], ends[1])
    shorter, longer = (a, b) if a[-1] < b[-1] else (b, a)
    period = shorter[-1] - shorter[-2] if len(shorter) > 1 else 0.0
    late = longer[-1] - shorter[-1]
    tolerance = _tolerance(longer[-1], _spacing(a, b))
    return (float(a[-1]), float(b[-1])) if late > tolerance and late - period > -tolerance else None


def _common(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The indices of the times that both have."""
    if not len(a) or not len(b):
        return np.zeros(0, int), np.zeros(0, int)
    near = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    before = np.clip(near - 1, 0, None)
    near = np.where(np.abs(b[before] - a) < np.abs(b[near] - a), before, near)
    same = np.abs(b[near] - a) <= _tolerance(a, _spacing(a, b))
    return np.flatnonzero(same), near[same]


def _spacing(a: np.ndarray, b: np.ndarray) -> float:
    """The shortest time between two samples of one result; where each has one only, that from zero."""
    steps = np.concatenate((np.diff(a), np.diff(b)))
    return float(np.min(steps[steps > 0], initial=np.inf) if (steps > 0).any() else max(a[-1], b[-1]))


def _tolerance(time: Any, spacing: float) -> Any:
    """By how much (s) times that are so far apart may differ and are the same; never so much that two become one."""
    rounding = TIME_ULPS * np.spacing(np.abs(time))
    return np.minimum(np.maximum(rounding, SPACING_TOLERANCE * spacing), spacing / 4)


def _compare_declared(result: Comparison, a: Recorded, b: Recorded) -> None:
    if a.dtype != b.dtype:
        result.types[a.name] = str(a.dtype), str(b.dtype)
    if not _same_unit(a.unit, b.unit):
        result.units[a.name] = str(a.unit), str(b.unit)


def _same_unit(a: units.Unit, b: units.Unit) -> bool:
    """As of `units.same`; what is no unit is the same as its own text."""
    if a == b:
        return True
    try:
        return units.same(_unit(a), _unit(b))
    except WrongUnit:
        return False


def _unit(unit: units.Unit) -> units.Unit:
    """A unit of a result's file, which has several with commas between."""
    parts = tuple(part.strip() for part in unit.split(",")) if isinstance(unit, str) else ()
    return parts if len(parts) > 1 else unit


def _compare_signal(
    result: Comparison, name: str, a: np.ndarray, b: np.ndarray, times: np.ndarray, tolerance: float
) -> None:
    differ = _bits(a) != _bits(b) if a.dtype == b.dtype else ~_equal(a, b)
    first = _first(name, differ, a, b, times)
    if first and (result.parted is None or first.time < result.parted.time):
        result.parted = first
    far = ~_equal(a, b)
    if "f" in (a.dtype.kind, b.dtype.kind) and far.any():
        distance, scale = _distance(a.astype(float), b.astype(float))
        most = float(distance[far].max()) / scale
        far &= distance > min(tolerance * scale, MOST)
        if most > result.largest[1]:
            result.largest = name, most
    first = _first(name, far, a, b, times)
    if first and (result.beyond is None or first.time < result.beyond.time):
        result.beyond = first


def _equal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where the numbers are equal, of whatever types they are; NaN is equal to NaN."""
    with np.errstate(invalid="ignore"):
        same: np.ndarray = (a == b) | ((a != a) & (b != b))  # noqa: PLR0124  # of any type
    return same


def _distance(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, float]:
    """How far numbers are apart, infinite beside a NaN or an infinity, and the largest size in `a`.

    If that is zero throughout, the largest in `b`: no number is small beside zero.
    """
    sizes = (float(np.max(np.abs(x), where=np.isfinite(x), initial=0.0)) for x in (a, b))
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.where(np.isfinite(a) & np.isfinite(b), np.abs(a - b), np.inf)
    return distance, next((size for size in sizes if size), 1.0)


def _bits(values: np.ndarray) -> np.ndarray:
    """The same bits as whole numbers, for which 0.0 and -0.0 are two, and NaN is itself."""
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")


def _first(name: str, different: np.ndarray, a: np.ndarray, b: np.ndarray, times: np.ndarray) -> Parting | None:
    rows = different.reshape(len(times), different[0].size) if len(times) else different.reshape(0, 0)
    if not rows.any():
        return None
    at = int(rows.any(axis=1).argmax())
    index = np.unravel_index(int(rows[at].argmax()), different.shape[1:]) if different.ndim > 1 else ()
    place = f"[{','.join(str(int(i) + 1) for i in index)}]" if index else ""
    return Parting(f"{name}{place}", float(times[at]), (a[(at, *index)].item(), b[(at, *index)].item()))


def lines(result: Comparison, tolerance: float) -> Iterator[str]:
    """The comparison in words, a sentence a line."""
    one, two = result.paths
    if result.ended_differently:
        yield ", ".join(f"{path} {_ended(end)}" for path, end in zip(result.paths, result.endings, strict=True))
    yield f"{len(result.signals)} signals at {result.samples} times are in both"
    for path, names in zip(result.paths, result.only, strict=True):
        if names:
            yield f"only in {path}: {', '.join(names)}"
    for what, found in (("shape", result.shapes), ("unit", result.units), ("type", result.types)):
        for name, (here, there) in found.items():
            yield f"{name} has the {what} {here} in {one} and {there} in {two}"
    if result.ends:
        ends = ["has no sample" if end is None else f"ends at {end:.6g} s" for end in result.ends]
        yield f"{one} {ends[0]}, {two} {ends[1]}"
    if result.figures:
        yield f"metrics that differ by more than {tolerance:g}: {', '.join(result.figures)}"
    if result.verdicts:
        named = ", ".join(result.verdicts)
        yield f"requirements with another verdict, or a margin that differs by more than {tolerance:g}: {named}"
    yield from _parting(result, tolerance)


def _ended(ending: Ending) -> str:
    status = ENDINGS.get(ending.status, ending.status)
    return f"{status}: {ending.message}" if ending.message else status


def _parting(result: Comparison, tolerance: float) -> Iterator[str]:
    """Where the signals part, and where by more than the tolerance."""
    one, two = result.paths
    if result.same:
        yield f"{one} and {two} are the same, bit by bit"
    elif result.parted is None:
        kind = "number by number" if result.types else "bit by bit"
        yield f"in what both have recorded they are the same, {kind}"
    else:
        yield f"they part at t = {result.parted.time:g} s: {_values(result.parted)}"
    if result.beyond:
        yield f"by more than {tolerance:g} of its size at t = {result.beyond.time:g} s: {_values(result.beyond)}"
    elif result.parted:
        name, size = result.largest
        most = f"; the most is {size:.2g}, in {name}" if size else ""
        yield f"but never by more than {tolerance:g} of a signal's size{most}"


def _values(parting: Parting) -> str:
    a, b = parting.values
    return f"{parting.signal} is {a!r} and {b!r}"
