"""A mistake as the page shows it: what is wrong, the lines around its place, and the usual fix."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from cosim.errors import CosimError, Position
from cosim.watch.orders import View

MOST = 30
"""Mistakes that are shown: of more, the first."""
AROUND = 2
"""Lines before and behind the one with the mistake."""


def views(errors: Iterable[CosimError]) -> list[View]:
    """Each mistake, or warning, once."""
    found = list({str(error): error for error in errors}.values())
    views = [_view(error) for error in found[:MOST]]
    return [*views, told(f"and {len(found) - MOST} more")] if len(found) > MOST else views


def told(message: str, fix: str = "") -> View:
    """A mistake that has no place."""
    return _view(CosimError(message, fix=fix))


def _view(error: CosimError) -> View:
    place = error.position
    return {
        "message": error.message,
        "fix": error.fix,
        "place": str(place) if place else "",
        "line": place.line if place else 0,
        "column": place.column if place else 0,
        "lines": _lines(place) if place else [],
    }


def _lines(place: Position) -> list[tuple[int, str]]:
    """The numbered lines around a place; none where the file has no such line, or cannot be read."""
    try:
        lines = Path(place.file).read_text(encoding="utf-8", errors="replace").split("\n") if place.line else []
    except (OSError, ValueError):
        return []
    if not 0 < place.line <= len(lines):
        return []
    first, last = max(1, place.line - AROUND), min(len(lines), place.line + AROUND)
    return [(number, lines[number - 1].rstrip("\r")) for number in range(first, last + 1)]
