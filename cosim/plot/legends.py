"""Which line is which: what lines are called, and where that is said, once for all panels or in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cosim.plot import style
from cosim.plot.signals import Curve

NAMED = 8
"""More lines than this in a panel are drawn thin, with the legend above them."""
LISTED = 24
"""More lines than this have no names but their number."""
LETTERS = 17
"""Of a legend's text, an inch."""
ROW = 0.17
"""Of a legend, in inches, by which a figure is higher, so that its panels are not lower."""
HANDLE = 7
"""Letters that a line's sample in a legend takes."""
CORNER: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "right", "va": "top", "fontsize": 7}
"""How a note stands in the upper right corner of a panel."""


@dataclass
class Legend:
    """A panel's axes, and its lines' samples and names. count: of its lines."""

    axis: Any
    count: int = 0
    handles: list[Any] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def add(self, name: str, **look: Any) -> None:
        """One more line."""
        from matplotlib.lines import Line2D

        self.handles.append(Line2D([], [], **look))
        self.names.append(f" {name}" if name.startswith("_") else name)  # which matplotlib leaves out


def place(figure: Any, legends: Sequence[Legend], runs: int) -> None:
    """Say which line is which: once for all panels if they have the same lines, else in each."""
    same = len({tuple(legend.names) for legend in legends}) == 1
    first = legends[0]
    inches = figure.get_figwidth()
    if len(legends) > 1 and same and 1 < len(first.names) <= LISTED:
        rows = _above(figure, first, inches, loc="outside upper center")
        figure.set_figheight(figure.get_figheight() + ROW * rows)
        return
    columns = len({round(legend.axis.get_position().x0, 3) for legend in legends})
    for k, legend in enumerate(legends):
        if k >= columns and legend.names == legends[k - columns].names:
            continue  # it stands above, in the panel over this one
        if len(legend.names) == 1 and runs == 1:
            continue  # it is the axis's label
        if legend.count > LISTED and len(legend.names) > NAMED:
            legend.axis.annotate(f"{legend.count} lines", (1, 1), (-3, -3), **CORNER)
        elif len(legend.names) > 4 or max(map(len, legend.names), default=0) > LETTERS:
            more = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.02)}
            rows = _above(legend.axis, legend, inches / columns - 0.6, **more)
            figure.set_figheight(figure.get_figheight() + ROW * rows / columns + 0.1)
        else:
            legend.axis.legend(legend.handles, legend.names, loc="best" if legend.count <= NAMED else "upper right")


def _above(where: Any, legend: Legend, inches: float, **more: Any) -> int:
    """A legend of as many columns as fit into a width; returns its rows."""
    longest = max(map(len, legend.names)) + HANDLE
    columns = max(1, min(len(legend.names), int(inches * LETTERS / longest), 8))
    rows = -(-len(legend.names) // columns)
    where.legend(legend.handles, legend.names, ncols=-(-len(legend.names) // rows), fontsize=7, **more)
    return rows


def common(found: Sequence[Curve]) -> str:
    """What all curves of a panel have in common, as its label: the signal, and the element."""
    parts = [{getattr(curve, part) for curve in found} for part in ("signal", "member", "component")]
    if not parts or len(parts[0]) != 1:
        return ""
    return ", ".join(text for part in parts if len(part) == 1 and (text := next(iter(part))))


def distinct(found: Sequence[Curve]) -> list[str]:
    """What tells the curves of a panel apart: signal, member, component, whichever differ; units where they differ."""
    parts = [p for p in ("signal", "member", "component") if len({getattr(curve, p) for curve in found}) > 1]
    names = [", ".join(text for p in parts or ["signal"] if (text := getattr(curve, p))) for curve in found]
    if len({curve.unit for curve in found}) > 1:
        units = [style.unit_text(curve.unit) for curve in found]
        return [
            f"{style.plain(name)} ({unit})" if unit else style.plain(name)
            for name, unit in zip(names, units, strict=True)
        ]
    return [style.plain(name) for name in names]
