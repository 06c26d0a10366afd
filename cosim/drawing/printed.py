"""A drawing as PNG or PDF, by matplotlib."""

from __future__ import annotations

from typing import Any

from cosim.drawing.shapes import Drawing, Line, Rectangle, Word
from cosim.drawing.svg import ARROW
from cosim.plot import style

PIXELS = 96.0
"""Of a drawing, an inch."""
POINT = 72.0 / PIXELS
"""Points of a pixel."""
NARROW = 0.9
"""matplotlib's own font is that much wider than those of browsers."""


def figure(drawing: Drawing) -> Any:
    """It as a figure. Raises: PlotError if matplotlib is not installed."""
    with style.style():
        sheet, axes = style.subplots(1, 1, (drawing.width / PIXELS, drawing.height / PIXELS))
        sheet.set_layout_engine("none")
        (whole,) = axes.flat
        whole.set(position=(0, 0, 1, 1), xlim=(0, drawing.width), ylim=(drawing.height, 0))
        whole.axis("off")
        for order, shape in enumerate(drawing.shapes):
            _add(whole, shape, order)
    return sheet


def _add(axes: Any, shape: Rectangle | Line | Word, order: int) -> None:
    from matplotlib.patches import FancyBboxPatch, PathPatch, Polygon
    from matplotlib.path import Path as Course

    look: dict[str, Any]
    if isinstance(shape, Word):
        place = {"start": "left", "middle": "center", "end": "right"}[shape.anchor]
        weight = "bold" if shape.bold else "normal"
        size = shape.size * POINT * NARROW
        look = {"size": size, "color": shape.colour, "ha": place, "weight": weight, "family": "DejaVu Sans"}
        axes.text(shape.x, shape.y, style.plain(shape.text), zorder=order, **look)
    elif isinstance(shape, Rectangle):
        corner = {"boxstyle": "round,pad=0,rounding_size=4", "linestyle": (0, (5, 3)) if shape.dashed else "-"}
        look = {"facecolor": shape.fill, "edgecolor": shape.edge, "linewidth": shape.line * POINT, **corner}
        axes.add_patch(FancyBboxPatch((shape.x, shape.y), shape.width, shape.height, zorder=order, **look))
    else:
        codes = [Course.MOVETO, *[Course.CURVE4] * (len(shape.points) - 1)]
        look = {
            "edgecolor": shape.colour,
            "linewidth": 1.2 * POINT,
            "linestyle": (0, (2, 2.5)) if shape.dashed else "-",
        }
        axes.add_patch(PathPatch(Course(shape.points, codes), fill=False, zorder=order, **look))
        if shape.arrow:
            x, y = shape.points[-1]
            tip = [(x, y), (x - ARROW, y - ARROW / 2), (x - ARROW, y + ARROW / 2)]
            axes.add_patch(Polygon(tip, color=shape.colour, linewidth=0, zorder=order))
