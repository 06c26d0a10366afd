"""Gauss-Seidel: block by block, each on the newest of what it reads.

    for each block B in turn, those first that it reads:
        evaluate anew, at t + h, what B reads through blocks without a turn, where it depends on one that has stepped
        x_B ← integrate d_B(τ, x_B, u_B) from t to t + h           (a foreign block steps by itself)
        evaluate anew, at t + h, what B publishes

So x ← v, v ← -4 x is the symplectic Euler method to the last bit. What a block reads of itself is held like any other
input. `cosim.wiring.order.turns` says in what order, and what is evaluated anew.
"""

from __future__ import annotations

from collections.abc import Sequence

from cosim.engine.banks import new_bank
from cosim.engine.writer import Writer
from cosim.wiring import order
from cosim.wiring.network import Component, Loop, Task


def advance(writer: Writer, tasks: Sequence[Task | Loop]) -> None:
    """Write ADVANCE. tasks: all outputs and joins, in the order of their evaluation."""
    components = writer.network.components
    banks = {name: _bank(writer, c) for name, c in components.items() if c.declaration.continuous()}
    begin = writer.begin()
    for turn in order.turns(writer.network, tasks):
        component = components[turn.component]
        writer.tasks(order.continuous(writer.network, turn.before), at_end=True)
        for port in turn.newest:
            writer.remember(component, port, at_end=True)
        writer.step(component)
        if turn.component in banks:
            _integrate(writer, component, banks[turn.component])
        writer.recall(component, at_end=True)
        writer.tasks(order.continuous(writer.network, turn.after), at_end=True)
    writer.phase("ADVANCE", begin)


def _is_in_place(component: Component) -> bool:
    held = not order.needed_outputs(component) and not component.couplings
    return component.integration.is_one_euler_step and held


def _bank(writer: Writer, component: Component) -> int:
    """What comes in has changed since outputs were published, so the first stage evaluates them as all others do."""
    in_place = _is_in_place(component)
    first = writer.derivatives([component])
    writer.slopes.append(first)
    inner = writer.stage(component, hidden=not in_place)
    return new_bank(writer, [component], in_place, component.integration, first if in_place else inner, inner)


def _integrate(writer: Writer, component: Component, bank: int) -> None:
    in_place = _is_in_place(component)
    if not in_place:
        writer.copy_states("W", "X", component)
    writer.integrate(bank)
    if not in_place:
        writer.copy_states("X", "W", component)
