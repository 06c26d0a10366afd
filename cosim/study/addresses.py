"""Where a dotted path of a study leads in a wired diagram, and what stands there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.authoring.variables import Input, Parameter, State, Variable
from cosim.errors import Position, UnknownSetting
from cosim.language.data_files import listed
from cosim.language.keys import BLOCK
from cosim.language.reader import is_constant
from cosim.language.source import Node
from cosim.study.plain_values import as_node
from cosim.wiring.network import Network, Signal


@dataclass(frozen=True)
class Address:
    """Where a dotted path leads: a parameter, start value or constant, or one element of it (indices from 0)."""

    signal: Signal
    section: str
    indices: tuple[int, ...]


def address_of(network: Network, path: str) -> Address | None:
    """The parameter, start value or constant that a dotted path names; None for anything else, which is structure."""
    parts = path.split(".")
    component = network.components.get(parts[1]) if len(parts) > 2 and parts[0] == "blocks" else None
    if component is None:
        return None
    if parts[2] not in BLOCK:  # short for one of these sections, as of `overlay.set_value`
        parts.insert(2, "start" if parts[2] in component.entry.start else "parameters")
    kinds: dict[str, tuple[type[Variable], ...]] = {
        "parameters": (Parameter,),
        "start": (State, Input),
        "inputs": (Input,),
    }
    if parts[2] not in kinds:
        return None
    for end in range(len(parts), 3, -1):
        name, rest = ".".join(parts[3:end]), parts[end:]
        variable = component.declaration.variables.get(name)
        known = isinstance(variable, kinds[parts[2]]) and not variable.structural
        if parts[2] == "inputs" and name not in component.entry.constants:
            continue
        if known and name not in component.wires and all(part.isdecimal() for part in rest):
            return Address(Signal(parts[1], name), parts[2], tuple(map(int, rest)))
    return None


def value_at(network: Network, path: str) -> Any:
    """The number that a dotted path names, or nested lists of such, as the network has it. Raises: UnknownSetting."""
    address = address_of(network, path)
    if address is None:
        raise UnknownSetting(f"`{path}` names no value", None, "such as blocks.plant.parameters.mass")
    values = network.components[address.signal.component].values[address.signal.variable]
    found = values[0] if len(values) == 1 else values
    for index in address.indices:
        found = found[index]
    return np.asarray(found).tolist()


def is_value(network: Network, path: str, value: Any) -> bool:
    """Whether what a member sets is a value, and not structure such as a wire in a constant's place."""
    address = address_of(network, path)
    return address is not None and (address.section != "inputs" or is_constant(as_node(value, Position(""))))


def written(network: Network, address: Address) -> Node:
    """What the diagram says of a value, or else the block's default."""
    component, name = network.components[address.signal.component], address.signal.variable
    entries: Mapping[str, Node] = getattr(component.entry, address.section)
    if name in entries:
        return listed(entries[name])
    default = component.declaration.variables[name].start
    return as_node(np.asarray(default).tolist() if np.ndim(default) else default, component.entry.position)


def with_element(node: Node, indices: tuple[int, ...], new: Node) -> Node:
    """A value with another one in the place of an element (indices from 0); with no index, that other one."""
    if not indices:
        return new
    items = list(listed(node).value)
    items[indices[0]] = with_element(items[indices[0]], indices[1:], new)
    return Node(items, node.position)
