"""Reads the section `tables` of a study: what the rows and the columns of each table are."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.errors import MissingKey, WrongValue
from cosim.language import grammar
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.study.definition import STATISTICS, Study, TableColumn, TableLayout
from cosim.study.study_keys import COLUMN, TABLE


def read(entries: Mapping[str, Node], study: Study, reader: Reader) -> tuple[TableLayout, ...]:
    """The tables by their titles; their rows are dimensions of the study."""
    return tuple(_table(title, node, study, reader) for title, node in entries.items())


def _table(title: str, node: Node, study: Study, reader: Reader) -> TableLayout:
    where = f"tables.{title}"
    rows = node.value.get("rows")
    given = rows.value if rows and isinstance(rows.value, list) else [rows] if rows else []
    names: list[str] = []
    for row in given:
        name = _dimension(row, f"{where}.rows", study, reader)
        if name in names:
            reader.wrong(row, f"`{where}.rows` has `{name}` twice", "write it once", WrongValue)
        elif name:
            names.append(name)
    columns = node.value.get("columns")
    transpose = "transpose" in node.value and read_value(
        TABLE["transpose"], node.value["transpose"], f"{where}.transpose", reader
    )
    return TableLayout(title, tuple(names) or ("variant",), _columns(where, columns, reader), transpose, node)


def _dimension(node: Node, where: str, study: Study, reader: Reader) -> str | None:
    """A dimension by its name, or by the end of its name that no other has; else a report and None."""
    ends = [name for name in study.dimensions if name.endswith(f".{node.value}")]
    if node.value not in study.dimensions and len(ends) == 1:
        return ends[0]
    name: str = reader.choice(node, where, study.dimensions)
    return name if name == node.value else None


def _columns(where: str, node: Node | None, reader: Reader) -> tuple[TableColumn, ...]:
    if node is None:
        return ()
    if isinstance(node.value, list) and not any(isinstance(n.value, dict) for n in node.value):
        names = [n for n in node.value if reader.text(n, f"{where}.columns")]
        return tuple(TableColumn(n.value, n) for n in names)
    if isinstance(node.value, dict):
        found = [_column(f"{where}.columns.{head}", head, n, reader) for head, n in node.value.items()]
        return tuple(column for column in found if column)
    reader.wrong(
        node,
        f"`{where}.columns` takes names of metrics, or headings with what stands below",
        "write [N_x, N_v], or {heading: {metric: N_x, over: mean}}",
    )
    return ()


def _column(where: str, heading: str, node: Node, reader: Reader) -> TableColumn | None:
    entries = grammar.conform(node, reader.problems, COLUMN, where).value
    if "metric" not in entries:
        reader.problems.add(MissingKey(f"`{where}` names no metric", node.place, "write {metric: N_x}"))
        return None
    limits = {key: read_value(COLUMN[key], entries[key], where, reader) for key in ("above", "below") if key in entries}
    both = "over" in entries and _is_mean_and_deviation(entries["over"])
    statistic = "mean" if both else _statistic(where, entries["over"], reader) if "over" in entries else None
    if limits and "over" in entries:
        message = f"`{where}`: beside `{next(iter(limits))}` nothing is reduced by `over`, as a share is counted"
        reader.wrong(entries["over"], message, f"remove `over`, or `{' and '.join(limits)}`", WrongValue)
    style = _format(where, entries["format"], reader) if "format" in entries else (".1%" if limits else ".3g")
    limit = limits.get("above"), limits.get("below")
    return TableColumn(heading, entries["metric"], statistic, *limit, style, both)


def _is_mean_and_deviation(node: Node) -> bool:
    return isinstance(node.value, list) and [item.value for item in node.value] == ["mean", "std"]


def _statistic(where: str, node: Node, reader: Reader) -> str | float:
    if isinstance(node.value, int | float) and not isinstance(node.value, bool) and 0 <= node.value <= 1:
        return float(node.value)
    if isinstance(node.value, int | float) and 1 < node.value <= 100:
        message = f"`{where}.over` takes a quantile from 0 to 1, not {describe(node)}"
        reader.wrong(node, message, f"{node.value / 100:g} is the {node.value:g} % quantile", WrongValue)
        return 1.0
    if isinstance(node.value, list):
        reader.wrong(node, f"`{where}.over` takes two statistics as [mean, std] only", "write over: [mean, std]")
        return "mean"
    return reader.choice(node, f"{where}.over", STATISTICS)


def _format(where: str, node: Node, reader: Reader) -> str:
    try:
        format(1.0, str(node.value))
    except ValueError:
        reader.wrong(node, f"`{where}.format` cannot be {describe(node)}", "such as .2e", WrongValue)
        return ".3g"
    return str(node.value)
