"""A picture as shapes: rectangles, curves and texts, in pixels from the upper left corner."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from cosim.drawing import placement
from cosim.drawing.boxes import Box, Wire, boxes, short
from cosim.drawing.layers import Layers, Slot, layers
from cosim.drawing.placement import GAP, Places, box_height
from cosim.wiring.network import Network

MARGIN, LANE, TURN = 16.0, 11.0, 9.0
"""Pixels of the edge, between two wires that lead back, and between two that turn beside a column."""
FILLS = {"block": "#eef3fb", "python": "#eaf6ec", "fmu": "#fdf1dc", "expression": "#f5eef8", "diagram": "#e4e8ee"}
INK, GREY, WIRE, BACK, CHANGED, LOOP = "#1d2733", "#6b7785", "#4f6078", "#a65a2a", "#c1440e", "#6a4c93"
Point = tuple[float, float]


@dataclass(frozen=True)
class Rectangle:
    """From its upper left corner. block: whose box it is."""

    x: float
    y: float
    width: float
    height: float
    fill: str
    edge: str
    line: float = 1.0
    dashed: bool = False
    tip: str = ""
    block: str = ""


@dataclass(frozen=True)
class Line:
    """From its first point, along cubic curves, three points each; lines are curves too. arrow: whether one ends it."""

    points: tuple[Point, ...]
    colour: str
    arrow: bool = False
    dashed: bool = False
    tip: str = ""


@dataclass(frozen=True)
class Word:
    """A text on a line. anchor: start, middle or end."""

    x: float
    y: float
    text: str
    size: float
    colour: str = INK
    anchor: str = "start"
    bold: bool = False


@dataclass
class Drawing:
    """A picture; alt: in words, for whoever does not see it."""

    width: float
    height: float
    alt: str
    shapes: list[Rectangle | Line | Word] = field(default_factory=list)


def drawing(network: Network, changed: Sequence[str] = ()) -> Drawing:
    """A network as a picture. changed: the blocks that stand out."""
    found, wires = boxes(network, changed)
    arranged = layers(list(found), wires)
    lanes = {source: k for k, source in enumerate(dict.fromkeys(wire.source for wire in arranged.back))}
    edge = MARGIN + (GAP / 2 if lanes else 0.0)
    placed = placement.places(found, arranged, (edge, MARGIN))
    heights = {s: box_height(found[s]) if isinstance(s, str) else placement.PASSING for s in placed.top}
    bottom = max((top + heights[slot] for slot, top in placed.top.items()), default=0.0)
    shapes = [
        *_wires(arranged, placed, wires),
        *_back(arranged.back, placed, lanes, bottom),
        *(shape for box in found.values() for shape in _box(box, placed)),
    ]
    width = placed.left[-1] - GAP + edge
    height = bottom + LANE * (len(lanes) + 1) * bool(lanes) + MARGIN
    words = "; ".join(wire.tip for wire in wires)
    return Drawing(width, height, f"{network.diagram.title}: {words}", shapes)


def _straight(*points: Point) -> tuple[Point, ...]:
    """Lines through points, as curves."""
    found = [points[0]]
    for a, b in pairwise(points):
        found += [a, b, b]
    return tuple(found)


def _swung(a: Point, b: Point) -> tuple[Point, ...]:
    middle = (a[0] + b[0]) / 2
    return a, (middle, a[1]), (middle, b[1]), b


def _wires(arranged: Layers, placed: Places, wires: Sequence[Wire]) -> Iterator[Line]:
    """The wires that go to the right; an arrow at each input."""
    tips: dict[tuple[Slot, int], list[str]] = {}
    for wire in wires:
        tips.setdefault(wire.target, []).append(wire.tip)
    late = {wire.target for wire in wires if wire.late}
    for s in arranged.segments:
        a, b = placed.outlet(s.left, s.leave), placed.inlet(s.right, s.arrive)
        ends = isinstance(s.right, str)
        where = (s.right, s.arrive)
        yield Line(_swung(a, b), WIRE, ends, ends and where in late, "\n".join(tips[where]) if ends else "")
        if not ends:
            yield Line(_straight(b, placed.outlet(s.right, 0)), WIRE)


def _back(back: Sequence[Wire], placed: Places, lanes: dict[tuple[str, int], int], bottom: float) -> Iterator[Line]:
    """The wires that lead back, below all boxes; those from one port share a lane."""
    for wire in back:
        lane = lanes[wire.source]
        (x, y), (u, v) = placed.outlet(*wire.source), placed.inlet(*wire.target)
        out, into = x + GAP / 5 + lane % 4 * TURN, u - GAP / 5 - lane % 4 * TURN
        level = bottom + LANE * (lane + 1)
        yield Line(
            _straight((x, y), (out, y), (out, level), (into, level), (into, v), (u, v)), BACK, True, wire.late, wire.tip
        )


def _box(box: Box, placed: Places) -> Iterator[Rectangle | Word]:
    k = placed.column[box.name]
    x, y, width, height = placed.left[k], placed.top[box.name], placed.width[k], box_height(box)
    fill = FILLS.get(box.kind, FILLS["block"])
    edge = CHANGED if box.changed else LOOP if box.looped else INK
    line = 2.2 if box.changed else 1.4 if box.looped else 1.0
    for behind in (6.0, 3.0) if box.fleet else ():
        yield Rectangle(x + behind, y + behind, width, height, fill, edge, 0.8)
    said = ["changed"] * box.changed + ["part of an algebraic loop"] * box.looped
    yield Rectangle(x, y, width, height, fill, edge, line, box.looped, "\n".join([box.tip, *said]), box.name)
    if box.kind == "diagram":
        yield Rectangle(x + 3, y + 3, width - 6, height - 6, "none", edge, 0.6)
    yield Word(x + width / 2, y + 16, short(box.name), 12, INK, "middle", True)
    yield Word(x + width / 2, y + 30, short(box.said), 9.5, GREY, "middle")
    for n, port in enumerate(box.inputs):
        yield Word(x + 6, y + placement.height_of_port(box.name, n) + 3, short(port.name), 9)
    for n, port in enumerate(box.outputs):
        level = y + placement.height_of_port(box.name, n) + 3
        yield Word(x + width - 6, level, short(port.name), 9, INK, "end")
        if port.note:
            yield Word(
                x + width - 6 - (len(short(port.name)) + 1) * placement.SMALL, level, port.note, 7.5, GREY, "end"
            )
