"""The model structure: which inputs each output depends on, and which variables are the continuous states."""

from __future__ import annotations

from math import prod
from typing import Any

from cosim.errors import FmuError
from cosim.fmu import fields
from cosim.fmu.imported import Fmu


def read_structure(fmu: Fmu) -> None:
    """Find them for an FMU with its ports. Raises: FmuError."""
    description = fmu.description
    owner = _owners(fmu)
    fmu.inputs_of = dependencies(fmu, description.outputs)
    fmu.initial_inputs_of = dependencies(fmu, description.initialUnknowns)
    if fmu.kind != fields.MODEL_EXCHANGE:
        return
    fmu.indicators = _indicators(fmu)
    for unknown in description.derivatives:
        state = unknown.variable.derivative
        if state is None or id(state) not in owner:
            raise FmuError(f"nothing says which state `{unknown.variable.name}` is the derivative of")
        name, element = owner[id(state)]
        fmu.states += [(name, element + k) for k in range(fmu.ports[name].member_size)]
    for name in {name for name, _ in fmu.states}:
        if sum(other == name for other, _ in fmu.states) != fmu.ports[name].size:
            raise FmuError(f"only some elements of `{name}` are states")


def _indicators(fmu: Fmu) -> int:
    """How many event indicators there are, which FMI 3 lists."""
    sizes = {id(member): port.member_size for port in fmu.ports.values() for member in port.members}
    listed = [unknown.variable for unknown in fmu.description.eventIndicators]
    return sum(sizes.get(id(v), prod(v.shape)) for v in listed) or int(fmu.description.numberOfEventIndicators)


def _owners(fmu: Fmu) -> dict[int, tuple[str, int]]:
    """The port and the element that each of the FMU's variables begins at, by the variable's identity."""
    return {id(m): (name, k * port.member_size) for name, port in fmu.ports.items() for k, m in enumerate(port.members)}


def dependencies(fmu: Fmu, unknowns: Any) -> dict[str, frozenset[str] | None]:
    """For each port the input ports that it depends on; None where the description does not say."""
    owners: dict[int, list[str]] = {}  # aliases among them
    for name, port in fmu.ports.items():
        for member in port.members:
            owners.setdefault(id(member.alias or member), []).append(name)
    inputs = {name for name, port in fmu.ports.items() if port.causality == "input"}
    found: dict[str, frozenset[str] | None] = {}
    for unknown in unknowns:
        known = None
        if unknown.dependencies is not None:
            known = inputs & {name for d in unknown.dependencies for name in owners.get(id(d), ())}
        for name in owners.get(id(unknown.variable), ()):
            before = found.get(name, frozenset())
            found[name] = None if known is None or before is None else before | known
    return found
