"""Reads a study from YAML; every mistake has its place.

What blocks and metrics there are is not known here: `cosim.study.variants` checks against the diagrams.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from cosim.errors import (
    CosimError,
    DiagramErrors,
    MissingKey,
    Position,
    Problems,
    WrongFile,
    WrongType,
    WrongValue,
)
from cosim.language import grammar, source
from cosim.language.keys import ADDS, NAMED, RECORD, read_value
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.plot import figures
from cosim.study import (
    consistency,
    fit_section,
    grid_section,
    random_section,
    search_section,
    tables_section,
    tune_section,
    until_section,
)
from cosim.study.definition import Fit, Question, Reference, Search, Study, Tuning, Variant
from cosim.study.study_keys import EXPLAIN, OVERLAY, STUDY


def load(path: str | Path, settings: Iterable[str] = ()) -> Study:
    """Read a study; `settings` replace values in it, such as ``random.count=20``. Raises: DiagramErrors."""
    path = Path(path)
    return build(lambda problems: _with_settings(source.read(path, problems), settings), path)


def build(read: Callable[[Problems], Node], path: Path) -> Study:
    """The study that a tree says; read: gives it. path: the file that it counts as. Raises: DiagramErrors."""
    problems = Problems()
    try:
        study = _study(read(problems), path, Reader(problems))
    except CosimError as error:
        problems.add(error)
        raise DiagramErrors(problems.errors) from None
    problems.raise_if_any()
    return study


def changed(path: Path, values: Mapping[str, Node], problems: Problems) -> Node:
    """The tree of a study's file with other values, by dotted path. Raises: MissingFile, YamlSyntaxError, WrongType."""
    tree = source.read(path, problems)
    for name, node in values.items():
        tree = _at(tree, name.split("."), replace(node, key_position=node.position))
    return tree


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
    name = path[0].removesuffix(ADDS)
    before = entries.get(name) if len(path) == 1 and name != path[0] else None
    if before and isinstance(before.value, list) and isinstance(value.value, list):
        entries[name] = replace(before, value=[*before.value, *value.value])
        return replace(tree, value=entries)
    child = entries.get(path[0], Node({}, value.position, value.position))
    entries[path[0]] = _at(child, path[1:], value)
    return replace(tree, value=entries)


def _study(tree: Node, path: Path, reader: Reader) -> Study:
    """The study that a tree says. Raises: MissingKey if it names no diagram, WrongFile if it is one."""
    if "diagram" not in tree.value and {"blocks", "extends"} & set(tree.value):
        key = next(key for key in ("blocks", "extends") if key in tree.value)
        raise WrongFile(f"`{path}` is a diagram, not a study", tree.value[key].place, f"cosim run {path}")
    tree = grammar.conform(grid_section.with_empty_variants(tree), reader.problems, STUDY, "study")
    sections = tree.value
    if "diagram" not in sections:
        raise MissingKey("the study names no diagram", tree.position, "write diagram: ../formation.yaml")
    variants = _variants(sections, path.parent, reader)
    title = _text(sections, "title", source.title_of(path), reader)
    description = _text(sections, "description", "", reader)
    study = Study(title, description, path, source.dump(tree.plain()), variants)
    study.grid = grid_section.read(_entries(sections, "grid"), reader)
    study.random = random_section.read(sections["random"], reader) if "random" in sections else None
    study.until = until_section.read(_entries(sections, "until"), study.random, reader)
    study.metrics, study.added_metrics = _metrics(sections.get("metrics"), reader)
    study.search = _search(sections["search"], reader) if "search" in sections else None
    study.tuning = _tuning(sections["tune"], reader) if "tune" in sections else None
    study.fit = _fit(sections["fit"], reader) if "fit" in sections else None
    study.requirements = sections.get("requirements")
    study.record = _record(sections.get("record"), reader)
    study.tables = tables_section.read(_entries(sections, "tables"), study, reader)
    study.references = _references(_entries(sections, "references"), study, reader)
    study.question = _question(sections["explain"], study, reader) if "explain" in sections else None
    study.figures = figures.read(_entries(sections, "figures"), reader.problems)
    consistency.check(study, _entries(sections, "variants"), reader.problems)
    return study


def _search(node: Node, reader: Reader) -> Search | None:
    space = random_section.space(node, "search", reader)
    return search_section.read(node, space, reader)


def _tuning(node: Node, reader: Reader) -> Tuning | None:
    space = random_section.space(node, "tune", reader)
    return tune_section.read(node, space, reader)


def _fit(node: Node, reader: Reader) -> Fit | None:
    space = random_section.space(node, "fit", reader)
    return fit_section.read(node, space, reader)


def _entries(sections: Mapping[str, Node], key: str) -> dict[str, Node]:
    return sections[key].value if key in sections else {}


def _text(sections: Mapping[str, Node], key: str, default: str, reader: Reader) -> str:
    return reader.text(sections[key], key) if key in sections else default


def _variants(sections: Mapping[str, Node], folder: Path, reader: Reader) -> dict[str, Variant]:
    """The variants by name; the diagram as it is where there are none."""
    base, place = _file(sections["diagram"], folder, reader), sections["diagram"].position
    found = {}
    for name, node in _entries(sections, "variants").items():
        entries = node.value
        overlay = {k: n for k, n in entries.items() if k in OVERLAY}
        found[name] = Variant(
            name,
            _file(entries["diagram"], folder, reader) if "diagram" in entries else base,
            entries["diagram"].position if "diagram" in entries else place,
            _text(entries, "description", "", reader),
            Node(overlay, node.position) if overlay else None,
            _entries(entries, "swap"),
            _entries(entries, "set"),
        )
    return found or {"base": Variant("base", base, place)}


def _file(node: Node, folder: Path, reader: Reader) -> Path:
    return Path(os.path.normpath(folder / reader.text(node, "diagram")))


def _metrics(node: Node | None, reader: Reader) -> tuple[tuple[Node, ...] | None, Node | None]:
    """The names of the metrics to keep, and the definitions of those that the diagram does not have."""
    if node is None:
        return None, None
    if isinstance(node.value, dict):
        return tuple(replace(n, value=key, position=n.place) for key, n in node.value.items()), node
    if isinstance(node.value, list):
        return tuple(n for n in node.value if reader.text(n, "metrics")), None
    reader.wrong(node, f"`metrics` takes a list of names, not {describe(node)}", "write [N_x, N_v]", WrongType)
    return None, None


def _record(node: Node | None, reader: Reader) -> Node | None:
    """None, or what is recorded: a mapping as in a diagram, empty for the diagram's own."""
    if node is None or node.value is False:
        return None
    if node.value is True:
        return replace(node, value={})
    adds = isinstance(node.value, dict) and any(key.endswith(ADDS) for key in node.value)
    return grammar.conform(node, reader.problems, RECORD, "record", over=adds)


def _references(entries: dict[str, Node], study: Study, reader: Reader) -> tuple[Reference, ...]:
    found: list[Reference] = []
    for origin, variants in entries.items():
        for name, node in variants.value.items():
            known = replace(node, value=name, position=node.place)
            variant = reader.choice(known, f"references.{origin}", study.variants)
            figures = grammar.conform(node, reader.problems, NAMED, f"references.{origin}.{name}").value
            for metric, number in figures.items():
                named = replace(number, value=metric, position=number.place)
                value = reader.number(number, f"{origin}.{metric}")
                found.append(Reference(origin, variant, named, value))
    return tuple(found)


def _question(node: Node, study: Study, reader: Reader) -> Question | None:
    entries = node.value
    if not {"baseline", "metric"} <= set(entries) or not {"above", "below"} & set(entries):
        fix = "write explain: {baseline: variant, metric: min_gap, above: 0}"
        reader.problems.add(MissingKey("`explain` needs a baseline, a metric and a limit", node.place, fix))
        return None
    limits = [
        read_value(EXPLAIN[key], entries[key], f"explain.{key}", reader) if key in entries else None
        for key in ("above", "below")
    ]
    baseline = reader.choice(entries["baseline"], "explain.baseline", study.variants)
    return Question(baseline, entries["metric"], *limits)
