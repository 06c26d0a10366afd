"""Tables of a study: rows are combinations of its dimensions, columns are figures reduced over the rest."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.language.source import Node
from cosim.requirements.margins import NO_MARGIN
from cosim.results.metrics import REDUCTIONS, reduction
from cosim.results.text_table import TextTable
from cosim.study.dataset import metric_names, scalar
from cosim.study.definition import OVER_RUNS, STEP_TIME, Study, TableColumn, TableLayout
from cosim.study.kept import interval
from cosim.study.member_run import Row
from cosim.study.running import FAILED, Results


def tables(results: Results) -> list[TextTable]:
    """The study's tables; one of all metrics if it names none."""
    rows = list(results.rows())
    study, reductions = results.study, results.reductions
    layouts = study.tables or (_default(study, rows),)
    return [_table(layout, study, rows, reductions) for layout in layouts]


def _default(study: Study, rows: list[Row]) -> TableLayout:
    place = next(iter(study.variants.values())).diagram_position
    columns = tuple(TableColumn(name, Node(name, place)) for name in metric_names(rows))
    dimensions = tuple(d for d in study.dimensions if d != "draw")
    return TableLayout(study.title, dimensions, columns, False, Node({}, place))


def _table(layout: TableLayout, study: Study, rows: list[Row], reductions: Mapping[str, str]) -> TextTable:
    columns = [with_statistic(column, reductions) for column in layout.columns or _default(study, rows).columns]
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(_at(study, row, dimension) for dimension in layout.rows), []).append(row)
    several = any(len(group) > 1 for group in groups.values())
    values = [[cell(column, group) for column in columns] for group in groups.values()]
    off = [[deviation(column, group) for column in columns] for group in groups.values()]
    sizes = [len(group) for group in groups.values()]
    lines_of = zip(values, off, sizes, strict=True)
    texts = [
        [_text(value, around, column, size) for value, around, column in zip(line, spread, columns, strict=True)]
        for line, spread, size in lines_of
    ]
    headings = [heading(column) if several else column.heading for column in columns]
    head = [*layout.rows, *headings]
    labels = [[label(study, group[0], dimension) for dimension in layout.rows] for group in groups.values()]
    notes = [*_notes(rows, several), *_arrays(columns, rows)]
    if not layout.transpose:
        lines = [[*own, *line] for own, line in zip(labels, texts, strict=True)]
        return TextTable(layout.title, head, lines, values, notes, off)
    across = [", ".join(own) for own in labels]
    lines = [[text, *(line[k] for line in texts)] for k, text in enumerate(headings)]
    turned, around = ([[line[k] for line in grid] for k in range(len(columns))] for grid in (values, off))
    return TextTable(layout.title, ["", *across], lines, turned, notes, around)


def _notes(rows: list[Row], several: bool) -> list[str]:
    """What a reader of figures has to know of the runs that did not come to their end."""
    lost = sum(row["status"] in FAILED for row in rows)
    if not lost:
        return []
    shares = "; to a share they count as runs without the figure where they have none" if several else ""
    return [f"{lost} of {len(rows)} runs did not come to their end: figures are of the time until then{shares}."]


def _arrays(columns: Sequence[TableColumn], rows: Sequence[Row]) -> list[str]:
    """What a reader has to know of figures that a cell has no room for."""
    for_all = dict.fromkeys(str(column.metric.value) for column in columns)
    values = {name: [row["metrics"].get(name) for row in rows] for name in for_all}
    arrays = [name for name, found in values.items() if any(v is not None and scalar(v) is None for v in found)]
    return [f"Arrays, which `study.nc` alone holds: {', '.join(arrays)}."] if arrays else []


def with_statistic(column: TableColumn, reductions: Mapping[str, str]) -> TableColumn:
    """The column with the statistic that its metric has if nothing is said: a minimum is reduced by the minimum."""
    if column.statistic is not None:
        return column
    name = str(column.metric.value)
    return replace(column, statistic="median" if name == STEP_TIME else OVER_RUNS[reductions[name]])


def heading(column: TableColumn) -> str:
    """A column's heading with the name of its statistic, unless it says it already."""
    if column.above is not None or column.below is not None:
        name = "share"
    elif column.deviation:
        name = "mean ± std"
    elif isinstance(column.statistic, float):
        name = f"{100 * column.statistic:g} % quantile"
    else:
        name = str(column.statistic)
    words = re.split(r"[\W_]+", column.heading.lower())
    return column.heading if name in words else f"{column.heading}, {name}"


def cell(column: TableColumn, rows: list[Row]) -> float | None:
    """A column's figure over some members; a share counts all of them, a statistic those that have the metric.

    None if none has it. A NaN among them makes every statistic NaN, as in a run.
    """
    name = str(column.metric.value)
    if column.above is not None or column.below is not None:
        known = [found for row in rows if (found := number(row, name)) is not None]
        return float(satisfies(np.array(known), column.above, column.below).sum() / len(rows))
    numbers = np.array([found for row in rows if (found := _figure(row, name)) is not None])
    if not numbers.size:
        return None
    return _statistic("max" if column.statistic is None else column.statistic, numbers)


def _figure(row: Row, name: str) -> float | None:
    """A figure of a run, if it has that and it is no array."""
    if name == STEP_TIME:
        return 1e6 * row["seconds"] / row["steps"] if row["steps"] else None
    return scalar(row["metrics"].get(name))


def number(row: Row, name: str) -> float | None:
    """A figure of a run, if it has that and it is no array; a margin of zero is on the side that its verdict says."""
    found = _figure(row, name)
    holds, _ = row.get("requirements", {}).get(name, (None, ""))
    return (NO_MARGIN if holds else -NO_MARGIN) if found == 0.0 and holds is not None else found


def deviation(column: TableColumn, rows: list[Row]) -> float | None:
    """The standard deviation of a column that has one, as of `std`: over all runs; None of fewer than two."""
    numbers = [n for row in rows if (n := _figure(row, str(column.metric.value))) is not None]
    return _statistic("std", np.array(numbers)) if column.deviation and len(numbers) > 1 else None


def _statistic(name: str | float, numbers: np.ndarray) -> float:
    """One of `STATISTICS`, or a quantile, of at least one number."""
    if name in REDUCTIONS:
        figure = reduction(str(name))
        figure.update(np.zeros(numbers.size), numbers)
        return float(figure.value())
    with np.errstate(invalid="ignore", over="ignore"):  # NaN is what lies between two infinities
        return float(np.std(numbers)) if name == "std" else _quantile(numbers, 0.5 if name == "median" else float(name))


def _quantile(numbers: np.ndarray, share: float) -> float:
    """As of `np.quantile`, which makes NaN of infinities: of two neighbours, the infinite one has all the weight."""
    if not np.isinf(numbers).any() or np.isnan(numbers).any():
        return float(np.quantile(numbers, share))
    ordered, place = np.sort(numbers), share * (numbers.size - 1)
    low, high = ordered[math.floor(place)], ordered[math.ceil(place)]
    return float(low + high if np.isinf([low, high]).any() else low + (high - low) * (place % 1))


def satisfies(numbers: np.ndarray, above: float | None, below: float | None) -> np.ndarray:
    """Which numbers are above and below the limits; NaN is not."""
    result: np.ndarray = ~np.isnan(numbers)
    if above is not None:
        result &= numbers > above
    if below is not None:
        result &= numbers < below
    return result


def label(study: Study, row: Row, dimension: str) -> str:
    """Where a member stands on one of the study's dimensions, as text."""
    at = _at(study, row, dimension)
    axis = next((axis for axis in study.grid if axis.name == dimension), None)
    return axis.labels[at] if axis else str(at)


def _at(study: Study, row: Row, dimension: str) -> Any:
    """Where a member stands on a dimension: a variant's name, or a number from 0."""
    if dimension in ("variant", "draw"):
        return row[dimension]
    return row["grid"][[axis.name for axis in study.grid].index(dimension)]


def _text(value: float | None, around: float | None, column: TableColumn, runs: int) -> str:
    """A cell's text; runs: how many it is of."""
    if value is None:
        return "—"
    text = format(value, column.format)
    if column.interval:
        low, high = (format(bound, column.format) for bound in interval(round(value * runs), runs))
        return f"{text} ({low} … {high})"
    return text if around is None else f"{text} ± {format(around, column.format)}"
