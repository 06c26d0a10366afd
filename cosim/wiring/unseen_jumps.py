"""Where an integrator's steps go across a jump that nothing declares: of an expression, which has no indicators."""

from __future__ import annotations

from collections.abc import Iterator

from cosim.errors import CosimError, WrongValue
from cosim.language import expression_tree
from cosim.language.entry import outputs_of
from cosim.language.expression_tree import TRUTHS, Applied, Expression
from cosim.language.misreadings import shown
from cosim.language.places import within
from cosim.wiring.jumps import behind
from cosim.wiring.network import Component, Network

JUMPING = {*TRUTHS, "sign", "floor", "ceil", "//", "%"}


def warnings(network: Network) -> Iterator[CosimError]:
    """One for each block with an expression that may jump between two points, where something integrates it."""
    for component in network.components.values():
        if component.entry.kind != "expression" or component.is_sampled or not _is_integrated(network, component):
            continue
        for node in outputs_of(component.entry.type).values():
            jumps = _jumps(expression_tree.read(str(node.value)))
            if found := next((part for part in jumps if _moves(network, component, part)), None):
                what = f"`{shown(found.text)}` may jump within a step, and an expression declares no events"
                fix = "take Switch, Sign, Compare or a block of your own, whose jumps are; or ask `cosim accuracy`"
                message = f"block {component.name}: {what}: figures may be wrong by as much as a step makes"
                yield WrongValue(message, within(node, found.offset), fix)
                break


def _jumps(expression: Expression) -> Iterator[Applied]:
    """The parts that may jump, the outermost first."""
    waiting = [expression]
    while waiting:
        part = waiting.pop(0)
        if isinstance(part, Applied):
            if part.operation in JUMPING:
                yield part
            waiting += part.operands


def _moves(network: Network, component: Component, part: Applied) -> bool:
    """Whether what decides a jump changes between two samples."""
    read = {name.name for name in expression_tree.named(part)}
    return "time" in read or any(
        behind(network, component, p).flows for p in read & set(component.wires) if component.wires[p]
    )


def _is_integrated(network: Network, component: Component) -> bool:
    """Whether a block with derivatives reads it, directly or through others that compute at once."""
    seen, waiting = {component.name}, [component.name]
    while waiting:
        name = waiting.pop()
        for other in network.components.values():
            wired = any(source.component == name for sources in other.wires.values() for source in sources)
            if wired and other.name not in seen and not other.is_sampled:
                if other.declaration.kind("derivatives"):
                    return True
                seen.add(other.name)
                waiting.append(other.name)
    return False
