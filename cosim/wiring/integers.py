"""FMI 2 has one type of integers: its ports take the type of those that they are wired to, in whatever order.

All ports that wires join through such ports have one type. Where others among them differ, it is the wider one, and
`matching` reports those that do not have it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from cosim.authoring.variables import Variable
from cosim.wiring.network import Component

_TYPES = (np.dtype(np.int32), np.dtype(np.int64))
_Port = tuple[str, str]


def agree(components: Mapping[str, Component]) -> None:
    """Give the ports that take any integer their type."""
    joined = _joined(components)
    variables = {port: components[port[0]].declaration.variables[port[1]] for port in joined}
    done: set[_Port] = set()
    for port in joined:
        if variables[port].any_integer and port not in done:
            net = _net(port, joined, variables)
            done |= net
            types = {variables[other].dtype for other in net if not variables[other].any_integer} & {*_TYPES}
            for variable in (variables[other] for other in net):
                if variable.any_integer and types:
                    variable.dtype = max(types, key=_TYPES.index)


def _net(port: _Port, joined: Mapping[_Port, set[_Port]], variables: Mapping[_Port, Variable]) -> set[_Port]:
    """All ports that have one type with this one."""
    net, waiting = {port}, [port]
    while waiting:
        new = joined[waiting.pop()] - net
        net |= new
        waiting += [other for other in new if variables[other].any_integer]
    return net


def _joined(components: Mapping[str, Component]) -> dict[_Port, set[_Port]]:
    """Of each port, those at the other ends of its wires."""
    found: dict[_Port, set[_Port]] = {}
    for one, other in _wires(components):
        found.setdefault(one, set()).add(other)
        found.setdefault(other, set()).add(one)
    return found


def _wires(components: Mapping[str, Component]) -> Iterator[tuple[_Port, _Port]]:
    for component in components.values():
        for port, sources in component.wires.items():
            yield from (((component.name, port), (s.component, s.variable)) for s in sources if s.variable)
