"""A drawing as an SVG document; boxes and wires tell more where the mouse rests on them."""

from __future__ import annotations

from html import escape

from cosim.drawing.shapes import Drawing, Line, Rectangle, Word

MARK = "drawn by cosim"
"""What a picture says of itself."""
_HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<!-- {mark} -->\n'
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0:.0f} {1:.0f}" width="{0:.0f}" height="{1:.0f}" '
    'role="img">\n'
    "<title>{2}</title>\n<style>text{{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif}}path{{fill:none}}</style>\n"
    '<rect width="100%" height="100%" fill="white"/>\n'
)
ARROW = 6.0
"""Pixels."""


def svg(drawing: Drawing) -> str:
    """The document."""
    parts = [_HEAD.format(drawing.width, drawing.height, escape(drawing.alt), mark=MARK)]
    return "".join([*parts, *map(_shape, drawing.shapes), "</svg>"])


def _shape(shape: Rectangle | Line | Word) -> str:
    if isinstance(shape, Rectangle):
        return _rectangle(shape)
    return _curve(shape) if isinstance(shape, Line) else _word(shape)


def _rectangle(r: Rectangle) -> str:
    dashes = ' stroke-dasharray="5 3"' if r.dashed else ""
    block = f' data-block="{escape(r.block)}"' if r.block else ""
    return (
        f'<rect x="{r.x:.1f}" y="{r.y:.1f}" width="{r.width:.1f}" height="{r.height:.1f}" rx="4" fill="{r.fill}" '
        f'stroke="{r.edge}" stroke-width="{r.line:g}"{dashes}{block}>{_tip(r.tip)}</rect>\n'
    )


def _curve(c: Line) -> str:
    (x, y), rest = c.points[0], c.points[1:]
    path = f"M{x:.1f},{y:.1f}C" + " ".join(f"{u:.1f},{v:.1f}" for u, v in rest)
    dashes = ' stroke-dasharray="2 2.5"' if c.dashed else ""
    line = f'<path d="{path}" stroke="{c.colour}" stroke-width="1.2"{dashes}>{_tip(c.tip)}</path>\n'
    if not c.arrow:
        return line
    u, v = rest[-1]
    tip = f"M{u:.1f},{v:.1f}l{-ARROW:g},{-ARROW / 2:g}v{ARROW:g}z"
    return f'{line}<path d="{tip}" style="fill:{c.colour}"/>\n'


def _word(w: Word) -> str:
    weight = ' font-weight="bold"' if w.bold else ""
    return (
        f'<text x="{w.x:.1f}" y="{w.y:.1f}" font-size="{w.size:g}" fill="{w.colour}" text-anchor="{w.anchor}"{weight}>'
        f"{escape(w.text)}</text>\n"
    )


def _tip(text: str) -> str:
    return f"<title>{escape(text)}</title>" if text else ""
