"""Where what a word stands for is written: a block's class, a block in its diagram, a file."""

from __future__ import annotations

import inspect
import os
import re
from pathlib import Path

from cosim.authoring.declaration import Declaration
from cosim.editor import meant
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading
from cosim.errors import Position


def find(cursor: Cursor, reading: Reading) -> Position | None:
    """Of `block.port`, the block; of a block's name or type, its class; of a port in its block, its declaration."""
    target = meant.find(cursor, reading)
    if target.file:
        path = Path(os.path.normpath(reading.path.parent / target.file))
        return Position(str(path), 1, 1) if path.is_file() else None
    if target.block in reading.inner:
        return Position(str(reading.inner[target.block].path), 1, 1)
    if target.block and not cursor.is_key and "." in cursor.word and cursor.path[-1] not in ("block", "python"):
        return _block(target.block, reading)
    if target.declaration:
        return _in_class(target.declaration, target.variable.name if target.variable else "")
    return None


def _block(name: str, reading: Reading) -> Position | None:
    """Where a block's name stands in the file that begins it."""
    entry = reading.diagram.blocks.get(name) if reading.diagram else None
    return entry.position if entry and entry.position.line else None


def _in_class(declaration: Declaration, variable: str) -> Position | None:
    """The line of a class, or of one of its variables, which a base may declare."""
    if declaration.home is None:
        return None
    for home in inspect.getmro(declaration.home) if variable else ():
        if variable in vars(home) and (lines := _lines(home)):
            found = (n for n, line in enumerate(lines[1]) if re.match(rf"\s+{re.escape(variable)}\b.*=", line))
            return Position(lines[0], lines[2] + next(found, 0), 1)
    found_class = _lines(declaration.home)
    return Position(found_class[0], found_class[2], 1) if found_class else None


def _lines(home: type) -> tuple[str, list[str], int] | None:
    """The file of a class, its lines, and the number of the first one."""
    try:
        lines, first = inspect.getsourcelines(home)
        return str(Path(inspect.getsourcefile(home) or "").resolve()), lines, first
    except (OSError, TypeError):
        return None
