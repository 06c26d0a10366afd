"""Boxes in columns, as signals go, and the order in each column (Sugiyama, Tagawa, Toda 1981).

Wires that close a ring are set apart first: they lead back below all boxes, to what the file names first. A wire that
passes columns takes a place in each, one for all wires from one port.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import networkx

from cosim.drawing.boxes import Wire

Outlet = tuple[str, int]
"""A box and the number of one of its outputs."""
Slot = str | tuple[str, int, int]
"""A box by its name, or where the wires from an outlet pass a column: box, output, column."""
SWEEPS = 24


@dataclass(frozen=True)
class Segment:
    """What joins two slots of adjacent columns. leave, arrive: the places on them, as of `Offsets`."""

    left: Slot
    right: Slot
    leave: int
    arrive: int


@dataclass(frozen=True)
class Layers:
    """columns: the slots, in order. segments: between columns. back: the wires that lead back."""

    columns: list[list[Slot]]
    segments: list[Segment]
    back: list[Wire]


def layers(names: Sequence[str], wires: Sequence[Wire]) -> Layers:
    """The columns of boxes, in the order of the file."""
    graph = networkx.DiGraph()
    graph.add_nodes_from(names)
    back: list[Wire] = []
    order = {name: k for k, name in enumerate(names)}
    for wire in sorted(wires, key=lambda w: order[w.source[0]]):
        source, target = wire.source[0], wire.target[0]
        if source == target or networkx.has_path(graph, target, source):
            back.append(wire)
        else:
            graph.add_edge(source, target)
    rank = _ranks(graph)
    columns: list[list[Slot]] = [[] for _ in range(max(rank.values(), default=0) + 1)]
    for name in names:
        columns[rank[name]].append(name)
    forward = [wire for wire in wires if wire not in back]
    return Layers(columns, _segments(rank, columns, forward), back)


def _ranks(graph: networkx.DiGraph) -> dict[str, int]:
    """The column of each box: behind all that it reads; what reads nothing, just before what needs it first."""
    rank = {name: k for k, layer in enumerate(networkx.topological_generations(graph)) for name in layer}
    for name in reversed(list(networkx.topological_sort(graph))):
        after = [rank[target] for target in graph.successors(name)]
        if after and not graph.in_degree(name):
            rank[name] = min(after) - 1
    return rank


def _segments(rank: Mapping[str, int], columns: list[list[Slot]], wires: Sequence[Wire]) -> list[Segment]:
    """The segments of all wires; the columns get the slots that wires pass."""
    reach: dict[Outlet, int] = {}
    for wire in wires:
        reach[wire.source] = max(reach.get(wire.source, 0), rank[wire.target[0]])
    found: dict[Segment, None] = {}
    for (name, port), last in reach.items():
        passed: list[Slot] = [(name, port, k) for k in range(rank[name] + 1, last)]
        for slot, k in zip(passed, range(rank[name] + 1, last), strict=True):
            columns[k].append(slot)
        chain = [name, *passed]
        for k, (one, other) in enumerate(pairwise(chain)):
            found[Segment(one, other, port if k == 0 else 0, 0)] = None
    for wire in wires:
        name, port = wire.source
        before = rank[wire.target[0]] - 1
        last_slot: Slot = name if before == rank[name] else (name, port, before)
        found[Segment(last_slot, wire.target[0], port if last_slot == name else 0, wire.target[1])] = None
    return list(found)
