"""Jacobi: every block takes the whole step by itself, with its inputs held at what was published at its begin.

    for each block B, in any order:
        x_B ← integrate d_B(τ, x_B, u_B(t)) from t to t + h        (a foreign block steps by itself)
    then publish all x_B at once

Coupling is of first order, whatever the integrators' order. What a block integrates is hidden in W until all have
stepped; where every block does a single Euler step, all derivatives come first, and one bank in place is enough.
"""

from __future__ import annotations

from collections.abc import Sequence

from cosim.engine.banks import new_bank
from cosim.engine.writer import Writer
from cosim.integrators import Integration
from cosim.wiring.network import Component, Loop, Task
from cosim.wiring.order import has_turn


def advance(writer: Writer, _tasks: Sequence[Task | Loop]) -> None:
    """Write ADVANCE, which follows from what is published alone, whatever the order of evaluation."""
    components = list(writer.network.components.values())
    continuous = [component for component in components if component.declaration.continuous()]
    single = all(component.integration.is_one_euler_step for component in continuous)
    banks = _at_once(writer, continuous) if single else [_bank(writer, component) for component in continuous]
    begin = writer.begin()
    for component in filter(has_turn, components):
        writer.step(component)
    for bank in banks:
        writer.integrate(bank)
    if not single:
        writer.copy_states("X", "W")
    writer.phase("ADVANCE", begin)


def _at_once(writer: Writer, components: Sequence[Component]) -> list[int]:
    """One bank of all states, each block's derivatives at what is published."""
    first = writer.derivatives(components)
    writer.slopes.append(first)
    none = (first[1], first[1])
    return [new_bank(writer, components, True, Integration(), first, none)] if components else []


def _bank(writer: Writer, component: Component) -> int:
    first = writer.derivatives([component])
    writer.slopes.append(first)
    inner = writer.stage(component, hidden=True)
    return new_bank(writer, [component], False, component.integration, first, inner)
