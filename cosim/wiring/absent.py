"""Blocks, outputs and fleets that a diagram names and that are not there: one mistake each, however often named."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches

from cosim.errors import Position, Problems, UnknownBlock, UnknownFleet, UnknownPort, listed_places, nearest
from cosim.language.entry import BlockEntry
from cosim.language.reader import endpoint
from cosim.language.source import Node
from cosim.wiring import meaning
from cosim.wiring.network import Component, port_and_members

Uses = list[tuple[Node, str]]
"""Where a name is used, each time with the block that takes a signal there, or ""."""


@dataclass
class Absent:
    """What is not there, with its uses: blocks by name, outputs by block and port, fleets with their blocks."""

    blocks: dict[str, Uses] = field(default_factory=dict)
    outputs: dict[tuple[str, str], Uses] = field(default_factory=dict)
    fleets: dict[str, list[BlockEntry]] = field(default_factory=dict)

    def report_fleets(self, known: Collection[str], problems: Problems) -> None:
        """An UnknownFleet each; of its blocks no more can be said."""
        for fleet, entries in self.fleets.items():
            message = f"block {entries[0].name}: there is no fleet `{fleet}`"
            if len(entries) > 1:
                message += f", nor for {', '.join(entry.name for entry in entries[1:])}"
            fix = nearest(fleet, known) or f"write fleets: {{{fleet}: 6}}"
            first, *others = (entry.settings["per"].position for entry in entries)
            error = UnknownFleet(message, first, fix)
            error.others = tuple(others)
            problems.add(error)

    def report_outputs(self, components: Mapping[str, Component], problems: Problems) -> None:
        """An UnknownPort each."""
        for (name, port), uses in self.outputs.items():
            source = components[name].declaration
            outputs = [v.name for v in source.variables.values() if v.causality == "output"]
            (node, taker), others, told = _sorted(uses)
            message = f"block {taker}: {source.name} ({name}) has no output `{port}`"
            message += f", which others name at {told}" if others else ""
            fix = meaning.usual_fix(source, port, outputs) or "it has no outputs"
            if (whole := port.partition("[")[0]) in outputs:
                fix = f"members are counted from 1, such as {whole}[2] or {whole}[1..3]"
            error = UnknownPort(message, node.position, fix)
            error.others = others
            problems.add(error)

    def report_blocks(self, components: Mapping[str, Component], problems: Problems) -> None:
        """An UnknownBlock each, unless there is no block at all."""
        for name, uses in self.blocks.items() if components else ():
            (node, taker), others, told = _sorted(uses)
            message = f"`{node.value}` names no block of the diagram"
            message = f"block {taker}: {message}" if taker else message
            if others:
                message = f"the diagram has no block `{name}`, which {len(uses)} wires and signals name"
                message += f", the others at {told}"
            ports = {port_and_members(endpoint(str(n.value))[1])[0] for n, _ in uses}
            error = UnknownBlock(message, node.position, _meant(name, ports, components))
            error.others = others
            problems.add(error)


def _meant(name: str, ports: set[str], components: Mapping[str, Component]) -> str:
    """The usual fix: the block of the nearest name, or else the one that has the ports which are asked for."""
    able = {n for n, component in components.items() if ports <= set(component.declaration.variables)}
    close = get_close_matches(name, able, n=1, cutoff=0.5) or get_close_matches(name, components, n=1, cutoff=0.5)
    if not close and len(able) == 1 and len(ports) > 1:
        return f"did you mean `{able.pop()}`, which has {', '.join(sorted(ports))}?"
    return nearest(close[0] if close else name, components)


def _sorted(uses: Uses) -> tuple[tuple[Node, str], tuple[Position, ...], str]:
    """The first of the uses of a name, and the places of the others, also in words."""
    ordered = sorted(uses, key=lambda use: (use[0].position.file, use[0].position.line, use[0].position.column))
    first, *others = (node.position for node, _ in ordered)
    return ordered[0], tuple(others), listed_places(others, first.file)
