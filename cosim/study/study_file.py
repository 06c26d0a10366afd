"""Reads a study from YAML; every mistake has its place.

What blocks and metrics there are is not known here: `cosim.study.variants` checks against the diagrams.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import (
    CosimError,
    DiagramErrors,
    MissingKey,
    Position,
    Problems,
    TooLarge,
    WrongFile,
    WrongType,
    WrongValue,
)
from cosim.language import grammar, source
from cosim.language.grammar import ANY, Layer, Reader
from cosim.language.source import Node, describe
from cosim.plot import figures
from cosim.study import consistency, plan
from cosim.study.definition import (
    METHODS,
    STATISTICS,
    Axis,
    Bounds,
    Column,
    Draw,
    Question,
    Random,
    Reference,
    Study,
    TableLayout,
    Variant,
)

MOST_VALUES = 1_000_000  # of one axis of the grid
MOST_DEVIATIONS = 10  # that a normal draw may be away from its mean
_VALUE: dict[str, Any] = {}
_NAMED = {ANY: _VALUE}
_OVERLAY = {key: Layer(below) for key, below in grammar.DIAGRAM.items() if key not in ("title", "extends")}
GRAMMAR: dict[str, Any] = {
    **dict.fromkeys(("title", "description", "diagram"), _VALUE),
    "variants": {ANY: {"diagram": _VALUE, "description": _VALUE, "swap": _NAMED, "set": Layer(_NAMED), **_OVERLAY}},
    "grid": _NAMED,
    "random": {**dict.fromkeys(("count", "seed", "method"), _VALUE), "draws": _NAMED, "accept": _NAMED},
    "metrics": _VALUE,
    "record": _VALUE,
    "tables": {ANY: dict.fromkeys(("rows", "columns", "transpose"), _VALUE)},
    "references": {ANY: _NAMED},
    "explain": dict.fromkeys(("baseline", "metric", "above", "below"), _VALUE),
    "figures": _NAMED,
}


def load(path: str | Path, settings: Iterable[str] = ()) -> Study:
    """Read a study; `settings` replace values in it, such as ``random.count=20``. Raises: DiagramErrors."""
    problems = Problems()
    path = Path(path)
    try:
        tree = _with_settings(source.read(path, problems), settings)
        study = _StudyReader(path, problems).study(tree)
    except CosimError as error:
        problems.add(error)
        raise DiagramErrors(problems.errors) from None
    problems.raise_if_any()
    return study


def _with_settings(tree: Node, settings: Iterable[str]) -> Node:
    """The tree with `a.b=value` applied; the grammar, checked afterwards, names what it does not have."""
    for setting in settings:
        position = Position(f"--set {setting}")
        path, equals, text = setting.partition("=")
        if not equals:
            raise WrongValue(f"`{setting}` is no setting", position, "write --set random.count=20")
        value = source.parse_value(text, position)
        tree = _at(tree, path.strip().split("."), replace(value, key_position=position))
    return tree


def _at(tree: Node, path: list[str], value: Node) -> Node:
    if not path:
        return value
    entries = dict(tree.value) if isinstance(tree.value, dict) else {}
    child = entries.get(path[0], Node({}, value.position, value.position))
    entries[path[0]] = _at(child, path[1:], value)
    return replace(tree, value=entries)


class _StudyReader:
    """Reads the sections of a study; every mistake goes to `problems`."""

    def __init__(self, path: Path, problems: Problems) -> None:
        self.path = path
        self.problems = problems
        self.reader = Reader(problems)

    def study(self, tree: Node) -> Study:
        """The study that a tree says. Raises: MissingKey if it names no diagram."""
        if "diagram" not in tree.value and {"blocks", "extends"} & set(tree.value):
            key = next(key for key in ("blocks", "extends") if key in tree.value)
            raise WrongFile(f"`{self.path}` is a diagram, not a study", tree.value[key].place, f"cosim run {self.path}")
        tree = grammar.conform(_empty_variants(tree), self.problems, GRAMMAR, "study")
        sections = tree.value
        if "diagram" not in sections:
            raise MissingKey("the study names no diagram", tree.position, "write diagram: ../formation.yaml")
        base, place = self._file(sections["diagram"]), sections["diagram"].position
        entries = self._entries(sections, "variants")
        variants = {name: self._variant(name, node, base, place) for name, node in entries.items()}
        title = self._text(sections, "title", self.path.stem)
        study = Study(title, self._text(sections, "description", ""), self.path, "", variants)
        study.text = source.dump(tree.plain())
        study.variants = variants or {"base": Variant("base", base, place)}
        study.grid = self._grid(self._entries(sections, "grid"))
        study.random = self._random(sections["random"]) if "random" in sections else None
        study.metrics, study.added_metrics = self._metrics(sections.get("metrics"))
        study.record = self._record(sections.get("record"))
        tables = self._entries(sections, "tables")
        study.tables = tuple(self._table(title, node, study) for title, node in tables.items())
        study.references = self._references(self._entries(sections, "references"), study)
        study.question = self._question(sections["explain"], study) if "explain" in sections else None
        study.figures = figures.read(self._entries(sections, "figures"), self.problems)
        consistency.check(study, entries, self.problems)
        return study

    def _entries(self, sections: dict[str, Node], key: str) -> dict[str, Node]:
        return sections[key].value if key in sections else {}

    def _text(self, sections: dict[str, Node], key: str, default: str) -> str:
        return self.reader.text(sections[key], key) if key in sections else default

    def _file(self, node: Node) -> Path:
        return Path(os.path.normpath(self.path.parent / self.reader.text(node, "diagram")))

    def _variant(self, name: str, node: Node, base: Path, place: Position) -> Variant:
        entries = node.value
        overlay = {k: n for k, n in entries.items() if k in _OVERLAY}
        return Variant(
            name,
            self._file(entries["diagram"]) if "diagram" in entries else base,
            entries["diagram"].position if "diagram" in entries else place,
            self._text(entries, "description", ""),
            Node(overlay, node.position) if overlay else None,
            self._entries(entries, "swap"),
            self._entries(entries, "set"),
        )

    def _grid(self, entries: dict[str, Node]) -> tuple[Axis, ...]:
        return tuple(
            Axis(short_name(path), _paths(path), self._axis(path, node), node) for path, node in entries.items()
        )

    def _axis(self, path: str, node: Node) -> tuple[Any, ...]:
        if isinstance(node.value, list) and node.value:
            return tuple(self._axis_value(item, path) for item in node.value)
        kinds: dict[str, Any] = {"linspace": np.linspace, "geomspace": np.geomspace, "range": np.arange}
        kind = next(iter(node.value)) if isinstance(node.value, dict) and len(node.value) == 1 else ""
        items = node.value[kind].value if kind in kinds else None
        if not isinstance(items, list) or len(items) != 3:
            fix = "write [1, 2, 3], {linspace: [first, last, count]}, {geomspace: …} or {range: [from, to, step]}"
            self.reader.wrong(node, f"`grid.{path}` takes a list of values, not {describe(node)}", fix)
            return (0.0,)
        first, last, third = (self.reader.number(item, f"grid.{path}.{kind}") for item in items)
        if kind == "range":
            third = self.reader.positive(items[2], f"grid.{path}.range")
            if last < first:
                message = f"`grid.{path}`: from {first:g} to {last:g} there is no value"
                self.reader.wrong(node, message, "exchange the first two numbers", WrongValue)
                return (first,)
            if (last - first) / third >= MOST_VALUES:
                message = f"`grid.{path}`: from {first:g} to {last:g} there are too many steps of {third:g}"
                self.reader.wrong(items[2], message, f"at most {MOST_VALUES} values", TooLarge)
                return (first,)
            values = np.arange(first, last + 1e-9 * third, third)
        elif not np.isfinite(last - first):
            message = f"`grid.{path}`: from {first:g} to {last:g} is beyond all numbers"
            self.reader.wrong(node, message, "give a smaller range", WrongValue)
            return (first,)
        elif kind == "geomspace" and not first * last > 0:
            message = f"`grid.{path}`: from {first:g} to {last:g} there are no constant ratios"
            self.reader.wrong(node, message, "give two numbers of one sign, neither of them 0", WrongValue)
            return (first,)
        else:
            values = kinds[kind](first, last, self.reader.count(items[2], f"grid.{path}.{kind}", MOST_VALUES))
        return tuple(values.tolist())

    def _axis_value(self, node: Node, path: str) -> Any:
        """One value of a list: a number, text, true or false, or a list of them."""
        if node.value is None or isinstance(node.value, dict):
            self.reader.wrong(node, f"a value of `grid.{path}` cannot be {describe(node)}", "write a number or text")
            return 0.0
        if isinstance(node.value, list):
            return [self._axis_value(item, path) for item in node.value]
        return node.value

    def _random(self, node: Node) -> Random | None:
        entries = node.value
        for key in ("count", "draws"):
            if key not in entries:
                self.problems.add(MissingKey(f"`random` has no `{key}`", node.place, "write random: {count: 100, …}"))
                return None
        seed = self._seed(entries["seed"]) if "seed" in entries else 0
        draws = [self._draw(path, n) for path, n in self._entries(entries, "draws").items()]
        accept = [self._bounds(name, n) for name, n in self._entries(entries, "accept").items()]
        if not entries["draws"].value:
            self.reader.wrong(entries["draws"], "`random.draws` draws nothing", "write a path and its distribution")
        return Random(
            self.reader.count(entries["count"], "random.count", plan.MOST_MEMBERS),
            seed,
            self.reader.choice(entries["method"], "random.method", METHODS) if "method" in entries else METHODS[0],
            tuple(draw for draw in draws if draw),
            tuple(accept),
        )

    def _seed(self, node: Node) -> int:
        seed = self.reader.number(node, "random.seed", 0.0)
        if not (0 <= seed < 2**53 and seed.is_integer()):
            fix = "such as 0, 1, 2"
            message = f"`random.seed` must be a whole number from 0, not {describe(node)}"
            self.reader.wrong(node, message, fix, WrongValue)
            return 0
        return int(seed)

    def _draw(self, path: str, node: Node) -> Draw | None:
        where = f"random.draws.{path}"
        kind = next(iter(node.value)) if isinstance(node.value, dict) and len(node.value) == 1 else ""
        pair = node.value[kind].value if kind in ("uniform", "normal") else None
        if not isinstance(pair, list) or len(pair) != 2:
            fix = "write {uniform: [least, most]} or {normal: [mean, deviation]}"
            self.reader.wrong(node, f"`{where}` takes a distribution, not {describe(node)}", fix)
            return None
        a, b = (self._numbers(item, where) for item in pair)
        try:
            np.broadcast_shapes(a.shape, b.shape)
        except ValueError:
            self.reader.wrong(node, f"the two bounds of `{where}` differ in shape", "give both one number", WrongValue)
            return None
        if (kind == "uniform" and np.any(a > b)) or (kind == "normal" and np.any(b < 0)):
            self.reader.wrong(node, f"`{where}` has its bounds the wrong way round", "exchange them", WrongValue)
        with np.errstate(over="ignore"):
            range_ = b - a if kind == "uniform" else np.abs(a) + MOST_DEVIATIONS * b
        if not np.all(np.isfinite(range_)):
            self.reader.wrong(node, f"`{where}` has a range beyond all numbers", "give a smaller range", WrongValue)
        return Draw(_paths(path), kind == "normal", a, b, node)

    def _numbers(self, node: Node, where: str) -> np.ndarray:
        if not isinstance(node.value, list):
            return np.array(self.reader.number(node, where))
        if not node.value:
            self.reader.wrong(node, f"a list of `{where}` is empty", "give one number, or one for each element")
            return np.zeros(())
        parts = [self._numbers(item, where) for item in node.value]
        if any(part.shape != parts[0].shape for part in parts):
            self.reader.wrong(node, f"the rows of `{where}` differ in length", "give rows of one length", WrongValue)
            return np.zeros(())
        return np.array(parts)

    def _bounds(self, signal: str, node: Node) -> Bounds:
        where = f"random.accept.{signal}"
        known = {"least": _VALUE, "most": _VALUE}
        entries = grammar.conform(node, self.problems, known, where).value
        if not entries:
            self.reader.wrong(node, f"`{where}` has no bound", "write {least: 0.1} or {most: 1}", WrongValue)
        least = self.reader.number(entries["least"], where) if "least" in entries else -np.inf
        most = self.reader.number(entries["most"], where) if "most" in entries else np.inf
        if least > most:
            message = f"`{where}`: nothing is at least {least:g} and at most {most:g}"
            self.reader.wrong(node, message, "exchange them", WrongValue)
        return Bounds(signal, least, most, node)

    def _metrics(self, node: Node | None) -> tuple[tuple[Node, ...] | None, Node | None]:
        """The names of the metrics to keep, and the definitions of those that the diagram does not have."""
        if node is None:
            return None, None
        if isinstance(node.value, dict):
            return tuple(replace(n, value=key, position=n.place) for key, n in node.value.items()), node
        if isinstance(node.value, list):
            return tuple(n for n in node.value if self.reader.text(n, "metrics")), None
        self.reader.wrong(node, f"`metrics` takes a list of names, not {describe(node)}", "write [N_x, N_v]", WrongType)
        return None, None

    def _record(self, node: Node | None) -> Node | None:
        """None, or what is recorded: a mapping as in a diagram, empty for the diagram's own."""
        if node is None or node.value is False:
            return None
        if node.value is True:
            return replace(node, value={})
        return grammar.conform(node, self.problems, grammar.DIAGRAM["record"], "record")

    def _table(self, title: str, node: Node, study: Study) -> TableLayout:
        where = f"tables.{title}"
        rows = node.value.get("rows")
        given = rows.value if rows and isinstance(rows.value, list) else [rows] if rows else []
        names: list[str] = []
        for row in given:
            name = self._dimension(row, f"{where}.rows", study)
            if name in names:
                self.reader.wrong(row, f"`{where}.rows` has `{name}` twice", "write it once", WrongValue)
            elif name:
                names.append(name)
        columns = node.value.get("columns")
        transpose = "transpose" in node.value and self.reader.truth(node.value["transpose"], f"{where}.transpose")
        return TableLayout(title, tuple(names) or ("variant",), self._columns(where, columns), transpose, node)

    def _dimension(self, node: Node, where: str, study: Study) -> str | None:
        """A dimension by its name, or by the end of its name that no other has; else a report and None."""
        ends = [name for name in study.dimensions if name.endswith(f".{node.value}")]
        if node.value not in study.dimensions and len(ends) == 1:
            return ends[0]
        name: str = self.reader.choice(node, where, study.dimensions)
        return name if name == node.value else None

    def _columns(self, where: str, node: Node | None) -> tuple[Column, ...]:
        if node is None:
            return ()
        if isinstance(node.value, list):
            names = [n for n in node.value if self.reader.text(n, f"{where}.columns")]
            return tuple(Column(n.value, n) for n in names)
        if isinstance(node.value, dict):
            found = [self._column(f"{where}.columns.{head}", head, n) for head, n in node.value.items()]
            return tuple(column for column in found if column)
        self.reader.wrong(node, f"`{where}.columns` takes names of metrics", "write [N_x, N_v]")
        return ()

    def _column(self, where: str, heading: str, node: Node) -> Column | None:
        known = dict.fromkeys(("metric", "over", "above", "below", "format"), _VALUE)
        entries = grammar.conform(node, self.problems, known, where).value
        if "metric" not in entries:
            self.problems.add(MissingKey(f"`{where}` names no metric", node.place, "write {metric: N_x}"))
            return None
        limits = {key: self.reader.number(entries[key], where) for key in ("above", "below") if key in entries}
        statistic = self._statistic(where, entries["over"]) if "over" in entries else None
        if limits and "over" in entries:
            message = f"`{where}`: beside `{next(iter(limits))}` nothing is reduced by `over`, as a share is counted"
            self.reader.wrong(entries["over"], message, f"remove `over`, or `{' and '.join(limits)}`", WrongValue)
        style = self._format(where, entries["format"]) if "format" in entries else (".1%" if limits else ".3g")
        return Column(heading, entries["metric"], statistic, limits.get("above"), limits.get("below"), style)

    def _statistic(self, where: str, node: Node) -> str | float:
        if isinstance(node.value, int | float) and not isinstance(node.value, bool) and 0 <= node.value <= 1:
            return float(node.value)
        if isinstance(node.value, int | float) and 1 < node.value <= 100:
            message = f"`{where}.over` takes a quantile from 0 to 1, not {describe(node)}"
            self.reader.wrong(node, message, f"{node.value / 100:g} is the {node.value:g} % quantile", WrongValue)
            return 1.0
        return self.reader.choice(node, f"{where}.over", STATISTICS)

    def _format(self, where: str, node: Node) -> str:
        try:
            format(1.0, str(node.value))
        except ValueError:
            self.reader.wrong(node, f"`{where}.format` cannot be {describe(node)}", "such as .2e", WrongValue)
            return ".3g"
        return str(node.value)

    def _references(self, entries: dict[str, Node], study: Study) -> tuple[Reference, ...]:
        found: list[Reference] = []
        for origin, variants in entries.items():
            for name, node in variants.value.items():
                known = replace(node, value=name, position=node.place)
                variant = self.reader.choice(known, f"references.{origin}", study.variants)
                figures = grammar.conform(node, self.problems, _NAMED, f"references.{origin}.{name}").value
                for metric, number in figures.items():
                    named = replace(number, value=metric, position=number.place)
                    value = self.reader.number(number, f"{origin}.{metric}")
                    found.append(Reference(origin, variant, named, value))
        return tuple(found)

    def _question(self, node: Node, study: Study) -> Question | None:
        entries = node.value
        if not {"baseline", "metric"} <= set(entries) or not {"above", "below"} & set(entries):
            fix = "write explain: {baseline: variant, metric: min_gap, above: 0}"
            self.problems.add(MissingKey("`explain` needs a baseline, a metric and a limit", node.place, fix))
            return None
        limits = [self.reader.number(entries[k], f"explain.{k}") if k in entries else None for k in ("above", "below")]
        baseline = self.reader.choice(entries["baseline"], "explain.baseline", study.variants)
        return Question(baseline, entries["metric"], *limits)


def _paths(text: str) -> tuple[str, ...]:
    """The dotted paths of a key; several, with commas between, take the same value."""
    return tuple(part.strip() for part in text.split(","))


def short_name(paths: str) -> str:
    """What an axis or a draw is called, whatever others there are: `plant.mass` for `blocks.plant.parameters.mass`."""
    parts = _paths(paths)[0].split(".")
    is_value = len(parts) > 3 and parts[0] == "blocks" and parts[2] in ("parameters", "start")
    return ".".join([parts[1], *parts[3:]] if is_value else parts)


def _empty_variants(tree: Node) -> Node:
    """A variant of which nothing is said, `name:`, is the diagram as it is."""
    variants = tree.value.get("variants")
    if variants is None or not isinstance(variants.value, dict):
        return tree
    filled = {k: replace(n, value={}) if n.value is None else n for k, n in variants.value.items()}
    return replace(tree, value={**tree.value, "variants": replace(variants, value=filled)})
