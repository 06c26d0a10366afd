"""A block type as a drawing: a box with its inputs at the left and its outputs at the right."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cosim.authoring.declaration import Declaration

ROW, EDGE, WIRE, LETTER = 20, 12, 26, 7.2
"""Pixels: from port to port, above and below them, a wire's length, a letter's width."""
BOX = """<svg class="block" role="img" aria-label="{name}" width="{0:.0f}" height="{1}" font-family="monospace" \
font-size="12" fill="currentColor">
<rect x="{2}" y="1" width="{3:.0f}" height="{4}" rx="4" fill="none" stroke="currentColor"/>
<text x="{5:.0f}" y="{6:.0f}" text-anchor="middle" font-weight="bold">{name}</text>"""
PORT = """<path d="M{0:.0f},{1:.0f}h{2}" stroke="currentColor"/><path d="M{3:.0f},{1:.0f}l-7,-4v8z"/>
<text x="{4:.0f}" y="{5:.0f}" text-anchor="{anchor}">{name}</text>"""


def svg(declaration: Declaration) -> str:
    """An SVG element on lines of its own, in the colour of the text around it."""
    sides = [[v.name for v in declaration.variables.values() if v.causality == c] for c in ("input", "output")]
    left, right = (max(map(len, names), default=0) * LETTER for names in sides)
    width = left + right + (len(declaration.name) + 6) * LETTER
    height = max(*map(len, sides), 1) * ROW + 2 * EDGE
    middle = WIRE + (width + left - right) / 2
    size = width + 2 * WIRE + 2, height + 2, WIRE, width, height, middle, height / 2 + 5
    lines = [BOX.format(*size, name=declaration.name)]
    lines += _ports(sides[0], height, 0, WIRE + LETTER, "start")
    lines += _ports(sides[1], height, WIRE + width, WIRE + width - LETTER, "end")
    return "\n".join([*lines, "</svg>"])


def _ports(names: Sequence[str], height: float, wire: float, text: float, anchor: str) -> Iterator[str]:
    """The ports of one side; wire, text: where their wires begin and their names stand, from the left."""
    for k, name in enumerate(names):
        y = height * (k + 0.5) / len(names) + 1
        yield PORT.format(wire, y, WIRE, wire + WIRE, text, y + 4, name=name, anchor=anchor)
