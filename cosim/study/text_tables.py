"""Tables of a study: rows are combinations of its dimensions, columns are figures reduced over the rest."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.language.source import Node
from cosim.results.metrics import REDUCTIONS, reduction
from cosim.results.text_table import TextTable
from cosim.study import kept
from cosim.study.dataset import metric_names
from cosim.study.definition import OVER_RUNS, Study, TableColumn, TableLayout
from cosim.study.member_run import Row
from cosim.study.row_figures import figure, label, number, place_on, satisfies, scalar
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
        groups.setdefault(tuple(place_on(study, row, dimension) for dimension in layout.rows), []).append(row)
    several = any(len(group) > 1 for group in groups.values())
    values = [[cell(column, group) for column in columns] for group in groups.values()]
    off = [[deviation(column, group) for column in columns] for group in groups.values()]
    cells = [zip(line, around, columns, strict=True) for line, around in zip(values, off, strict=True)]
    bounds = [[_bounds(study, column, group) for column in columns] for group in groups.values()]
    texts = [
        [_text(*cell_, ends) for cell_, ends in zip(line, around, strict=True)]
        for line, around in zip(cells, bounds, strict=True)
    ]
    headings = [heading(column) if several else column.heading for column in columns]
    head = [*layout.rows, *headings]
    labels = [[label(study, group[0], dimension) for dimension in layout.rows] for group in groups.values()]
    notes = [*_notes(rows, several), *_arrays(columns, rows)]
    if any(ends for line in bounds for ends in line):
        notes.append(f"In parentheses: where the probability lies with {100 * kept.CONFIDENCE:g} % confidence.")
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
    return replace(column, statistic=OVER_RUNS[reductions[str(column.metric.value)]])


def heading(column: TableColumn) -> str:
    """A column's heading with the name of its statistic, unless it says it already."""
    if is_share(column):
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
    if is_share(column):
        known = [found for row in rows if (found := number(row, name)) is not None]
        return float(satisfies(np.array(known), column.above, column.below).sum() / len(rows))
    numbers = np.array([found for row in rows if (found := figure(row, name)) is not None])
    if not numbers.size:
        return None
    return _statistic("max" if column.statistic is None else column.statistic, numbers)


def deviation(column: TableColumn, rows: list[Row]) -> float | None:
    """The standard deviation of a column that has one, as of `std`: over all runs; None of fewer than two."""
    numbers = [n for row in rows if (n := figure(row, str(column.metric.value))) is not None]
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


def _text(value: float | None, around: float | None, column: TableColumn, bounds: tuple[float, float] | None) -> str:
    if value is None:
        return "—"
    text = format(value, column.format)
    if bounds:
        return f"{text} ({' … '.join(format(end, column.format) for end in bounds)})"
    return text if around is None else f"{text} ± {format(around, column.format)}"


def _bounds(study: Study, column: TableColumn, rows: Sequence[Row]) -> tuple[float, float] | None:
    """Where the probability of a share lies, as of `kept.interval`; None where runs are not drawn alike."""
    alike = len({(row["variant"], tuple(row["grid"])) for row in rows}) == 1
    if not is_share(column) or not alike or not kept.draws_are_trials(study):
        return None
    name = str(column.metric.value)
    known = [found for row in rows if (found := number(row, name)) is not None]
    return kept.interval(int(satisfies(np.array(known), column.above, column.below).sum()), len(rows))


def is_share(column: TableColumn) -> bool:
    """Whether a column shows the share of runs beyond a limit."""
    return column.above is not None or column.below is not None
