"""A component's parameters and start values: what the diagram gives, defaults for the rest, and both as arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cosim.authoring.variables import Input, Parameter, Period, State, Variable
from cosim.errors import CosimError, MissingParameter, UnknownParameter, WrongValue
from cosim.language.source import Node
from cosim.language.values import Value
from cosim.wiring import limits, meaning
from cosim.wiring.draft import Draft
from cosim.wiring.network import Component

MANY = 16
"""Members of a fleet from which on all values are computed at once, which is slower for a few."""


def take(draft: Draft, component: Component) -> None:
    """Match an entry's parameters and start values with the declaration, and take defaults for the rest."""
    declaration, entry = component.declaration, component.entry
    parameters = {v.name: v for v in declaration.of(Parameter)}
    starts = {v.name: v for v in (*declaration.startable(), *declaration.guessable())}
    _take_given(draft, component, entry.parameters, parameters, "parameter")
    _take_given(draft, component, entry.start, starts, "state or input to start")
    constants = {name: node for name, node in entry.constants.items() if isinstance(starts.get(name), Input)}
    _take_given(draft, component, constants, starts, "input")
    for variable in (*parameters.values(), *starts.values()):
        if variable.name not in component.given:
            _take_default(draft, component, variable)


def _take_given(
    draft: Draft, component: Component, given: Mapping[str, Node], known: Mapping[str, Variable], kind: str
) -> None:
    for name, node in given.items():
        if name in known:
            component.given.add(name)
            value = draft.problems.attempt(Value.read, node, f"{component.name}.{name}")
            if value is not None:
                draft.values[component.name, name] = value
        else:
            message = f"block {component.name}: {component.declaration.name} has no {kind} `{name}`"
            fix = meaning.usual_fix(component.declaration, name, known)
            draft.problems.add(UnknownParameter(message, node.key_position, fix))


def _take_default(draft: Draft, component: Component, variable: Variable) -> None:
    if variable.start is not None:
        draft.values[component.name, variable.name] = Value.of(variable.start, component.entry.position)
    elif isinstance(variable, Parameter) and variable.name not in component.entry.mistaken:
        name = component.declaration.name
        message = f"block {component.name}: parameter `{variable.name}` of {name} has no value"
        fix = f"add `{variable.name}:` under blocks.{component.name}.parameters"
        draft.problems.add(MissingParameter(message, component.entry.position, fix))


def evaluate(draft: Draft) -> None:
    """Every value of the components whose sizes are known, as an array (instances or 1, *shape)."""
    for component in draft.components.values():
        declaration = component.declaration
        axes = [component.signal_axes(variable) for variable in declaration.variables.values()]
        if any(found is None or any(axis.size < (not declaration.foreign) for axis in found) for found in axes):
            continue  # told elsewhere
        if component.clock:
            own = np.array([float(component.clock.period)])
            component.values.update((period.name, own) for period in declaration.of(Period))
        misfits = list(limits.misfits(component))
        for misfit in misfits:
            draft.problems.add(misfit)
        for variable in (*declaration.of(Parameter), *declaration.startable(), *declaration.guessable()):
            value = draft.values.get((component.name, variable.name))
            if value is not None and not misfits:
                _evaluate(draft, component, variable, value)


def _evaluate(draft: Draft, component: Component, variable: Variable, value: Value) -> None:
    numbers = draft.problems.attempt(_numbers, component, variable, value, draft.diagram.fleets)
    if numbers is None:
        return
    component.values[variable.name] = numbers
    if isinstance(variable, State) and variable.finite and numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
        message = f"block {component.name}: state `{variable.name}` starts as {numbers[~np.isfinite(numbers)][0]}"
        draft.problems.add(WrongValue(message, value.position, "give a number below 1e100"))


def _numbers(component: Component, variable: Variable, value: Value, fleets: Mapping[str, int]) -> np.ndarray:
    """The array of a value; what is wrong with a default says whose it is. Raises: ExpressionError, WrongValue."""
    try:
        return array(component, variable, value, fleets)
    except CosimError as error:
        if variable.name in component.given:
            raise
        block = f"block {component.name}: "
        message = f"{block}the default of `{variable.name}`: {error.message.removeprefix(block)}"
        raise type(error)(message, error.position, error.fix) from None


def array(component: Component, variable: Variable, value: Value, fleets: Mapping[str, int]) -> np.ndarray:
    """A value as an array (instances or 1, *shape), each member's expressions evaluated with its number i.

    Raises: ExpressionError, WrongValue, also where it is beyond a limit.
    """
    read = value.with_items(variable.items) if variable.items else value
    numbers = _array(component, variable, read, fleets)
    if variable.items:
        _check_items(variable, value, numbers)
    limits.check(component, variable, numbers, value.position)
    return numbers


def _check_items(variable: Variable, value: Value, numbers: np.ndarray) -> None:
    """Raises: WrongValue for a number that no item of an enumeration has."""
    known = [*variable.items.values(), *np.ravel([] if variable.start is None else variable.start)]
    wrong = numbers[~np.isin(numbers, known)]
    if wrong.size:
        items = ", ".join(f"{name} = {number}" for name, number in variable.items.items())
        raise WrongValue(f"no item of `{variable.name}` is {wrong[0]}", value.position, f"one of: {items}")


def _array(component: Component, variable: Variable, value: Value, fleets: Mapping[str, int]) -> np.ndarray:
    shape = component.shape(variable)
    if component.fleet:
        members = _members(variable, value, component.count, shape)
        return (
            value.array(shape, variable.dtype, {"i": 1.0, "N": float(component.count)})[None]
            if members is None
            else members
        )
    own = component.own_axes(variable)
    if own and own[0].fleet:
        members = _members(variable, value, shape[0], shape[1:])
        if members is None:
            members = np.broadcast_to(value.array(shape[1:], variable.dtype, {"i": 1.0, "N": float(shape[0])}), shape)
        return members[None]
    size = {"N": float(next(iter(fleets.values())))} if len(fleets) == 1 else {}
    return value.array(shape, variable.dtype, size)[None]


def _members(variable: Variable, value: Value, count: int, shape: tuple[int, ...]) -> np.ndarray | None:
    """A value for each member of a fleet (count, *shape); None where all have the same one."""
    per_member = len(value.shape) == len(shape) + 1
    if not per_member and (variable.dtype.hasobject or not value.uses("i")):
        return None
    if per_member and isinstance(value.content, np.ndarray) and value.content.dtype == variable.dtype == np.float64:
        return np.broadcast_to(value.content, (count, *shape)).copy()
    if not per_member and count >= MANY and (found := value.of_members(shape, variable.dtype, count)) is not None:
        return found
    array = np.empty((count, *shape), variable.dtype)
    for k in range(count):
        row = value.member(k) if per_member else value
        array[k] = row.array(shape, variable.dtype, {"i": k + 1.0, "N": float(count)})
    return array
