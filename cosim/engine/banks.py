"""Banks: states that are integrated together, with the rows that give their derivatives, and their integrator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.engine.layout import Layout
from cosim.engine.writer import Range, Writer
from cosim.integrators import Integration, ScipyMethod
from cosim.master import tables
from cosim.wiring.network import Component


def new_bank(
    writer: Writer,
    components: Sequence[Component],
    in_place: bool,
    integration: Integration,
    first: Range,
    inner: Range,
    apart: bool = True,
) -> int:
    """The states of components that are integrated together, of one or of all.

    first, inner: the rows that give derivatives, from what is published and at a stage; in_place: stages are
    written over what is published. apart: whether members of a fleet do not depend on each other in a step.
    """
    method = integration.method
    if integration.integrator not in writer.tableaus:
        writer.tableaus[integration.integrator] = writer.layout.constant(np.array(method.words()))
    row = dict.fromkeys(range(tables.BANK_WORDS), 0)
    row[tables.BEGIN], row[tables.END] = _span(writer.layout, components)
    row[tables.IN_PLACE], row[tables.INNER_STEPS] = int(in_place), integration.inner_steps
    row[tables.FIRST_BEGIN], row[tables.FIRST_END] = first
    row[tables.INNER_BEGIN], row[tables.INNER_END] = inner
    row[tables.STAGES], row[tables.TABLEAU] = method.count, writer.tableaus[integration.integrator]
    row[tables.CONTROLLED] = int(integration.tolerance is not None)
    row[tables.TOLERANCES] = writer.layout.constant(np.array(integration.tolerances))
    row[tables.ESTIMATED], row[tables.HANDS_ON] = method.order, int(method.ends_with_slope)
    row[tables.MEMORY] = writer.layout.memory + 8 * tables.MEMORY_WORDS * len(writer.banks)
    if method.is_implicit and not isinstance(method, ScipyMethod):
        row[tables.IMPLICIT] = _equations(writer, components, inner, apart)
    writer.banks.append([*row.values()])
    return len(writer.banks) - 1


def _equations(writer: Writer, components: Sequence[Component], inner: Range, apart: bool) -> int:
    """The offset of what an implicit integrator solves for the states of components."""
    found = [part for component in components if (part := writer.layout.states_of(component)).size]
    states = np.concatenate(found if apart else [part.reshape(1, -1) for part in found], axis=1)
    systems, size = states.shape
    timed = any(None in writer.calls[row[tables.A]].arguments for row in _calls(writer, inner))
    timed |= any(row[tables.KIND] == tables.TRACE for row in writer.rows[slice(*inner)])
    work = writer.layout.allocate(8 * states.size * (tables.SYSTEM_VECTORS + 2 * size))
    words = [systems, size, work, int(timed), *(states - _span(writer.layout, components)[0]).reshape(-1)]
    return writer.layout.constant(np.array(words, np.int64))


def _calls(writer: Writer, rows: Range) -> list[list[int]]:
    return [row for row in writer.rows[slice(*rows)] if row[tables.KIND] == tables.CALL]


def _span(layout: Layout, components: Sequence[Component]) -> Range:
    """Where the continuous states of components that stand side by side are in the state vector."""
    states = np.concatenate([layout.states_of(component).reshape(-1) for component in components])
    return int(states.min()), int(states.max()) + 1
