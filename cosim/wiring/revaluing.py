"""Other parameters and start values for a network that is wired already."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from cosim.authoring.variables import Parameter
from cosim.errors import Problems
from cosim.language.values import Value
from cosim.wiring import conditions, seeds
from cosim.wiring.given_values import array
from cosim.wiring.network import Component, Network, Signal


def revalue(network: Network, values: Mapping[Signal, Value]) -> Network:
    """The same network with other parameters and start values, of the shapes that it was wired with.

    Nothing is wired again; rules that see a changed value are judged again. Raises: DiagramErrors.
    """
    problems, fleets = Problems(), network.diagram.fleets
    changed = {s.component: replace(network.components[s.component]) for s in values}
    components = {**network.components, **changed}
    for component in changed.values():
        new = {s.variable: v for s, v in values.items() if s.component == component.name}
        variables = component.declaration.variables
        arrays = {name: problems.attempt(array, component, variables[name], v, fleets) for name, v in new.items()}
        component.values = {**component.values, **{k: v for k, v in arrays.items() if v is not None}}
    for repeated in seeds.repeated(components, {(s.component, s.variable): v for s, v in values.items()}):
        problems.add(repeated)
    problems.raise_if_any()
    parametrised = {s.component for s in values if isinstance(network.variable(s), Parameter)}
    seen = _after(components, parametrised) if parametrised else set()
    names = [name for name in components if name in changed or name in seen]
    conditions.check(components, names, problems, values)
    problems.raise_if_any()
    return network.revalued(components)


def _after(components: Mapping[str, Component], names: set[str]) -> set[str]:
    """The named components and all that wires lead to from them: a rule may look at any block before its own."""
    readers: dict[str, set[str]] = {}
    for component in components.values():
        for source in (source for wires in component.wires.values() for source in wires):
            readers.setdefault(source.component, set()).add(component.name)
    found, todo = set(names), list(names)
    while todo:
        new = readers.get(todo.pop(), set()) - found
        found |= new
        todo += new
    return found
