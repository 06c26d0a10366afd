"""A block gets another name: in the diagram, in those that it extends or that extend it, and in studies of these."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from cosim.editor import grammar_paths, meant
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading
from cosim.errors import CosimError, Position, Problems, UsageError
from cosim.language import places, source
from cosim.language.overlay import read_layers
from cosim.language.reader import Reader
from cosim.language.source import Node

MOST_FILES = 1000
"""That are looked at in the folder of the diagram in which a block begins, and in those below it."""
_OTHER_TEXTS = (
    *("title", "description", "extends", "diagram", "block", "python", "fmu", "expression"),
    *("parameters", "start", "ports", "log_file", "per"),
)
"""Keys whose values name no block."""
_LISTS_OF_BLOCKS = "order"
_PORTS = (("inputs",), ("outputs",))
"""Keys below which names of ports stand, which may have dots."""


@dataclass(frozen=True)
class Edit:
    """Where the old name stands in a file, and the new one is to stand."""

    place: Position
    length: int


def renamed_at(cursor: Cursor, reading: Reading) -> str:
    """The block that is renamed at a place; "" where there is none."""
    target = meant.find(cursor, reading)
    is_name = cursor.is_key and grammar_paths.in_diagram(cursor.path, reading.is_study) == ("blocks",)
    is_source = not cursor.is_key and cursor.word.startswith(f"{target.block}.")
    return target.block if (is_name or is_source) and "/" not in target.block else ""


def edits(old: str, new: str, path: Path) -> list[Edit]:
    """Where a block's name stands in all files that have it. Raises: UsageError, CosimError of a file's syntax."""
    problems = Problems()
    Reader(problems).block_name(new, Node(new, Position("")))
    if problems.errors or "/" in new:
        raise UsageError(f"a block cannot be called `{new}`", fix="letters, digits, _ and -, beginning with a letter")
    about = _diagram_of(path)
    layers = [(file, source.read(file, Problems())) for file in read_layers(about, Problems())[1]]
    holders = [file for file, tree in layers if old in _blocks(tree)]
    if not holders:
        raise UsageError(f"there is no block `{old}`")
    found: list[Edit] = []
    for file, chain in _family(holders[-1]):
        tree = source.read(file, Problems())
        if taken := next((one for one in chain if new in _blocks(source.read(one, Problems()))), None):
            raise UsageError(f"{taken} has a block `{new}` already", fix="choose another name")
        found += _mentions(tree, old, ())
    return list(dict.fromkeys(found))


def _diagram_of(path: Path) -> Path:
    """The file itself, or the diagram that a study is about."""
    tree = source.read(path, Problems())
    named = tree.value.get("diagram")
    return Path(os.path.normpath(path.parent / str(named.value))) if named else path


def _blocks(tree: Node) -> dict[str, Node]:
    blocks = tree.value.get("blocks")
    return blocks.value if blocks and isinstance(blocks.value, dict) else {}


def _family(begin: Path) -> Iterator[tuple[Path, list[Path]]]:
    """The files in which the blocks of a diagram have their names: it, what extends it, studies; with their layers."""
    files = (p for p in sorted(begin.parent.rglob("*.y*ml")) if p.suffix in (".yaml", ".yml"))
    for file in dict.fromkeys((begin, *islice(files, MOST_FILES))):
        with suppress(CosimError):  # of a file that cannot be read, nobody knows
            chain = read_layers(_diagram_of(file), Problems())[1]
            if any(os.path.realpath(one) == os.path.realpath(begin) for one in chain):
                yield file, chain


def _mentions(node: Node, name: str, path: tuple[str, ...]) -> Iterator[Edit]:
    """Where a block's name stands below a node: as a key, before a port, in a path such as `blocks.name.start`."""
    if isinstance(node.value, dict):
        for key, child in node.value.items():
            if child.key_position and path[-1:] not in _PORTS:
                yield from _in_text(Node(key, child.key_position), name, (*path, "@"))
            if key not in _OTHER_TEXTS:
                yield from _mentions(child, name, (*path, key))
    elif isinstance(node.value, list):
        for child in node.value:
            yield from _mentions(child, name, path)
    elif isinstance(node.value, str):
        yield from _in_text(node, name, path)


def _in_text(node: Node, name: str, path: tuple[str, ...]) -> Iterator[Edit]:
    is_key, above = path[-1:] == ("@",), path[-2:-1]
    alone = (is_key and above in (("blocks",), ("swap",))) or path[-1:] == (_LISTS_OF_BLOCKS,)
    pattern = rf"(?<![\w./-])(?:blocks\.)?({re.escape(name)})(?=[./][^\W\d]{'|$' if alone else ''})"
    for found in re.finditer(pattern, node.value):
        yield Edit(places.within(node, found.start(1)), len(name))
