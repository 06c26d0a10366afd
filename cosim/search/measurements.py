"""The measured columns of a fit, in the units of the diagram's signals, each row checked against the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.errors import CosimError, FormulaError, Problems, UnknownPort, WrongUnit, WrongValue
from cosim.language import data_files, units
from cosim.language.formula_tree import Mention
from cosim.language.source import Node
from cosim.requirements import terms
from cosim.requirements.terms import Scope, Seen
from cosim.study.definition import Fit, Measured, Sighting
from cosim.wiring import required
from cosim.wiring.network import Network


@dataclass(frozen=True)
class MeasuredCourse:
    """One measured signal. values (k,), scale: in the signal's unit; scale is what a residual is divided by."""

    label: str
    unit: str
    values: np.ndarray
    scale: float


@dataclass(frozen=True)
class Measurements:
    """All that is measured, at times (k,) in s. known: whether the scales are standard deviations of noise."""

    times: np.ndarray
    courses: tuple[MeasuredCourse, ...]
    sighting: Sighting
    known: bool

    @property
    def size(self) -> int:
        """How many residuals there are."""
        return len(self.times) * len(self.courses)

    def residuals(self, observed: list[list[float]]) -> np.ndarray:
        """What a run has beyond the measurements, over the scales, (size,)."""
        parts = [(np.array(o) - c.values) / c.scale for o, c in zip(observed, self.courses, strict=True)]
        return np.concatenate(parts)

    def scaled(self) -> np.ndarray:
        """What is measured, over the scales, (size,)."""
        return np.concatenate([course.values / course.scale for course in self.courses])

    def sizes(self, residuals: np.ndarray | None) -> list[float | None]:
        """The root mean square residual of each signal, in its unit."""
        if residuals is None:
            return [None for _ in self.courses]
        parts = np.split(residuals, len(self.courses))
        return [float(np.sqrt(np.mean(p * p))) * c.scale for p, c in zip(parts, self.courses, strict=True)]


def read(fit: Fit, network: Network) -> Measurements:
    """The measurements of a fit, for a diagram.

    Raises: DiagramErrors of MissingFile, WrongFile, WrongShape, WrongValue in the table or at the place that names it;
    UnknownBlock, UnknownPort, WrongUnit.
    """
    problems = Problems()
    times = problems.attempt(_column, fit.data, fit.time)
    courses = [problems.attempt(_course, fit, measured, network) for measured in fit.measured]
    problems.raise_if_any()
    assert times is not None
    _check_times(times, fit, network)
    sighting = Sighting(tuple((one.signal, one.index) for one in fit.measured), times)
    known = all(one.deviation is not None for one in fit.measured)
    return Measurements(times, tuple(course for course in courses if course), sighting, known)


def _column(data: Node, column: Node) -> np.ndarray:
    """Raises: CosimError at the column's name, or in the table."""
    try:
        found = data_files.read(Node({"file": data, "column": column}, data.position))
    except (UnicodeError, OSError) as error:
        raise WrongValue(f"`{data.value}` cannot be read: {error}", data.position) from None
    values = np.atleast_1d(found.array).astype(float)
    if not np.all(np.isfinite(values)):
        row = int(np.argmin(np.isfinite(values))) + 1
        raise WrongValue(f"column `{column.value}` of `{data.value}` is infinite in its row {row}", column.position)
    return values


def _check_times(times: np.ndarray, fit: Fit, network: Network) -> None:
    """Raises: WrongValue for times that no run has, or that run back."""
    stop, name = network.diagram.run.stop, f"column `{fit.time.value}` of `{fit.data.value}`"
    beyond = np.flatnonzero((times < 0.0) | (times > stop * (1.0 + 1e-9)))
    if beyond.size:
        what = f"{times[beyond[0]]:g} s, in its row {beyond[0] + 1}, and the run is from 0 to {stop:g} s"
        fix = f"run.stop: {times.max():g} in the diagram" if times.min() >= 0.0 else "times in s, from the run's begin"
        raise WrongValue(f"{name} has {what}", fit.time.position, fix)
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        message = f"{name} does not rise after its row {back[0] + 1}, at {times[back[0]]:g} s"
        raise WrongValue(message, fit.time.position, "sort its rows, each time once")


def _course(fit: Fit, measured: Measured, network: Network) -> MeasuredCourse:
    """Raises: CosimError."""
    unit = _unit(measured, network)
    values = _column(fit.data, measured.column)
    scale = measured.nominal if measured.deviation is None else measured.deviation
    if measured.unit is None:
        return MeasuredCourse(measured.label, unit, values, scale)
    try:
        column, own = units.base(measured.unit), units.base(unit or "1")
    except WrongUnit as error:
        raise _placed(error, measured) from None
    if column.exponents != own.exponents or not unit:
        message = f"`{measured.label}` is in {unit or 'no known unit'}, its column in {measured.unit}"
        raise WrongUnit(message, measured.node.place, "name another column, or correct `unit`")
    converted = (column.factor * values + column.offset - own.offset) / own.factor
    return MeasuredCourse(measured.label, unit, converted, scale * column.factor / own.factor)


def _placed(error: CosimError, measured: Measured) -> CosimError:
    """The error at the place of what has been measured."""
    return type(error)(f"`fit.signals.{measured.label}`: {error.message}", measured.node.place, error.fix)


def _unit(measured: Measured, network: Network) -> str:
    """The signal's unit, "" where it is not known. Raises: CosimError for what is not one number."""

    def look(text: str, _position: object) -> Seen:
        return required.seen(network, network.find(text, measured.node.place))

    try:
        found = terms.signal(Mention(measured.signal, measured.index, 0), Scope(look, lambda at: measured.node.place))
    except FormulaError as error:
        raise _placed(error, measured) from None
    if found.shape:
        message = f"`{measured.label}` has the shape {found.shape}, a column one number"
        fix = f"name an element: {measured.signal}[{', '.join(map(str, (*measured.index, *(1 for _ in found.shape))))}]"
        raise UnknownPort(message, measured.node.place, fix)
    return found.label
