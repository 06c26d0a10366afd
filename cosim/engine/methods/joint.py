"""Joint: all continuous states as one system, all outputs evaluated anew at every stage.

    x ← integrate d(τ, x, outputs(τ, x)) from t to t + h, with x the states of all blocks

So coupling is of the integrator's order. Sampled outputs stay as they are. A block that steps by itself cannot join.
"""

from __future__ import annotations

from collections.abc import Sequence

from cosim.engine.banks import new_bank
from cosim.engine.writer import Writer
from cosim.errors import FmuError
from cosim.wiring import members, order
from cosim.wiring.network import Component, Loop, Task


def advance(writer: Writer, tasks: Sequence[Task | Loop]) -> None:
    """Write ADVANCE. tasks: all outputs and joins, in the order of their evaluation. Raises: FmuError."""
    components = list(writer.network.components.values())
    _refuse_steps(components)
    first = writer.derivatives(components)
    writer.slopes.append(first)
    inner = writer.begin()
    writer.tasks(order.continuous(writer.network, tasks))
    writer.derivatives(components)
    last = writer.end(inner)
    begin = writer.begin()
    if writer.layout.states:
        integration, apart = writer.network.diagram.run.integration, members.are_apart(writer.network)
        writer.integrate(new_bank(writer, components, True, integration, first, last, apart))
    writer.phase("ADVANCE", begin)


def _refuse_steps(components: Sequence[Component]) -> None:
    for component in components:
        if component.declaration.kind("step"):
            said = "a co-simulation FMU steps by itself, so it cannot be integrated jointly"
            fix = "choose another run.method, or model exchange"
            raise FmuError(f"block {component.name}: {said}", component.entry.type.position, fix)
