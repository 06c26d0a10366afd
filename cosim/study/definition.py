"""What a study is: a diagram, its variants, a grid, random draws, and how the figures are tabulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cosim.authoring.block import Block
from cosim.errors import Position, Problems
from cosim.language.source import Node
from cosim.plot.figures import Figure
from cosim.results.step_figures import STEP_FIGURES

Layers = Callable[[Problems], tuple[Node, list[Path]]]
"""Gives the tree of a diagram with all its layers, and the files that it was read from."""
MOST_MEMBERS = 10_000_000
"""Each has a line of some 500 bytes in the store, and all are read whenever the study is."""
CONDITIONS = ("kept", "all", "any")
"""Of the theorems' conditions: those that hold with the values before, all, or whichever."""
METHODS = ("random", "latin-hypercube", "sobol")
STATISTICS = ("max", "mean", "median", "min", "rms", "std")
STEP_TIME = "step_time"
"""A figure of every run that a table may show: the wall-clock time of a step (us)."""
OVER_RUNS = {
    "max": "max",
    "min": "min",
    "mean": "mean",
    "rms": "rms",
    "final": "mean",
    "events": "max",
    "first": "min",
    "margin": "min",
    **dict.fromkeys(STEP_FIGURES, "max"),
}
"""How a metric, by its reduction over a run, is reduced over several runs if nothing is said."""


@dataclass(frozen=True)
class Variant:
    """One named variant: a diagram, another or the study's own, with an overlay, swaps and settings on top of it.

    layers: gives the diagram, where a program has it, and no file.
    """

    name: str
    diagram: Path
    diagram_position: Position
    description: str = ""
    overlay: Node | None = None
    swaps: dict[str, Node] = field(default_factory=dict)
    settings: dict[str, Node] = field(default_factory=dict)
    layers: Layers | None = None


@dataclass(frozen=True)
class GridAxis:
    """One axis of the grid: the dotted paths that take its values together, or changes of the diagram by name.

    names: what the values are called, if that is said. changes: as variants are, of which `values` are the names.
    """

    name: str
    paths: tuple[str, ...]
    values: tuple[Any, ...]
    node: Node
    names: tuple[str, ...] = ()
    changes: tuple[Variant, ...] = ()

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers without names."""
        return not self.names and all(isinstance(v, int | float) and not isinstance(v, bool) for v in self.values)

    def settings(self, at: int) -> tuple[tuple[str, Any], ...]:
        """What the value of that number sets, by path."""
        return tuple((path, self.values[at]) for path in self.paths)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The values as text: numbers with 12 digits, or with all where that does not tell two apart."""
        if self.names:
            return self.names
        short = tuple(_label(value, ".12g") for value in self.values)
        return short if len(set(short)) == len(short) else tuple(_label(value, ".17g") for value in self.values)


@dataclass(frozen=True)
class RunsAxis(GridAxis):
    """Runs that are listed one by one, each with settings of its own; the values are their numbers from 0."""

    listed: tuple[tuple[tuple[str, Any], ...], ...] = ()

    def settings(self, at: int) -> tuple[tuple[str, Any], ...]:
        """As of `GridAxis`."""
        return self.listed[at]


def _label(value: Any, style: str) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_label(item, style) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return format(value, style) if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Draw:
    """A random value at dotted paths: uniform from a to b, or normal with mean a and standard deviation b."""

    paths: tuple[str, ...]
    normal: bool
    a: np.ndarray
    b: np.ndarray
    node: Node


@dataclass(frozen=True)
class Bounds:
    """What a signal has to satisfy at time zero for a draw to count: least ≤ every element ≤ most."""

    signal: str
    least: float
    most: float
    node: Node


@dataclass(frozen=True)
class Random:
    """Random draws, the same ones for every variant and grid point."""

    count: int
    seed: int
    method: str
    draws: tuple[Draw, ...]
    accept: tuple[Bounds, ...]


@dataclass(frozen=True)
class Sought:
    """A probability that a study draws for until it is known: of `name` being violated, a requirement, or a metric.

    above, below: beyond which a metric counts as that. Draws end where the probability is surely less, or surely more,
    than `probability`; confidence: in that, at whichever draw it is.
    """

    name: str
    above: float | None
    below: float | None
    probability: float
    confidence: float
    node: Node


@dataclass(frozen=True)
class Search:
    """Where violations are looked for. space: what is varied, as of one draw; runs: at most, for each requirement.

    requirements: their names, None for all.
    """

    space: Random
    requirements: tuple[Node, ...] | None
    runs: int
    node: Node


@dataclass(frozen=True)
class Tuning:
    """What is tuned: over `space`, so that `objective` becomes small, with every metric of `subject` within its bounds.

    conditions: one of CONDITIONS. accuracy: as of the key. held_out: how many draws are kept back. runs: at most.
    """

    space: Random
    objective: Node
    subject: tuple[Bounds, ...]
    conditions: str
    accuracy: float
    held_out: int
    runs: int
    node: Node


@dataclass(frozen=True)
class Measured:
    """A signal, or an element of it, that has been measured. column: of the data, in `unit`; None: that of the signal.

    deviation: the standard deviation of its noise; nominal: what counts as one where none is known. Both in that unit.
    """

    signal: str
    index: tuple[int, ...]
    column: Node
    unit: str | None
    deviation: float | None
    nominal: float
    node: Node

    @property
    def label(self) -> str:
        """How it is written."""
        return f"{self.signal}[{', '.join(map(str, self.index))}]" if self.index else self.signal


@dataclass(frozen=True)
class Fit:
    """What is fitted: over `space`, so that runs come near the measured columns of the file `data`, at its `time`."""

    space: Random
    data: Node
    time: Node
    measured: tuple[Measured, ...]
    starts: int
    runs: int
    node: Node


@dataclass(frozen=True)
class Sighting:
    """What is looked at of each run: signals as written, block.port, with elements from 1, at times (k,) in s.

    Between two samples of a run, it is on the straight line that joins them.
    """

    signals: tuple[tuple[str, tuple[int, ...]], ...]
    times: np.ndarray

    def of(self, times: np.ndarray, samples: Mapping[str, np.ndarray]) -> list[list[float]] | None:
        """The values of each signal from samples (k, *shape); None where they end too early, or are not finite."""
        if not times.size or self.times[-1] > times[-1] * (1.0 + 1e-9):
            return None
        found = []
        for signal, index in self.signals:
            chosen: tuple[Any, ...] = (slice(None), *(number - 1 for number in index))
            found.append(np.interp(self.times, times, samples[signal][chosen].astype(float)).tolist())
        return found if np.isfinite(found).all() else None


@dataclass(frozen=True)
class TableColumn:
    """One figure of a table: a metric, reduced over what the rows leave open.

    statistic: one of STATISTICS, or a quantile from 0 to 1; None for that of OVER_RUNS. above, below: the share of runs
    beyond a limit instead. deviation: whether the standard deviation stands behind it, which is a mean then.
    """

    heading: str
    metric: Node
    statistic: str | float | None = None
    above: float | None = None
    below: float | None = None
    format: str = ".3g"
    deviation: bool = False


@dataclass(frozen=True)
class TableLayout:
    """A table: one row for each combination of the named dimensions, one column for each figure."""

    title: str
    rows: tuple[str, ...]
    columns: tuple[TableColumn, ...]
    transpose: bool
    node: Node


@dataclass(frozen=True)
class Reference:
    """A figure from elsewhere: what a variant's metric is according to `origin`."""

    origin: str
    variant: str
    metric: Node
    value: float


@dataclass(frozen=True)
class Question:
    """Runs of `baseline` whose metric is not beyond the limit are looked at in every other variant."""

    baseline: str
    metric: Node
    above: float | None
    below: float | None


@dataclass
class Study:
    """A study file, checked against the grammar.

    metrics: the names to keep, None for all.
    classes: those of a program's that diagrams may name with `block:`.
    record: None, or what replaces the diagram's own recording, which an empty mapping leaves as it is.
    sighting: what is looked at of each run, which no file says by itself.
    """

    title: str
    description: str
    path: Path
    text: str
    variants: dict[str, Variant]
    grid: tuple[GridAxis, ...] = ()
    random: Random | None = None
    metrics: tuple[Node, ...] | None = None
    added_metrics: Node | None = None
    requirements: Node | None = None
    until: tuple[Sought, ...] = ()
    search: Search | None = None
    tuning: Tuning | None = None
    fit: Fit | None = None
    sighting: Sighting | None = None
    record: Node | None = None
    tables: tuple[TableLayout, ...] = ()
    references: tuple[Reference, ...] = ()
    question: Question | None = None
    figures: list[Figure] = field(default_factory=list)
    classes: Mapping[str, type[Block]] = field(default_factory=dict)

    @property
    def spaces(self) -> tuple[Random, ...]:
        """What is drawn, searched, tuned and fitted over."""
        sections = (self.search, self.tuning, self.fit)
        found = (self.random, *(section.space for section in sections if section))
        return tuple(space for space in found if space)

    @property
    def records(self) -> bool:
        """Whether members write their signals."""
        return self.record is not None

    @property
    def origins(self) -> tuple[str, ...]:
        """Where the study's references come from."""
        return tuple(dict.fromkeys(reference.origin for reference in self.references))

    @property
    def dimensions(self) -> tuple[str, ...]:
        """The names of the study's dimensions, in order."""
        return ("variant", *(axis.name for axis in self.grid), *(("draw",) if self.random else ()))
