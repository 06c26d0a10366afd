"""Whether what comes over each wire is what its input takes: by name, by unit and by data type."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.authoring.variables import Unit
from cosim.errors import NotWirable, Problems, WrongDataType, WrongUnit
from cosim.language import units
from cosim.wiring.network import Axis, Component, Signal

Components = Mapping[str, Component]


def check(components: Components, problems: Problems) -> None:
    """A NotWirable, WrongUnit or WrongDataType for each source that an input does not take."""
    for component in components.values():
        for port, sources in component.wires.items():
            joined = 0  # members before this source
            for source in sources:
                if source.variable:
                    problems.attempt(_check, components, component, port, source, joined)
                    joined += _length(components, source)


def _check(components: Components, component: Component, port: str, source: Signal, joined: int) -> None:
    here = component.declaration.variables[port]
    there = components[source.component].declaration.variables[source.variable]
    position = component.entry.inputs[port].position
    only = getattr(here, "only", "")
    if only and source.variable.rpartition(".")[2] != only:  # an FMU's port may say whose it is
        message = f"block {component.name}: input `{port}` takes ports called `{only}` and nothing else, not {source}"
        taps = {n: s.declaration.variables.get(only) for n, s in components.items()}
        wanted = [f"{n}.{only}" for n, variable in taps.items() if variable and variable.causality != "input"]
        raise NotWirable(message, position, f"wire {' or '.join(wanted) or f'a port of the name `{only}`'}")
    taken, given = _unit_taken(components, component, port, source, joined), _unit_given(components, source)
    if not units.same(taken, given):
        message = f"block {component.name}: input `{port}` is in {_text(taken)}, but {source} is in {_text(given)}"
        raise WrongUnit(message, position, "wire a signal in that unit, or put a gain between")
    if here.dtype != there.dtype:
        message = f"block {component.name}: input `{port}` is {here.dtype}, but {source} is {there.dtype}"
        fix = "wire a signal of that data type"
        if component.entry.kind == "expression" and here.dtype == bool:
            fix = f"write a comparison in the expression, such as {port} > 0"
        elif component.entry.kind == "expression" and there.dtype == bool:
            fix = f"write if({port}, 1, 0) in the expression"
        raise WrongDataType(message, position, fix)


def _unit_given(components: Components, source: Signal) -> Unit:
    """The unit of what is taken of a variable: its units are of its first axis, its members perhaps a fleet's."""
    there = components[source.component]
    unit = there.declaration.variables[source.variable].unit
    if not isinstance(unit, tuple) or source.members is None or there.fleet:
        return unit
    last = source.members if isinstance(source.members, int) else source.members[1]
    return unit[source.first : last]


def _unit_taken(components: Components, component: Component, port: str, source: Signal, joined: int) -> Unit:
    """The unit of what a source brings of an input, whose first axis several may fill one after the other."""
    variable, sources = component.declaration.variables[port], component.wires[port]
    along = max(1, *(len(_axes(components, s)) for s in sources)) == len(variable.shape)  # tuples: no open dimension
    if isinstance(variable.unit, tuple) and len(sources) > 1 and along:
        return variable.unit[joined : joined + _length(components, source)]
    return variable.unit


def _length(components: Components, source: Signal) -> int:
    """How many members a source adds to those that are joined before it."""
    axes = _axes(components, source)
    return axes[0].size if axes else 1


def _axes(components: Components, source: Signal) -> tuple[Axis, ...]:
    """The axes of what is taken of a variable; none where they are not known."""
    there = components[source.component]
    axes = there.signal_axes(there.declaration.variables[source.variable]) if source.variable else None
    return source.axes(axes) if axes else ()


def _text(unit: Unit) -> str:
    one = unit[0] if isinstance(unit, tuple) and len(unit) == 1 else unit
    return "(" + ", ".join(one) + ")" if isinstance(one, tuple) else str(one)
