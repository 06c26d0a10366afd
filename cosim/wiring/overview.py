"""What a wired diagram is, as data: for `cosim check`, a page, a notebook."""

from __future__ import annotations

from dataclasses import dataclass

from cosim.errors import CosimError
from cosim.language import source
from cosim.language.diagram import Diagram
from cosim.language.swaps import Swap
from cosim.wiring import conditions, loops, order, unseen_jumps, windows
from cosim.wiring.network import Component, Finding, Loop, Network

_SHOWN = 40


@dataclass(frozen=True)
class Wired:
    """An input and what it reads, or its constant in words.

    dealt: the fleets whose members are dealt to those of another, one each; "" is an axis that is no fleet's.
    """

    port: str
    sources: tuple[str, ...]
    dealt: tuple[str, ...] = ()
    constant: str = ""


@dataclass(frozen=True)
class ComponentOverview:
    """A component: its name, its block type, how many there are of it (None: it is of no fleet), its wires.

    due: when it is, "" if it is at every communication point. expressions: how it computes its outputs, if they say so.
    """

    name: str
    type: str
    count: int | None
    wires: tuple[Wired, ...]
    due: str
    expressions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ring:
    """An algebraic loop: what is solved for, what is evaluated to do so, and whose directional derivatives are used.

    first: whether it is one at initialization only.
    """

    torn: tuple[str, ...]
    tasks: tuple[str, ...]
    derived: tuple[str, ...]
    first: bool


@dataclass(frozen=True)
class Open:
    """A condition that only a run can judge."""

    component: str
    text: str
    source: str


@dataclass(frozen=True)
class Overview:
    """A wired diagram.

    first_order: coupling is of a lower order than some integrator. unchecked: components of which only their code tells
    what they are, with their files; where there are any, order and conditions are not known. order: functions, as they
    are evaluated. turns: of blocks, under gauss-seidel. findings: conditions judged; open: those that a run judges.
    warnings: also of conditions that fail. requirements: their formulas, by name.
    """

    diagram: Diagram
    first_order: bool
    swaps: tuple[Swap, ...]
    parts: tuple[ComponentOverview, ...]
    unchecked: dict[str, str]
    order: tuple[str, ...]
    turns: tuple[str, ...]
    loops: tuple[Ring, ...]
    findings: tuple[Finding, ...]
    open: tuple[Open, ...]
    warnings: tuple[CosimError, ...]
    requirements: dict[str, str]


def describe(network: Network) -> Overview:
    """Everything about a wired diagram that does not need a run. Raises: DiagramErrors of its metrics."""
    _, warnings = windows.reduced(network)
    whole = not network.unchecked
    findings = conditions.conditions(network) if whole else []
    rings = _rings(network, first=False)
    broken = [conditions.as_warning(network, finding) for finding in findings if finding.holds is False]
    run = network.diagram.run
    return Overview(
        diagram=network.diagram,
        first_order=run.method != "joint" and _higher_order(network),
        swaps=tuple(network.swaps),
        parts=tuple(_part(network, component) for component in network.components.values()),
        unchecked={name: str(network.diagram.blocks[name].path) for name in network.unchecked},
        order=tuple(f"{t.component}.{t.function}" for t in order.flat(network.evaluation) if t.function),
        turns=_turns(network),
        loops=(*rings, *(ring for ring in _rings(network, first=True) if ring.torn not in {r.torn for r in rings})),
        findings=tuple(findings),
        open=tuple(Open(c.name, r.text, r.source) for c, r, _ in conditions.along(network)) if whole else (),
        warnings=(*warnings, *broken, *(unseen_jumps.warnings(network) if whole else ())),
        requirements={name: entry.text for name, entry in network.diagram.requirements.items()},
    )


def _rings(network: Network, first: bool) -> list[Ring]:
    """The algebraic loops of a step; first: those at initialization."""
    found = []
    for loop in network.initial if first else network.evaluation:
        if isinstance(loop, Loop):
            tasks = tuple(f"{task.component}.{task.function or task.port}" for task in loop.tasks)
            found.append(Ring(tuple(map(str, loop.torn)), tasks, tuple(loops.derived(network, loop)), first))
    return found


def _turns(network: Network) -> tuple[str, ...]:
    if network.diagram.run.method != "gauss-seidel" or network.unchecked:
        return ()
    return tuple(turn.component for turn in order.turns(network, network.evaluation))


def _higher_order(network: Network) -> bool:
    """Whether a block that reads others is integrated to an order above one."""
    return any(
        c.integration.method.order > 1 and c.wires and c.declaration.continuous() for c in network.components.values()
    )


def _part(network: Network, component: Component) -> ComponentOverview:
    wires = [
        Wired(port, tuple(map(str, sources)), _dealt(network, component, port))
        for port, sources in component.wires.items()
    ]
    wires += [Wired(port, (), constant=_constant(component, port)) for port in component.entry.constants]
    wires.sort(key=lambda wire: [*component.entry.inputs].index(wire.port))
    count = component.count if component.fleet else None
    due = str(component.clock) if component.clock and "period" in component.entry.settings else ""
    said = tuple(component.declaration.doc.split("\n")) if component.entry.kind == "expression" else ()
    return ComponentOverview(component.name, component.declaration.name, count, tuple(wires), due, said)


def _constant(component: Component, port: str) -> str:
    """A constant as it is written, with its unit."""
    text = source.dump(component.entry.inputs[port].plain()).replace("\n...\n", "").strip().replace("\n", " ")
    unit = component.declaration.variables[port].unit
    short = text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"
    return f"{short} {unit}" if isinstance(unit, str) and unit != "1" else short


def _dealt(network: Network, component: Component, port: str) -> tuple[str, ...]:
    """The fleets of a port's sources, where the members of another fleet get one element each of them."""
    axes = [network.axes(source) for source in component.wires[port]]
    dealt = component.fleet and max(map(len, axes)) > len(component.shape(component.declaration.variables[port]))
    fleets = dict.fromkeys(own[0].fleet for own in axes if own)
    return tuple(fleet or "" for fleet in fleets) if dealt and component.fleet not in fleets else ()
