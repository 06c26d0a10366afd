"""One block of a diagram as YAML says it, checked against the grammar but not against its type's declaration."""

from __future__ import annotations

import os
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from cosim.errors import Position, UnknownKey, WrongType, WrongValue, nearest
from cosim.language import grammar
from cosim.language.grammar import Reader
from cosim.language.source import Node, describe

_NATIVE = ("block", "python", "fmu")
_ONLY = {
    **dict.fromkeys(("period", "integrator", "inner_steps"), _NATIVE),
    **dict.fromkeys(("ports", "isolate", "mode"), ("fmu",)),
}
"""The kinds of type that a key goes with; keys that are not here go with all."""
SECTIONS = ("parameters", "start", "inputs", "dimensions")
"""The keys below which a block says something of what its type declares."""


@dataclass
class BlockEntry:
    """One block of a diagram. All values keep their places.

    kind: `block`, `python`, `fmu` or `diagram`; type: the text behind it. parameters and start: scalars, expressions
    or nested lists of them. inputs: `block.port` or a list of such. dimensions: whole numbers from 1. ports: our name →
    the FMU's variable. The values of period (float, s), integrator, inner_steps (int), isolate (bool) and mode are in
    range; a period is a whole number of steps. Of what was written for a type that this one replaces, dropped is what
    `drop:` names, and unfit what goes with no block of this kind.
    """

    name: str
    kind: str
    type: Node
    position: Position
    per: Node | None = None
    parameters: dict[str, Node] = field(default_factory=dict)
    start: dict[str, Node] = field(default_factory=dict)
    inputs: dict[str, Node] = field(default_factory=dict)
    dimensions: dict[str, Node] = field(default_factory=dict)
    period: Node | None = None
    integrator: Node | None = None
    inner_steps: Node | None = None
    ports: dict[str, Node] = field(default_factory=dict)
    isolate: Node | None = None
    mode: Node | None = None
    dropped: list[str] = field(default_factory=list)
    unfit: dict[str, Node] = field(default_factory=dict)

    @property
    def directory(self) -> Path:
        """The folder that the type's path is relative to: of the file that names it, or the current one."""
        place = self.type.position
        return Path(place.file).parent if place.line else Path()

    @property
    def path(self) -> Path:
        """The file that the type names."""
        file = self.type.value.rpartition(":")[0] if self.kind == "python" else self.type.value
        return Path(os.path.normpath(self.directory / file))

    def take_out(self, section: str, known: Container[str]) -> dict[str, Node]:
        """Remove from a section what was written for another type and is not known to this one."""
        entries: dict[str, Node] = getattr(self, section)
        lost = {name: node for name, node in entries.items() if node.inherited and name not in known}
        setattr(self, section, {name: node for name, node in entries.items() if name not in lost})
        return lost

    def plain(self, folder: Path) -> dict[str, Any]:
        """The entry without places, as YAML has it; a path is made relative to the folder."""
        file = os.path.relpath(self.path, folder) if self.kind != "block" else self.type.value
        result: dict[str, Any] = {
            self.kind: f"{file}:{self.type.value.rpartition(':')[2]}" if self.kind == "python" else file
        }
        for key in grammar.BLOCK:
            value = getattr(self, key, None)
            if isinstance(value, Node):
                result[key] = value.plain()
            elif isinstance(value, dict) and value:
                result[key] = {name: node.plain() for name, node in value.items()}
        return result


def read_entry(name: str, node: Node, reader: Reader, others: Iterable[str] = ()) -> BlockEntry | None:
    """The entry that a mapping says; None if its type is not clear. Mistakes go to the reader's problems.

    others: the diagram's blocks with a type, of which one may be meant.
    """
    reader.block_name(name, node)
    kinds = [kind for kind in grammar.TYPES if kind in node.value]
    if not kinds:
        close = get_close_matches(name, others, n=1, cutoff=0.5)
        fix = "write `block: ClassName`, or python:, fmu: or diagram:"
        fix = f"did you mean `{close[0]}`? Or {fix}" if close else fix
        reader.missing(node, f"block `{name}` has no type", fix)
        return None
    for kind in kinds[1:]:
        message = f"block `{name}` has two types, `{kinds[0]}` and `{kind}`"
        reader.problems.add(WrongValue(message, node.value[kind].place, "remove one of them"))
    entry = BlockEntry(name, kinds[0], node.value[kinds[0]], node.place)
    if not reader.text(entry.type, f"blocks.{name}.{entry.kind}"):
        return None
    for key, value in node.value.items():
        if key not in (*grammar.TYPES, "drop") and _applies(entry, key, value, reader):
            setattr(entry, key, _attribute(f"blocks.{name}.{key}", key, value, reader))
    if "drop" in node.value:
        _drop(entry, node.value["drop"], reader)
    return entry


def _applies(entry: BlockEntry, key: str, node: Node, reader: Reader) -> bool:
    """Whether a block of this kind has the key; if not, it is a mistake unless written for another type."""
    only = _ONLY.get(key, grammar.TYPES)
    if entry.kind not in only and not node.inherited:
        message = f"block `{entry.name}`: `{key}` does not go with `{entry.kind}:`"
        fix = f"remove it; it goes with {', '.join(f'`{kind}:`' for kind in only)}"
        reader.problems.add(UnknownKey(message, node.place, fix))
    elif entry.kind not in only:
        if "fmu" in only and len(only) == 1:  # says how the replaced FMU was attached, and goes with it
            entry.dropped.append(key)
        else:
            entry.unfit[key] = node
    return entry.kind in only


def _drop(entry: BlockEntry, drop: Node, reader: Reader) -> None:
    """Leave out what `drop:` names of that which was written for another type."""
    named = drop.value if isinstance(drop.value, list) else [drop]
    names = {reader.text(node, f"blocks.{entry.name}.drop") for node in named}
    known: set[str] = set()
    for section in SECTIONS:
        entries: dict[str, Node] = getattr(entry, section)
        spellings = {name: {name, f"{section}.{name}"} for name, node in entries.items() if node.inherited}
        gone = [name for name in spellings if spellings[name] & names]
        setattr(entry, section, {name: node for name, node in entries.items() if name not in gone})
        entry.dropped += gone if section == "parameters" else [f"{section}.{name}" for name in gone]
        known.update(*spellings.values())
    for key in ("period", "integrator", "inner_steps"):
        node = entry.unfit.get(key) or getattr(entry, key)
        if node and node.inherited:
            known.add(key)
            if key in names:
                entry.unfit.pop(key, None)
                setattr(entry, key, None)
                entry.dropped.append(key)
    for node in named:
        if isinstance(node.value, str) and node.value not in known:
            message = f"block `{entry.name}`: nothing called `{node.value}` was written for another type"
            fix = nearest(node.value, known) or "`drop` goes with a change of the type; `name: ~` takes a value away"
            reader.problems.add(WrongValue(message, node.position, fix))


def _attribute(where: str, key: str, node: Node, reader: Reader) -> Any:
    """The value of one key of a block, as `BlockEntry` keeps it."""
    match key:
        case "dimensions":
            return _sizes(where, node, reader)
        case "parameters" | "start":
            return {name: value for name, value in node.value.items() if _is_data(value, f"{where}.{name}", reader)}
        case "inputs":
            return {name: _sources(value, f"{where}.{name}", reader) for name, value in node.value.items()}
        case "ports":
            return {name: value for name, value in node.value.items() if reader.text(value, f"{where}.{name}")}
        case "period":
            return replace(node, value=reader.positive(node, where))
        case "integrator":
            return replace(node, value=reader.choice(node, where, grammar.INTEGRATORS))
        case "inner_steps":
            return replace(node, value=reader.count(node, where, grammar.MOST_INNER_STEPS))
        case "isolate":
            return replace(node, value=reader.truth(node, where))
        case "mode":
            return replace(node, value=reader.choice(node, where, grammar.FMU_MODES))
    return replace(node, value=reader.text(node, where))


def _sources(node: Node, where: str, reader: Reader) -> Node:
    """What an input reads; an empty list where a mistake keeps that from being known."""
    if node.value == []:
        reader.wrong(node, f"`{where}` is an empty list", "name what it reads, such as plant.x", WrongValue)
    return node if reader.endpoints(node, where) else replace(node, value=[])


def _sizes(where: str, node: Node, reader: Reader) -> dict[str, Node]:
    """The sizes of dimensions, without those that are none."""
    sizes = {}
    for name, value in node.value.items():
        mistakes = len(reader.problems.errors)
        size = replace(value, value=reader.count(value, f"{where}.{name}"))
        if len(reader.problems.errors) == mistakes:
            sizes[name] = size
    return sizes


def _is_data(node: Node, where: str, reader: Reader) -> bool:
    """Whether a value is a scalar or nested lists of such, else a report."""
    if isinstance(node.value, list):
        return all([_is_data(child, where, reader) for child in node.value])
    if isinstance(node.value, dict) or node.value is None:
        fix = "write a number or a list such as [1, 2]"
        message = f"`{where}` must be a number, a text or a list, not {describe(node)}"
        reader.wrong(node, message, fix, WrongType)
        return False
    return True
