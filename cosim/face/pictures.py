"""A picture that a notebook shows and a program writes."""

from __future__ import annotations

from pathlib import Path

from cosim.machine import files


class Picture:
    """An SVG picture; the last value of a notebook's cell shows itself."""

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def save(self, path: str | Path) -> None:
        """Write it as a file. Raises: ResultError where its name does not end in .svg."""
        files.require_ending(Path(path), "a drawing", "svg")
        Path(path).write_text(self.svg, encoding="utf-8")

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"an SVG picture of {len(self.svg)} characters: .save('picture.svg')"
