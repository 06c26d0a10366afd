"""Where boxes stand: the order in each column with few crossings, then heights at which wires are straight."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cosim.drawing.boxes import Box, short
from cosim.drawing.layers import SWEEPS, Layers, Segment, Slot

HEAD, ROW, FOOT = 40.0, 15.0, 7.0
"""Pixels of a box: its name and type, a port, and below the ports."""
LETTER, SMALL = 6.6, 5.2
"""Pixels of a letter, about, in a box's name and in its ports."""
GAP, BETWEEN, PASSING = 78.0, 24.0, 16.0
"""Pixels between two columns, between a box and the next below it, and for wires that pass."""


@dataclass(frozen=True)
class Places:
    """left: of each column (and where the last one would end); width: of each; top: of each slot."""

    left: list[float]
    width: list[float]
    top: dict[Slot, float]
    column: dict[Slot, int]

    def outlet(self, slot: Slot, port: int) -> tuple[float, float]:
        """Where a wire leaves a slot."""
        k = self.column[slot]
        return self.left[k] + self.width[k], self.top[slot] + height_of_port(slot, port)

    def inlet(self, slot: Slot, port: int) -> tuple[float, float]:
        """Where a wire comes to a slot."""
        return self.left[self.column[slot]], self.top[slot] + height_of_port(slot, port)


def height_of_port(slot: Slot, port: int) -> float:
    """How far below a slot's top a wire meets it."""
    return HEAD + ROW * (port + 0.5) if isinstance(slot, str) else PASSING / 2


def box_height(box: Box) -> float:
    """Of a box."""
    return HEAD + ROW * max(len(box.inputs), len(box.outputs)) + FOOT


def box_width(box: Box) -> float:
    """Of a box: its texts fit."""
    left = max((len(short(p.name)) for p in box.inputs), default=0)
    right = max((len(short(p.name)) + (len(p.note) + 1 if p.note else 0) for p in box.outputs), default=0)
    head = max(len(short(box.name)) * LETTER, len(short(box.said)) * SMALL * 1.08) + 20.0
    return max(110.0, head, (left + right) * SMALL + 34.0)


def places(boxes: Mapping[str, Box], layers: Layers, corner: tuple[float, float] = (0.0, 0.0)) -> Places:
    """The places of all slots; corner: the upper left one of them all."""
    heights = {s: box_height(boxes[s]) + BETWEEN if isinstance(s, str) else PASSING for c in layers.columns for s in c}
    top = _ordered(layers, heights)
    width = [max((box_width(boxes[s]) for s in c if isinstance(s, str)), default=40.0) for c in layers.columns]
    left = [corner[0]]
    for each in width:
        left.append(left[-1] + each + GAP)
    least = min(top.values(), default=0.0)
    column = {slot: k for k, slots in enumerate(layers.columns) for slot in slots}
    return Places(left, width, {slot: y - least + corner[1] for slot, y in top.items()}, column)


def _ordered(layers: Layers, heights: Mapping[Slot, float]) -> dict[Slot, float]:
    """The columns in the order that crosses least of those tried, and the tops of all slots; changes the columns."""
    before, after = _neighbours(layers.segments)
    top: dict[Slot, float] = {}
    for column in layers.columns:
        _stack(column, dict.fromkeys(column, 0.0), heights, top)
    best = (_crossings(layers, top), [list(c) for c in layers.columns], dict(top))
    for sweep in range(SWEEPS):
        ahead = sweep % 2 == 0
        joined = before if ahead else after
        for column in layers.columns if ahead else reversed(layers.columns):
            wanted = {slot: _wanted(slot, joined, top) for slot in column}
            column.sort(key=wanted.__getitem__)
            _stack(column, wanted, heights, top)
        crossed = _crossings(layers, top)
        if crossed < best[0]:
            best = (crossed, [list(c) for c in layers.columns], dict(top))
    layers.columns[:] = best[1]
    return _straightened(layers, heights, best[2], before, after)


Joined = dict[Slot, list[tuple[Slot, float]]]
"""To each slot, the slots that it is joined to, and how much lower the wire is on it than on them."""


def _neighbours(segments: Sequence[Segment]) -> tuple[Joined, Joined]:
    before: Joined = {}
    after: Joined = {}
    for s in segments:
        lower = height_of_port(s.right, s.arrive) - height_of_port(s.left, s.leave)
        before.setdefault(s.right, []).append((s.left, lower))
        after.setdefault(s.left, []).append((s.right, -lower))
    return before, after


def _wanted(slot: Slot, joined: Joined, top: Mapping[Slot, float]) -> float:
    """Where a slot's wires would be straight, in the mean."""
    found = [top[other] - lower for other, lower in joined.get(slot, ())]
    return sum(found) / len(found) if found else top[slot]


def _straightened(
    layers: Layers, heights: Mapping[Slot, float], top: dict[Slot, float], before: Joined, after: Joined
) -> dict[Slot, float]:
    """The tops at which wires are straighter, in the same order."""
    both: Joined = {s: before.get(s, []) + after.get(s, []) for s in top}
    for sweep in range(SWEEPS):
        joined = (before, after, both)[sweep % 3] if sweep < SWEEPS - 3 else both
        for column in layers.columns:
            _stack(column, {slot: _wanted(slot, joined, top) for slot in column}, heights, top)
    return top


def _stack(
    column: Sequence[Slot], wanted: Mapping[Slot, float], heights: Mapping[Slot, float], top: dict[Slot, float]
) -> None:
    """Place a column's slots, in their order, as near as can be to where each is wanted, none over another.

    Least squares, by joining neighbours that would overlap (pool adjacent violators).
    """
    offset, total = {}, 0.0
    for slot in column:
        offset[slot] = total
        total += heights[slot]
    pools: list[tuple[float, list[Slot]]] = []
    for slot in column:
        mean, members = wanted[slot] - offset[slot], [slot]
        while pools and pools[-1][0] > mean:
            other, more = pools.pop()
            mean = (other * len(more) + mean * len(members)) / (len(more) + len(members))
            members = more + members
        pools.append((mean, members))
    for mean, members in pools:
        for slot in members:
            top[slot] = mean + offset[slot]


def _crossings(layers: Layers, top: Mapping[Slot, float]) -> int:
    """How often wires cross between columns."""
    place: Callable[[Slot, int], float] = lambda slot, port: top[slot] + height_of_port(slot, port)  # noqa: E731
    column = {slot: k for k, slots in enumerate(layers.columns) for slot in slots}
    found: dict[int, list[tuple[float, float]]] = {}
    for s in layers.segments:
        found.setdefault(column[s.left], []).append((place(s.left, s.leave), place(s.right, s.arrive)))
    return sum(
        (a[0] - b[0]) * (a[1] - b[1]) < 0.0 for ends in found.values() for k, a in enumerate(ends) for b in ends[:k]
    )
