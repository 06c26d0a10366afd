"""One block of a diagram as YAML says it, checked against the grammar but not against its type's declaration."""

from __future__ import annotations

import math
import os
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from cosim.errors import Position, UnknownKey, WrongValue, nearest
from cosim.language.data_files import FromFile
from cosim.language.keys import BLOCK, TYPES, WIRE, read_named, read_value
from cosim.language.misreadings import shown
from cosim.language.reader import Reader, is_constant
from cosim.language.source import Node, describe

SECTIONS = tuple(name for name, key in BLOCK.items() if key.below and key.kinds == TYPES and name not in TYPES)
"""The keys below which a block says something of what its type declares."""
SETTINGS = tuple(name for name, key in BLOCK.items() if not key.below and name not in (*TYPES, "drop"))
"""The keys with a value of their own."""
SINGLE = "y"
"""What the output of an expression is called that is not named."""


@dataclass
class BlockEntry:
    """One block of a diagram. All values keep their places.

    kind: one of TYPES; type: the text behind it, of an `expression` perhaps one for each output. parameters and start:
    scalars, arithmetic or nested lists of them. inputs: `block.port` or a list of such, or a constant as of parameters.
    dimensions: whole numbers from 1. ports: our name → the FMU's variable, or nested lists of such. settings: values
    of SETTINGS that it gives, in range.
    Of what was written for a type that this one replaces, dropped is what `drop:` names, and unfit what goes with no
    block of this kind. mistaken: parameters and start values of which it has been told what is wrong with them.
    """

    name: str
    kind: str
    type: Node
    position: Position
    settings: dict[str, Node] = field(default_factory=dict)
    parameters: dict[str, Node] = field(default_factory=dict)
    start: dict[str, Node] = field(default_factory=dict)
    inputs: dict[str, Node] = field(default_factory=dict)
    dimensions: dict[str, Node] = field(default_factory=dict)
    ports: dict[str, Node] = field(default_factory=dict)
    dropped: list[str] = field(default_factory=list)
    unfit: dict[str, Node] = field(default_factory=dict)
    mistaken: set[str] = field(default_factory=set)

    @property
    def data_files(self) -> list[FromFile]:
        """The values that stand in files of their own."""
        nodes = (*self.parameters.values(), *self.start.values(), *self.inputs.values())
        return [node.value for node in nodes if isinstance(node.value, FromFile)]

    @property
    def directory(self) -> Path:
        """The folder that the type's path is relative to: of the file that names it, or the current one."""
        return self.type.position.folder

    @property
    def path(self) -> Path:
        """The file that the type names."""
        file = self.type.value.rpartition(":")[0] if self.kind == "python" else self.type.value
        return Path(os.path.normpath(self.directory / file))

    @property
    def constants(self) -> dict[str, Node]:
        """The inputs that have a value throughout, and read nothing."""
        return {name: node for name, node in self.inputs.items() if is_constant(node)}

    def take_out(self, section: str, known: Container[str]) -> dict[str, Node]:
        """Remove from a section what was written for another type and is not known to this one."""
        entries: dict[str, Node] = getattr(self, section)
        lost = {name: node for name, node in entries.items() if node.inherited and name not in known}
        setattr(self, section, {name: node for name, node in entries.items() if name not in lost})
        return lost

    def plain(self, folder: Path) -> dict[str, Any]:
        """The entry without places, as YAML has it; a path is made relative to the folder."""
        result: dict[str, Any] = {self.kind: self._plain_type(folder)}
        for key in (key for key in BLOCK if key not in TYPES):
            if key in self.settings:
                result[key] = self.settings[key].plain()
            elif BLOCK[key].below and (entries := getattr(self, key)):
                result[key] = {name: _plain(node, folder) for name, node in entries.items()}
        return result

    def _plain_type(self, folder: Path) -> Any:
        if self.kind in ("block", "expression"):
            return self.type.plain()
        file = os.path.relpath(self.path, folder)
        return f"{file}:{self.type.value.rpartition(':')[2]}" if self.kind == "python" else file


def _plain(node: Node, folder: Path) -> Any:
    return node.value.plain(folder) if isinstance(node.value, FromFile) else node.plain()


def read_entry(name: str, node: Node, reader: Reader, others: Iterable[str] = ()) -> BlockEntry | None:
    """The entry that a mapping says; None if its type is not clear. Mistakes go to the reader's problems.

    others: the diagram's blocks with a type, of which one may be meant.
    """
    reader.block_name(name, node)
    kinds = [kind for kind in TYPES if kind in node.value]
    if not kinds:
        close = get_close_matches(name, others, n=1, cutoff=0.5)
        fix = "write `block: ClassName`, or python:, fmu:, diagram: or expression:"
        fix = f"did you mean `{close[0]}`? Or {fix}" if close else fix
        reader.missing(node, f"block `{name}` has no type", fix)
        return None
    for kind in kinds[1:]:
        message = f"block `{name}` has two types, `{kinds[0]}` and `{kind}`"
        reader.problems.add(WrongValue(message, node.value[kind].place, "remove one of them"))
    entry = BlockEntry(name, kinds[0], node.value[kinds[0]], node.place)
    if not _says_type(entry, reader):
        return None
    for key, value in node.value.items():
        if key not in (*TYPES, "drop") and _applies(entry, key, value, reader):
            _take(entry, key, value, reader)
    if "drop" in node.value:
        _drop(entry, node.value["drop"], reader)
    return entry


def _says_type(entry: BlockEntry, reader: Reader) -> bool:
    """Whether a type is a text or, of an expression, one for each output."""
    where, node = f"blocks.{entry.name}.{entry.kind}", entry.type
    if entry.kind != "expression" or not isinstance(node.value, dict):
        return bool(reader.text(node, where))
    if not node.value:
        reader.wrong(node, f"`{where}` is an empty mapping", 'write such as {y: "2*u"}, or "2*u"', WrongValue)
    texts = [reader.text(child, f"{where}.{output}") for output, child in node.value.items()]
    return bool(texts) and all(texts)


def type_words(kind: str, node: Node) -> str:
    """A type, as messages name it."""
    text = type_in_full(kind, node)
    return text if kind in ("block", "expression") else text.rpartition("/")[2].rpartition(":")[2]


def type_in_full(kind: str, node: Node) -> str:
    """A type as it is written, of an expression as much as is shown of one."""
    if kind != "expression":
        return str(node.value)
    return f"`{shown('; '.join(f'{name} = {text.value}' for name, text in outputs_of(node).items()))}`"


def outputs_of(node: Node) -> dict[str, Node]:
    """The expressions of a type that is of that kind, by output."""
    written: dict[str, Node] = node.value if isinstance(node.value, dict) else {SINGLE: node}
    return written


def _applies(entry: BlockEntry, key: str, node: Node, reader: Reader) -> bool:
    """Whether a block of this kind has the key; if not, it is a mistake unless written for another type."""
    only = BLOCK[key].kinds
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
    for key in (name for name in SETTINGS if BLOCK[name].kinds not in (TYPES, ("fmu",))):
        node = entry.unfit.get(key) or entry.settings.get(key)
        if node and node.inherited:
            known.add(key)
            if key in names:
                entry.unfit.pop(key, None)
                entry.settings.pop(key, None)
                entry.dropped.append(key)
    for node in named:
        if isinstance(node.value, str) and node.value not in known:
            message = f"block `{entry.name}`: nothing called `{node.value}` was written for another type"
            fix = nearest(node.value, known) or "`drop` goes with a change of the type; `name: ~` takes a value away"
            reader.problems.add(WrongValue(message, node.position, fix))


def _wire(node: Node, where: str, reader: Reader) -> Node | None:
    """What a wire reads, with the rest of what is said of it beside."""
    if not isinstance(node.value, dict):
        return node
    source: Node | None = node.value.get("from")
    if source is None:
        reader.missing(node, f"`{where}` does not say what is read", "write {from: block.port, …}")
        return None
    others = {key: child for key, child in node.value.items() if key != "from"}
    if others and is_constant(source):
        said = f"`{where}` is the constant {describe(source)}, for which `{next(iter(others))}` does nothing"
        reader.wrong(next(iter(others.values())), said, f"write {source.plain()} alone", WrongValue)
        return replace(source, key_position=node.key_position, inherited=node.inherited)
    values = {key: read_value(WIRE[key], child, f"{where}.{key}", reader) for key, child in others.items()}
    beside = {key: replace(child, value=values[key]) for key, child in others.items() if not _is_mistake(values[key])}
    return replace(node, value=source.value, position=source.position, beside=beside)


def _is_mistake(value: Any) -> bool:
    """Whether a value stands for one that could not be read, which is told."""
    return value is None or (isinstance(value, float) and math.isnan(value))


def _take(entry: BlockEntry, key: str, node: Node, reader: Reader) -> None:
    """Keep what a key of a block says."""
    where = f"blocks.{entry.name}.{key}"
    if key == "inputs":
        wires = {port: _wire(wire, f"{where}.{port}", reader) for port, wire in node.value.items()}
        node = replace(node, value={port: wire for port, wire in wires.items() if wire})
    if BLOCK[key].below:
        setattr(entry, key, found := read_named(BLOCK[key], node.value, where, reader))
        entry.mistaken |= node.value.keys() - found.keys()
    elif not _is_mistake(value := read_value(BLOCK[key], node, where, reader)):
        entry.settings[key] = replace(node, value=value)
