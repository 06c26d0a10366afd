"""What is drawn of a network: a box for each block, or diagram inside it, with its wired ports; and its wires."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from cosim.wiring.network import Component, Loop, Network, Signal

LONGEST = 32
"""Characters of a text in a box: of longer ones, the beginning is shown."""
DIAGRAM = "diagram"


@dataclass(frozen=True)
class BoxPort:
    """A port of a box. note: its shape and unit."""

    name: str
    note: str = ""


@dataclass
class Box:
    """A block. kind: of what it is, "diagram" for all blocks of a diagram inside the diagram. said: below its name.

    fleet: whether there are many. looped: whether it is part of an algebraic loop. changed: whether somebody wants that
    to be seen. tip: more about it.
    """

    name: str
    kind: str
    said: str
    fleet: bool = False
    looped: bool = False
    changed: bool = False
    tip: str = ""
    inputs: list[BoxPort] = field(default_factory=list)
    outputs: list[BoxPort] = field(default_factory=list)


@dataclass(frozen=True)
class Wire:
    """From an output to an input, each a box and the number of its port. late: by a delay. tip: in words."""

    source: tuple[str, int]
    target: tuple[str, int]
    late: bool = False
    tip: str = ""


def boxes(network: Network, changed: Iterable[str] = ()) -> tuple[dict[str, Box], list[Wire]]:
    """The boxes by name, and all wires between them. changed: blocks that are to stand out."""
    found: dict[str, Box] = {}
    looped = {task.component for step in network.evaluation if isinstance(step, Loop) for task in step.tasks}
    for component in network.components.values():
        name = _outer(component.name)
        box = found.setdefault(name, _diagram(name) if name != component.name else _block(component))
        box.looped |= component.name in looped
        box.changed |= component.name in {*changed} or name in {*changed}
    wires = list(_wires(network, found))
    return found, wires


def _outer(name: str) -> str:
    return name.partition("/")[0]


def _diagram(name: str) -> Box:
    return Box(name, DIAGRAM, "a diagram", tip=f"{name}: a diagram as a block")


def _block(component: Component) -> Box:
    declaration, entry = component.declaration, component.entry
    first = declaration.doc.split("\n\n")[0]
    type_ = first if entry.kind == "expression" else declaration.name
    many = f"{component.count} × " if component.fleet else ""
    due = f", every {_time(float(component.clock.period))}" if component.clock else ""
    said = f"{many}{type_}{due}"
    return Box(component.name, entry.kind, said, bool(component.fleet), tip=f"{component.name}: {said}\n{first}")


def _time(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 1.0 else f"{1000.0 * seconds:g} ms"


def _wires(network: Network, found: dict[str, Box]) -> Iterator[Wire]:
    """The wires between boxes; those inside one are not seen. Their ports are added to the boxes."""
    for name, component in network.components.items():
        for port, sources in component.wires.items():
            coupling = component.couplings.get(port)
            for source in sources:
                a, b = _outer(source.component), _outer(name)
                if a == b and a != name:
                    continue
                note = _note(network, source)
                out = _number(found[a].outputs, BoxPort(_inner(source.component, source.variable), note))
                into = _number(found[b].inputs, BoxPort(_inner(name, port)))
                late = coupling is not None and coupling.delay > 0
                tip = f"{source} → {name}.{port}" + (
                    f", {_time(float(coupling.delay))} late" if coupling and late else ""
                )
                yield Wire((a, out), (b, into), late, tip)


def _inner(component: str, port: str) -> str:
    """What a port is called at a box: of a diagram's, with the block inside."""
    inner = component.partition("/")[2]
    return f"{inner}.{port}" if inner else port


def _number(ports: list[BoxPort], port: BoxPort) -> int:
    for k, known in enumerate(ports):
        if known.name == port.name:
            return k
    ports.append(port)
    return len(ports) - 1


def _note(network: Network, signal: Signal) -> str:
    """The shape and the unit of what a wire carries, of one member of a fleet."""
    variable = network.variable(signal)
    shape = network.components[signal.component].shape(variable)
    unit = variable.unit if isinstance(variable.unit, str) and variable.unit != "1" else ""
    return " ".join(filter(None, ("×".join(map(str, shape)), unit)))


def short(text: str, most: int = LONGEST) -> str:
    """A text that fits."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
