"""The signals that a diagram names beside its wires: recorded, reduced, animated, and shown or driven from outside."""

from __future__ import annotations

from dataclasses import replace

from cosim.authoring.variables import Input
from cosim.errors import CosimError, UnknownPort
from cosim.language.reader import endpoint
from cosim.language.requirement import RequirementEntry, told
from cosim.language.source import Node
from cosim.wiring import meaning, windows
from cosim.wiring.draft import Draft
from cosim.wiring.network import Signal


def check(draft: Draft) -> None:
    """What is recorded is there, and the metrics fit what they reduce; the signals go to the draft."""
    diagram = draft.diagram
    recorded = [_known(draft, node) for node in (diagram.record.signals if diagram.record else ())]
    for node in diagram.outputs.values():
        _known(draft, node)
    for node in diagram.animation.values():
        _known(draft, node)
    for node in (node for nodes in diagram.inputs.values() for node in nodes):
        _check_own_input(draft, node)
    reduced = {name: _known(draft, metric.signal) for name, metric in diagram.metrics.items()}
    draft.recorded = tuple(dict.fromkeys(signal for signal in recorded if signal))
    draft.reduced = {name: signal for name, signal in reduced.items() if signal}
    for requirement in diagram.requirements.values():
        _check_requirement(draft, requirement)
    if diagram.run.steps:
        draft.problems.attempt(windows.reduced, draft.network())


def _known(draft: Draft, node: Node) -> Signal | None:
    """The signal that is named, if its shape is known; if it is not there, that is a mistake."""
    component = draft.named(endpoint(str(node.value))[0], node)
    if component is None:
        return None
    network = draft.network()
    signal = draft.problems.attempt(network.find, str(node.value), node.position)
    known = signal is not None and component.signal_axes(network.variable(signal)) is not None
    return signal if known else None


def _check_requirement(draft: Draft, requirement: RequirementEntry) -> None:
    """What a formula names is there, and fits."""
    from cosim.wiring import required  # with all that follows formulas

    nodes = [replace(node, value=str(node.value).partition("[")[0]) for node in requirement.signals.values()]
    known = [_known(draft, node) for node in nodes]  # all of them: each has its report
    if all(known):
        try:
            required.monitor(draft.network(), requirement, native=True)
        except CosimError as error:
            draft.problems.add(told(requirement.name, error))


def _check_own_input(draft: Draft, node: Node) -> None:
    """What an input of the diagram itself drives is an input of a block."""
    name, port = endpoint(str(node.value))
    component = draft.named(name, node)
    inputs = [v.name for v in component.declaration.of(Input)] if component else []
    if component and port not in inputs:
        message = f"`{node.value}`: {component.declaration.name} ({name}) has no input `{port}`"
        fix = meaning.usual_fix(component.declaration, port, inputs) or "name another block"
        draft.problems.add(UnknownPort(message, node.position, fix))
