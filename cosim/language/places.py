"""Where a part of a text stands in the file that the text was read from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cosim.errors import Position
from cosim.language import unsaved
from cosim.language.source import Node


def within(node: Node, offset: int) -> Position:
    """The place of a character of a node's text; that of the text where it does not stand in its file as it is."""
    place, text = node.position, str(node.value)
    lines = _lines(place) if place.line else []
    if not 0 < place.line <= len(lines):
        return place
    line, begin = lines[place.line - 1], place.column - 1
    if line[begin : begin + 1] in ("|", ">"):
        return _below(place, text, offset, lines)
    begin += line[begin : begin + 1] in ("'", '"')
    same = line[begin : begin + offset + 1] == text[: offset + 1]
    return replace(place, column=begin + offset + 1) if same else place


def _below(place: Position, text: str, offset: int, lines: list[str]) -> Position:
    """As `within`, of a text whose lines stand below the place."""
    before = text[:offset].split("\n")
    row = place.line + len(before) - 1
    line, own = lines[row] if row < len(lines) else "", text.split("\n")[len(before) - 1]
    begin = len(line) - len(own)
    return replace(place, line=row + 1, column=begin + len(before[-1]) + 1) if line.endswith(own) else place


def _lines(place: Position) -> list[str]:
    """The lines of the file of a place; none where it cannot be read any more."""
    text = unsaved.text(place.file)
    if text is not None:
        return text.split("\n")
    try:
        return Path(place.file).read_text(encoding="utf-8-sig").split("\n")
    except (OSError, ValueError):
        return []
