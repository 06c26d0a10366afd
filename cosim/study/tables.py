"""Tables of a study: rows are combinations of its dimensions, columns are figures reduced over the rest."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.study.dataset import metric_names, scalar
from cosim.study.member import Row
from cosim.study.model import Column, Study, TableLayout
from cosim.study.running import Results


@dataclass
class Table:
    """A table as text, and its cells as numbers: values[row][column]."""

    title: str
    head: list[str]
    rows: list[list[str]]
    values: list[list[float]] = field(default_factory=list)


def tables(results: Results) -> list[Table]:
    """The study's tables; one of all metrics if it names none."""
    rows = list(results.rows())
    study = results.study
    layouts = study.tables or (_default(study, rows),)
    return [_table(layout, study, rows) for layout in layouts]


def write(results: Results, made: Sequence[Table]) -> None:
    """Write each table as CSV, with all digits, and as Markdown, beside the study's data set."""
    for table in made:
        stem = results.folder / "".join(c if c.isalnum() else "_" for c in table.title.lower())
        stem.with_suffix(".md").write_text(markdown(table), encoding="utf-8")
        with stem.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(table.head)
            labels = len(table.head) - len(table.values[0]) if table.values else 0
            for texts, values in zip(table.rows, table.values, strict=True):
                writer.writerow([*texts[:labels], *map(repr, values)])


def markdown(table: Table) -> str:
    """The table in Markdown."""
    text = io.StringIO()
    lines = [table.head, ["---"] * len(table.head), *table.rows]
    text.write(f"**{table.title}**\n\n")
    for line in lines:
        text.write("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n")
    return text.getvalue()


def _default(study: Study, rows: list[Row]) -> TableLayout:
    from cosim.source import Node

    place = next(iter(study.variants.values())).diagram_position
    columns = tuple(Column(name, Node(name, place)) for name in metric_names(rows))
    dimensions = tuple(d for d in study.dimensions if d != "draw")
    return TableLayout(study.title, dimensions, columns, False, Node({}, place))


def _table(layout: TableLayout, study: Study, rows: list[Row]) -> Table:
    columns = layout.columns or _default(study, rows).columns
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(label(study, row, dimension) for dimension in layout.rows), []).append(row)
    values = [[cell(column, group) for column in columns] for group in groups.values()]
    texts = [[_text(v, c) for v, c in zip(line, columns, strict=True)] for line in values]
    head = [*layout.rows, *(column.heading for column in columns)]
    if not layout.transpose:
        lines = [[*labels, *line] for labels, line in zip(groups, texts, strict=True)]
        return Table(layout.title, head, lines, values)
    names = [", ".join(labels) for labels in groups]
    lines = [[column.heading, *(line[k] for line in texts)] for k, column in enumerate(columns)]
    turned = [[line[k] for line in values] for k in range(len(columns))]
    return Table(layout.title, ["", *names], lines, turned)


def cell(column: Column, rows: list[Row]) -> float:
    """A column's figure over some members; a share counts all of them, a statistic those that have the metric."""
    numbers = np.array([scalar(row["metrics"].get(str(column.metric.value))) for row in rows])
    if column.above is not None or column.below is not None:
        return float(np.mean(satisfies(numbers, column.above, column.below)))
    numbers = numbers[~np.isnan(numbers)]
    if not numbers.size:
        return math.nan
    if isinstance(column.statistic, float):
        return float(np.quantile(numbers, column.statistic))
    return float(getattr(np, column.statistic)(numbers))


def satisfies(numbers: np.ndarray, above: float | None, below: float | None) -> np.ndarray:
    """Which numbers are above and below the limits; NaN is not."""
    result = ~np.isnan(numbers)
    if above is not None:
        result &= numbers > above
    if below is not None:
        result &= numbers < below
    return result


def label(study: Study, row: Row, dimension: str) -> str:
    """Where a member stands on one of the study's dimensions, as text."""
    if dimension in ("variant", "draw"):
        return str(row[dimension])
    at = [axis.name for axis in study.grid].index(dimension)
    value: Any = study.grid[at].values[row["grid"][at]]
    return f"{value:.6g}" if isinstance(value, float) else str(value) if isinstance(value, int) else json.dumps(value)


def _text(value: float, column: Column) -> str:
    return "—" if math.isnan(value) else format(value, column.format)
