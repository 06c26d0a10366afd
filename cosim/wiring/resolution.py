"""Resolves a diagram: which block each name stands for, the size of every axis, every value, and every wire.

The result is a `Network` of `Component`s. All mistakes of a diagram are found in one go.
"""

from __future__ import annotations

from cosim.authoring.variables import Output
from cosim.errors import Problems, WrongValue
from cosim.language.diagram import Diagram, note_inherited
from cosim.wiring import (
    components,
    conditions,
    couplings,
    dimensions,
    expression_type,
    given_values,
    integers,
    matching,
    members,
    merging,
    named_signals,
    order,
    seeds,
    sizes,
    widths,
    wires,
)
from cosim.wiring.draft import Draft
from cosim.wiring.network import Loop, Network, Signal


def wire(diagram: Diagram, problems: Problems | None = None, code: bool = True) -> Network:
    """Resolve a diagram; `problems` may already hold mistakes. Raises: DiagramErrors with all of them.

    Without `code`, blocks of `python:` files are left out, whose code would have to run, and named as `unchecked`.
    """
    draft = Draft(diagram, problems or Problems(), code, swaps=[*diagram.swaps])
    components.draft_all(draft)
    _connect(draft)
    _size(draft)
    given_values.evaluate(draft)
    for repeated in seeds.repeated(draft.components, draft.values):
        draft.problems.add(repeated)
    matching.check(draft.components, draft.problems)
    named_signals.check(draft)
    order.check_given(draft)
    draft.absent.report_outputs(draft.components, draft.problems)
    draft.absent.report_blocks(draft.components, draft.problems)
    conditions.check(draft.components, draft.components, draft.problems)
    if draft.is_whole() and not draft.problems.errors:
        members.report_large(draft.network(), draft.problems)
    note_inherited(diagram, draft.problems)
    draft.problems.raise_if_any()
    return draft.network()


def _connect(draft: Draft) -> None:
    """What each component's values and inputs are."""
    for component in draft.components.values():
        draft.problems.attempt(given_values.take, draft, component)
        draft.problems.attempt(wires.connect, draft, component)
    integers.agree(draft.components)
    expression_type.take_types(draft.components.values())
    couplings.couple(draft)


def _order(draft: Draft) -> None:
    """What comes before what. Raises: DiagramErrors with every AlgebraicLoop."""
    merging.merge(draft.network())
    network = order.ordered(draft.network())
    draft.initial, draft.evaluation = network.initial, network.evaluation
    _refuse_guesses(draft)


def _refuse_guesses(draft: Draft) -> None:
    """A start value of an output says where the solution of an algebraic loop is looked for, and nothing else."""
    solved = {signal for item in (*draft.initial, *draft.evaluation) if isinstance(item, Loop) for signal in item.torn}
    for component in draft.components.values():
        for output in component.declaration.of(Output):
            node = component.entry.start.get(output.name)
            if node and not component.declaration.foreign and Signal(component.name, output.name) not in solved:
                message = f"block {component.name}: output `{output.name}` is computed, so its start value is of no use"
                fix = "remove it; it is a guess where an algebraic loop is solved for that output"
                draft.problems.add(WrongValue(message, node.key_position, fix))


def _size(draft: Draft) -> None:
    """The size of every axis. Raises: DiagramErrors where there is no memory for all that comes next."""
    dimensions.solve(draft.components, draft.values, draft.diagram.fleets, draft.problems)
    dimensions.report_sizes(draft.components, draft.values, draft.problems)
    widths.report(draft.components, draft.problems)
    if draft.is_whole():
        draft.problems.attempt(_order, draft)
    if draft.is_whole():  # else what is missing may only be a consequence
        dimensions.report_unsolved(draft.components, draft.values, draft.problems)
    if not sizes.fit(draft.components.values(), draft.problems):
        draft.problems.raise_if_any()
    draft.problems.attempt(sizes.require_of_loops, draft.network())
    if draft.is_whole():
        draft.problems.attempt(sizes.require_of_delays, draft.network())
