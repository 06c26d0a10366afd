"""A network as a drawing: a box for each block, in columns from left to right as signals go, a curve for each wire.

Columns are by longest path (Sugiyama, Tagawa, Toda 1981): wires that close a ring are set apart first and led back
below the boxes, long ones go through a free place in every column between, and the order in a column is that of the
mean place of what its boxes are wired to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise

import networkx

from cosim.wiring.network import Network

BOX, GAP, ROW, HEIGHT, MARGIN = 150.0, 70.0, 64.0, 44.0, 24.0
"""Pixels: a box's width, the room between two columns, from one box to the next below it, a box's height, and the
edge, in which a wire that leads back turns, `TURN` beside its box."""
TURN, LANE = 17.0, 9.0
"""Pixels from a box to where a wire that leads back turns, and between two such wires."""
SWEEPS = 8
_CHARACTERS = 22
_FILLS = {"fmu": "#fdf1dc", "block": "#eef3fb", "python": "#eaf6ec", "expression": "#f5eef8"}
_STYLE = (
    "text{font-family:sans-serif;font-size:11px;text-anchor:middle;fill:#222}.n{font-weight:bold;font-size:12px}"
    "rect{stroke:#44546a;rx:4}path{fill:none;stroke:#5b6b82;stroke-width:1.2}.b{stroke:#b0632f;stroke-dasharray:5 3}"
)

_HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0:.0f} {1:.0f}" width="{0:.0f}" height="{1:.0f}">
<style>{style}</style>
<defs><marker id="a" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">
<path d="M0,0L8,4L0,8z" style="fill:#5b6b82;stroke:none"/></marker></defs>
<rect width="100%" height="100%" style="fill:white;stroke:none"/>
<g transform="translate({margin},{margin})">
"""

Point = tuple[float, float]
Slot = str | tuple[str, str, int]
"""A box by its block's name, or the place in a column through which a wire goes that passes it."""


def svg_of(network: Network) -> str:
    """The drawing as an SVG document; boxes and wires tell more where the mouse rests on them."""
    wires = _wires(network)
    columns, back = _columns(list(network.components), wires)
    places = _places(columns, wires, back)
    right = max(x for x, _ in places.values()) + BOX
    bottom = max(y for _, y in places.values()) + HEIGHT
    height = bottom + (LANE * (len(back) + 1) if back else 0.0) + MARGIN
    size = right + 2 * MARGIN, height + MARGIN
    lanes = {pair: bottom + LANE * (k + 1) for k, pair in enumerate(back)}
    parts = [_HEAD.format(*size, style=_STYLE, margin=MARGIN)]
    parts += [_curve(pair, places, lanes.get(pair), told) for pair, told in wires.items()]
    parts += [_box(network, name, *places[name]) for name in network.components]
    return "".join([*parts, "</g></svg>"])


def _wires(network: Network) -> dict[tuple[str, str], list[str]]:
    """What is wired, in words, by source and target."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, component in network.components.items():
        for port, sources in component.wires.items():
            for source in sources:
                found.setdefault((source.component, name), []).append(f"{source} → {name}.{port}")
    return found


def _columns(
    names: Sequence[str], wires: Mapping[tuple[str, str], object]
) -> tuple[list[list[Slot]], list[tuple[str, str]]]:
    """The columns with the slots of all forward wires, and the wires that lead back: in rings, to what comes first."""
    graph = networkx.DiGraph()
    graph.add_nodes_from(names)
    back = []
    place = {name: k for k, name in enumerate(names)}
    for source, target in sorted(wires, key=lambda pair: place[pair[0]] > place[pair[1]]):
        if source == target or (graph.has_node(target) and networkx.has_path(graph, target, source)):
            back.append((source, target))
        else:
            graph.add_edge(source, target)
    rank = {name: k for k, layer in enumerate(networkx.topological_generations(graph)) for name in layer}
    for name in reversed(list(networkx.topological_sort(graph))):  # what nothing before it needs earlier comes later
        after = [rank[target] for target in graph.successors(name)]
        if after and not graph.in_degree(name):
            rank[name] = min(after) - 1
    columns: list[list[Slot]] = [[] for _ in range(max(rank.values(), default=0) + 1)]
    for name in names:
        columns[rank[name]].append(name)
    for source, target in graph.edges:
        for k in range(rank[source] + 1, rank[target]):
            columns[k].append((source, target, k))
    return columns, back


def _neighbours(
    columns: Sequence[Sequence[Slot]], wires: Mapping[tuple[str, str], object], back: Sequence[tuple[str, str]]
) -> dict[Slot, list[Slot]]:
    """What each slot is joined to in the columns beside its own."""
    column = {slot: k for k, slots in enumerate(columns) for slot in slots}
    found: dict[Slot, list[Slot]] = {slot: [] for slot in column}
    for source, target in wires:
        if (source, target) in back:
            continue
        chain: list[Slot] = [source, *((source, target, k) for k in range(column[source] + 1, column[target])), target]
        for one, other in pairwise(chain):
            found[one].append(other)
            found[other].append(one)
    return found


def _places(
    columns: list[list[Slot]], wires: Mapping[tuple[str, str], object], back: Sequence[tuple[str, str]]
) -> dict[Slot, Point]:
    """The upper left corner of each slot."""
    joined = _neighbours(columns, wires, back)
    height = {slot: ROW if isinstance(slot, str) else ROW / 3 for column in columns for slot in column}
    y: dict[Slot, float] = {}
    for column in columns:
        _stack(column, dict.fromkeys(column, 0.0), height, y)
    for sweep in range(SWEEPS):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            wanted = {slot: _mean([y[other] for other in joined[slot]], y[slot]) for slot in column}
            column.sort(key=wanted.__getitem__)
            _stack(column, wanted, height, y)
    top = min(y.values(), default=0.0)
    return {slot: (k * (BOX + GAP), y[slot] - top) for k, column in enumerate(columns) for slot in column}


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _stack(
    column: Sequence[Slot], wanted: Mapping[Slot, float], height: Mapping[Slot, float], y: dict[Slot, float]
) -> None:
    """Place a column's slots where they are wanted, in their order and none over another; their mean stays."""
    below = -1e9
    for slot in column:
        y[slot] = max(wanted[slot], below)
        below = y[slot] + height[slot]
    shift = _mean([wanted[slot] - y[slot] for slot in column], 0.0)
    for slot in column:
        y[slot] += shift


def _curve(pair: tuple[str, str], places: Mapping[Slot, Point], lane: float | None, told: Sequence[str]) -> str:
    source, target = pair
    x, y = places[source][0] + BOX, places[source][1] + HEIGHT / 2
    u, v = places[target][0], places[target][1] + HEIGHT / 2
    tip = f"<title>{escape(chr(10).join(told))}</title>"
    if lane is not None:
        out, into = x + TURN, u - TURN
        path = f"M{x:.0f},{y + 8:.0f}H{out:.0f}V{lane:.0f}H{into:.0f}V{v + 8:.0f}H{u:.0f}"
        return f'<path class="b" d="{path}" marker-end="url(#a)">{tip}</path>'
    path = f"M{x:.0f},{y:.0f}"
    between = sorted(p for slot, p in places.items() if not isinstance(slot, str) and slot[:2] == pair)
    for left, top in [*between, (u, v - ROW / 6)]:
        level = top + ROW / 6
        path += f"C{x + GAP / 2:.0f},{y:.0f} {left - GAP / 2:.0f},{level:.0f} {left:.0f},{level:.0f}"
        if left < u:
            path += f"H{left + BOX:.0f}"
        x, y = left + BOX, level
    return f'<path d="{path}" marker-end="url(#a)">{tip}</path>'


def _box(network: Network, name: str, x: float, y: float) -> str:
    component = network.components[name]
    many = f"{component.count} × " if component.fleet else ""
    said = component.declaration.doc.split("\n\n")[:1]
    kind = f"{many}{said[0] if component.entry.kind == 'expression' else component.declaration.name}"
    tip = [f"{name}: {many}{component.declaration.name}", *said]
    fill = _FILLS.get(component.entry.kind, _FILLS["block"])
    middle = x + BOX / 2
    return (
        f'<g><title>{escape(chr(10).join(tip))}</title><rect x="{x:.0f}" y="{y:.0f}" width="{BOX:.0f}" '
        f'height="{HEIGHT:.0f}" fill="{fill}"/><text class="n" x="{middle:.0f}" y="{y + 19:.0f}">{_short(name)}</text>'
        f'<text x="{middle:.0f}" y="{y + 35:.0f}">{_short(kind)}</text></g>'
    )


def _short(text: str) -> str:
    return escape(text if len(text) <= _CHARACTERS else f"{text[: _CHARACTERS - 1]}…")
