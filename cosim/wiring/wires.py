"""The wires: for each input the signals that it reads, or else its start value."""

from __future__ import annotations

from cosim.authoring.variables import Input, Local, State
from cosim.errors import NotWirable, UnconnectedInput, UnknownPort, WrongValue
from cosim.language import expression
from cosim.language.reader import endpoint, is_constant
from cosim.language.source import Node
from cosim.wiring import meaning
from cosim.wiring.draft import Draft
from cosim.wiring.network import Component, Signal, port_and_members


def connect(draft: Draft, component: Component) -> None:
    """Fill in `Component.wires`. A source that is not known is a signal without a variable."""
    inputs = {v.name: v for v in component.declaration.of(Input)}
    for name, node in component.entry.inputs.items():
        sources = node.value if isinstance(node.value, list) else [node]
        if name in inputs and is_constant(node):
            draft.problems.attempt(_check_idle_start, component, name, node)
            draft.problems.attempt(_check_names, draft, component, name, node)
        elif name in inputs and sources:
            found = [draft.problems.attempt(_source, draft, component, name, source) for source in sources]
            component.wires[name] = tuple(s for s in found if s)
            draft.problems.attempt(_check_idle_start, component, name, node)
        elif name not in inputs:
            message = f"block {component.name}: {component.declaration.name} has no input `{name}`"
            fix = meaning.usual_fix(component.declaration, name, inputs)
            draft.problems.add(UnknownPort(message, node.key_position, fix))
    for name in inputs:
        if name not in component.entry.inputs and (component.name, name) not in draft.values:
            draft.problems.add(_unconnected(component, name))


def _check_names(draft: Draft, component: Component, port: str, node: Node) -> None:
    """Raises: WrongValue for a constant such as `e` where a block is called so, of which a port may be meant."""
    if isinstance(node.value, list):
        for child in node.value:
            _check_names(draft, component, port, child)
        return
    inside = component.name.rpartition("/")[0]
    for name in sorted(expression.names(node.value)) if isinstance(node.value, str) else ():
        meant = (f"{inside}/{name}/" if inside else f"{name}/", f"{name}/")
        if any(f"{block}/".startswith(meant) for block in draft.diagram.blocks):
            said = f"input `{port}` is the constant `{node.value}`, and a block is called `{name}`"
            fix = f"write {name}.port for what that gives out, or a number"
            raise WrongValue(f"block {component.name}: {said}", node.position, fix)


def _unconnected(component: Component, name: str) -> UnconnectedInput:
    message = f"block {component.name}: input `{name}` is not connected and has no start value"
    fix = f"add `{name}: block.port`, or a number, under blocks.{component.name}.inputs"
    if "/" in component.name:
        outer, _, inner = component.name.rpartition("/")
        own = f"inputs: {{{name}: {inner}.{name}}}"
        fix = f"give that diagram an input, {own}, and wire it under blocks.{outer}.inputs"
    return UnconnectedInput(message, component.entry.position, fix)


def _check_idle_start(component: Component, name: str, wire: Node) -> None:
    """A wired input has its source's value from time zero on, a constant its own; an inner diagram may keep a start.

    What is read late has its start value until then.
    """
    start = component.entry.start.get(name)
    if start is None or "delay" in wire.beside or ("/" in component.name and start.position.file != wire.position.file):
        return
    why, other = ("a constant", "constant") if is_constant(wire) else ("wired", "wire")
    message = f"block {component.name}: input `{name}` is {why}, so that its start value has no effect"
    raise WrongValue(message, start.key_position, f"remove it (an overlay writes `{name}: ~`), or the {other}")


def _source(draft: Draft, component: Component, taker: str, node: Node) -> Signal:
    """What an input is wired to. Raises: NotWirable."""
    name, port = endpoint(str(node.value))
    port, members = port_and_members(port)
    there = draft.named(name, node, component.name)
    if there is None:
        return Signal(component.name, "")
    source = there.declaration
    outputs = {v.name for v in source.variables.values() if v.causality == "output"}
    locals_ = {v.name for v in source.of(Local, State)} - outputs
    may_tap = component.declaration.measuring or component.declaration.feeds_locals_only(taker)
    if port in locals_ and not may_tap:
        message = f"block {component.name}: `{node.value}` is a local variable of {source.name}, not a port"
        fix = "only recordings, measuring blocks and locals may read locals" + _or_ports(name, outputs)
        raise NotWirable(message, node.position, fix)
    if port not in outputs | locals_:
        draft.absent.outputs.setdefault((name, port), []).append((node, component.name))
        return Signal(component.name, "")
    if source.measuring and not may_tap:
        message = f"block {component.name}: `{node.value}` comes from a measuring block"
        raise NotWirable(message, node.position, "only recordings and measuring blocks may read a measure")
    return Signal(name, port, members)


def _or_ports(name: str, outputs: set[str]) -> str:
    return f"; its ports are {', '.join(f'{name}.{o}' for o in sorted(outputs))}" if outputs else ""
