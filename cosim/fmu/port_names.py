"""The names that an FMU's variables have in a diagram: their own, their aliases, and those that `ports:` gives them.

What `ports:` lists is gathered to one array, `pose: [px, py, theta]`; a range in braces stands for a list of names,
`u: "u_{1..3}"` for u_1, u_2, u_3, and two of them for a matrix.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import product
from math import prod
from typing import Any

from cosim.errors import UnknownPort, WrongShape, WrongValue, nearest
from cosim.fmu.ports import Port
from cosim.language.entry import BlockEntry
from cosim.language.source import Node

_MOST_NAMES = 100_000
_RANGE = re.compile(r"\{(\d+)\.\.(\d+)\}")


def named(ports: Mapping[str, Port], entry: BlockEntry, hidden: Mapping[str, str]) -> dict[str, Port]:
    """The ports by the names that an entry calls them; hidden: why other variables of the FMU are no ports.

    Raises: UnknownPort, WrongShape, WrongValue for names that collide.
    """
    found = _aliased(ports, entry)
    takers: dict[str, str] = {}  # by variable of the FMU
    made: dict[str, Port] = {}
    for ours, node in entry.ports.items():
        names = _expanded(node)
        leaves = [*_leaves(names)]
        unknown = next((leaf for leaf in leaves if leaf.value not in found), None)
        if unknown and node.inherited:  # written for another FMU
            continue
        if unknown:
            raise _unknown(entry, unknown, found, hidden)
        for leaf in leaves:
            if leaf.value in takers:
                message = f"block {entry.name}: `{takers[leaf.value]}` and `{ours}` name one variable, `{leaf.value}`"
                raise WrongValue(
                    message, leaf.position, "leave one of them out; wires go to as many ports as they like"
                )
            takers[leaf.value] = ours
        made[ours] = _gathered(ours, names, found, entry)
    _check_free(made, takers, found, entry)
    kept: dict[str, Port] = {}
    for name, port in found.items():  # in the FMU's order
        ours = takers.get(name, name)
        kept.setdefault(ours, made.get(ours, port))
    return kept


def _aliased(ports: Mapping[str, Port], entry: BlockEntry) -> dict[str, Port]:
    """The ports without those aliases of inputs and parameters that the entry does not use, as they are one thing.

    Raises: WrongValue where it uses two names of one.
    """
    used = {n: node for s in ("parameters", "start", "inputs") for n, node in getattr(entry, s).items()}
    used |= {leaf.value: leaf for node in entry.ports.values() for leaf in _leaves(_expanded(node))}
    families: dict[str, list[str]] = {}
    for name, port in ports.items():
        families.setdefault((port.first.alias or port.first).name, []).append(name)
    dropped: set[str] = set()
    for names in families.values():
        if ports[names[0]].causality not in ("parameter", "input"):
            continue
        chosen = [name for name in names if name in used] or names[:1]
        if len(chosen) > 1:
            message = f"block {entry.name}: `{chosen[0]}` and `{chosen[1]}` are two names of one variable"
            raise WrongValue(message, used[chosen[1]].place, "leave one of them out")
        dropped |= {*names} - {*chosen}
    return {name: port for name, port in ports.items() if name not in dropped}


def _expanded(node: Node) -> Node:
    """A node with every range in it as a list."""
    if isinstance(node.value, list):
        return replace(node, value=[_expanded(child) for child in node.value])
    match = _RANGE.search(node.value)
    if match is None:
        return node
    first, last = int(match[1]), int(match[2])
    if not first <= last < first + _MOST_NAMES:
        message = f"`{node.value}`: the range {first}..{last} is empty or too long"
        raise WrongValue(message, node.position, "write the smaller number first, such as {1..3}")
    names = [f"{node.value[: match.start()]}{k}{node.value[match.end() :]}" for k in range(first, last + 1)]
    return replace(node, value=[_expanded(replace(node, value=name)) for name in names])


def _leaves(node: Node) -> Iterator[Node]:
    if isinstance(node.value, list):
        for child in node.value:
            yield from _leaves(child)
    else:
        yield node


def _gathered(name: str, node: Node, ports: Mapping[str, Port], entry: BlockEntry) -> Port:
    """The port of a name or of nested lists of names. Raises: WrongShape, WrongValue where they do not go together."""
    if not isinstance(node.value, list):
        return replace(ports[node.value], name=name)
    parts = [_gathered(name, child, ports, entry) for child in node.value]
    first = parts[0]
    for child, part in zip(node.value, parts, strict=True):
        if part.shape != first.shape:
            message = f"block {entry.name}: `{name}` gathers shapes that differ, {first.shape} and {part.shape}"
            raise WrongShape(message, child.position, "gather variables of one shape")
        for kind in ("type", "causality", "variability"):
            one, other = getattr(first.first, kind), getattr(part.first, kind)
            if one != other:
                message = f"block {entry.name}: `{name}` gathers variables of two {_PLURALS[kind]}, {one} and {other}"
                raise WrongValue(message, child.position, "gather what is alike")
    members = tuple(member for part in parts for member in part.members)
    resized = any(part.resized for part in parts)
    return replace(first, members=members, shape=(len(parts), *first.shape), resized=resized)


_PLURALS = {"type": "types", "causality": "causalities", "variability": "variabilities"}


def _unknown(entry: BlockEntry, node: Node, ports: Mapping[str, Port], hidden: Mapping[str, str]) -> UnknownPort:
    if node.value in hidden:
        message = f"block {entry.name}: the variable `{node.value}` of `{entry.path.name}` {hidden[node.value]}"
        return UnknownPort(message, node.position, "it can be no port of a block")
    whole = next((port.name for port in ports.values() if any(node.value == m.name for m in port.members)), None)
    if whole is not None:
        message = f"block {entry.name}: the variable `{node.value}` is an element of `{whole}`, which is one array"
        return UnknownPort(message, node.position, f"name `{whole}`, with all its elements")
    message = f"block {entry.name}: `{entry.path.name}` has no variable `{node.value}`"
    return UnknownPort(message, node.position, nearest(node.value, ports))


def _check_free(made: Iterable[str], takers: Mapping[str, str], ports: Mapping[str, Port], entry: BlockEntry) -> None:
    """Raises: WrongValue for a name of ours that another variable of the FMU keeps."""
    for ours in made:
        if ours in ports and ours not in takers:
            theirs = ", ".join(f"`{name}`" for name, taker in takers.items() if taker == ours)
            message = (
                f"block {entry.name}: `{ours}` is to name {theirs}, but the FMU has a variable `{ours}` of its own"
            )
            raise WrongValue(message, entry.ports[ours].position, f"choose another name, or rename `{ours}` too")


def elsewhere(ports: Mapping[str, Port], description: Any) -> dict[str, str]:
    """What became of the FMU's variables that are ports by another name, or elements of them."""
    found: dict[str, str] = {}
    for name, port in ports.items():
        if len(port.members) > 1:
            axes = next(port.shape[:k] for k in range(len(port.shape) + 1) if prod(port.shape[:k]) == len(port.members))
            places = product(*(range(1, size + 1) for size in axes))
            for member, place in zip(port.members, places, strict=True):
                found[member.name] = f"is `{name}[{','.join(map(str, place))}]` here"
        elif port.first.name != name:
            found[port.first.name] = f"is called `{name}` here"
    for variable in description.modelVariables:
        if variable.alias is not None and variable.name not in ports:
            main = variable.alias.name
            found.setdefault(variable.name, f"is another name of `{main}`")
    return found
