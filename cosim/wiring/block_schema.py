"""What a diagram may say of a block, by its type, as a JSON Schema: beside that of the keys, `language.schema`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Parameter, Variable, shape_text
from cosim.errors import CosimError, Position
from cosim.language.entry import BlockEntry
from cosim.language.keys import ADDS
from cosim.language.schema import is_plain
from cosim.language.source import Node
from cosim.wiring import catalogue, library, settable, variable_words

_PACK = {"type": "string", "pattern": ":"}  # a type with its pack or module before it


def block_types(folder: Path) -> dict[str, Any]:
    """What each block keeps: a type that there is, and what this declares; those of a folder's Python files too.

    Own types are named as diagrams of that folder, and of those directly in it, name them. Their files are imported;
    of one that cannot be, nothing more is said.
    """
    installed = [block for group in catalogue.installed() for block in group.blocks]
    names = [block.written for block in installed]
    block = {"anyOf": [{"enum": names, "enumDescriptions": [b.summary for b in installed]}, _PACK, {"type": "null"}]}
    found = [_only("block", {"const": name}, _declaration("block", name)) for name in names]
    properties: dict[str, Any] = {"block": block}
    if own := [b for group in catalogue.own(folder, library.files()) for b in group.blocks]:
        written = {name: b.summary for b in own for name in _seen_from_diagrams(b.written, folder)}
        words = {"enum": [*written], "enumDescriptions": [*written.values()]}
        properties["python"] = {"anyOf": [words, {"type": ["string", "null"]}]}
        found += _own(own)
    return {"properties": properties, "allOf": found}


def _seen_from_diagrams(written: str, folder: Path) -> Iterator[str]:
    """`file.py:Class` from each folder in which a diagram of a project stands."""
    for home in sorted({path.parent for path in (*folder.glob("*.yaml"), *folder.glob("*/*.yaml"))}):
        yield Path(os.path.relpath(written, home)).as_posix()


def _own(blocks: Iterable[catalogue.Listed]) -> Iterator[dict[str, Any]]:
    for block in blocks:
        try:
            declaration = _declaration("python", block.written)
        except CosimError:
            continue
        name = re.escape(Path(block.written).name)
        yield _only("python", {"type": "string", "pattern": f"(^|/){name}$"}, declaration)


def _declaration(key: str, name: str) -> Declaration:
    place = Position(name)
    return library.find(BlockEntry(name, key, Node(name, place), place)).declaration


def _only(key: str, named: dict[str, Any], declaration: Declaration) -> dict[str, Any]:
    """That a block of a type has the names only that the type declares; `~` takes others away."""
    sections = {
        section: {
            "properties": {name: _described(declaration, variable) for name, variable in known.items()},
            "patternProperties": {f"\\{ADDS}$": {}},
            "additionalProperties": {
                "type": "null",
                "errorMessage": f"{declaration.name} has nothing of this name here",
            },
        }
        for section, known in settable.sections(declaration).items()
    }
    return {"if": {"required": [key], "properties": {key: named}}, "then": {"properties": sections}}


def _described(declaration: Declaration, variable: Variable | None) -> dict[str, Any]:
    if variable is None:
        return {}
    unit = variable_words.unit(variable)
    head = f"{variable.name}{shape_text(variable.shape)}" + (f" ({unit})" if unit else "")
    found: dict[str, Any] = {"description": "; ".join((head, *variable_words.notes(declaration, variable)))}
    if isinstance(variable, Parameter) and is_plain(variable.start):
        found["default"] = variable.start
    return found
