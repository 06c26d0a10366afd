"""Which part of a text a mistake is underlined in."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import CosimError, Position

_TOKEN = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^']|'')*'|[\w./@+-]+|\S""")


@dataclass(frozen=True)
class Span:
    """A part of a line; all count from 0."""

    line: int
    begin: int
    end: int


def spans(error: CosimError, path: Path, text: str) -> list[Span]:
    """Where a mistake stands in the text of a file; one of another file, at what leads there."""
    lines = text.split("\n")
    places = [place for place in (error.position, *error.others) if place and place.line and _is(place, path)]
    return [_token(lines, place.line - 1, place.column - 1) for place in places] or [_leading(error.position, lines)]


def elsewhere(error: CosimError, path: Path) -> Position | None:
    """The place of a mistake that stands in another file than the one that is looked at."""
    place = error.position
    return place if place and place.line and not _is(place, path) else None


def _is(place: Position, path: Path) -> bool:
    return os.path.realpath(place.file) == os.path.realpath(path)


def _token(lines: list[str], line: int, column: int) -> Span:
    """What stands there, at least one character, also at the end of a text."""
    line = min(line, len(lines) - 1)
    row = lines[line].rstrip("\r")
    column = min(column, len(row))
    found = _TOKEN.match(row, column)
    return Span(line, column, found.end()) if found else Span(line, max(0, column - 1), column)


def _leading(place: Position | None, lines: list[str]) -> Span:
    """What names a file, else that which this one extends, else the first line."""
    name = re.escape(Path(place.file).name) if place and place.file else ""
    for wanted in (name and rf"\S*{name}", r"(?<=extends: )\S+"):
        for number, row in enumerate(lines):
            if wanted and (found := re.search(wanted, row)):
                return Span(number, found.start(), found.end())
    return _token(lines, 0, 0)
