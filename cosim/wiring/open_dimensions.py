"""What an open dimension of a variable, such as ``"n?"``, is in a diagram: no axis, one, or several.

What is wired to an input says it first, then what is given; where neither does, there is none, and the variable is a
scalar. All variables of a block that name the dimension have the same axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from cosim.authoring.variables import OpenDimension, Variable
from cosim.wiring.network import Axis, Component
from cosim.wiring.widths import follows, widen


def open_dimension(variable: Variable) -> OpenDimension | None:
    """The open dimension of a variable, of which it has one at most."""
    return next((d for d in variable.shape if isinstance(d, OpenDimension)), None)


def is_unknown(component: Component, variable: Variable) -> bool:
    """Whether a variable has an open dimension of which nothing is known yet."""
    name = open_dimension(variable)
    return name is not None and name not in component.axes


def learn(component: Component, variable: Variable, axes: tuple[Axis, ...]) -> None:
    """Take the axes of a variable that are left beside its other dimensions for its open one, unless that is known."""
    name, others = open_dimension(variable), len(variable.shape) - 1
    if name is None or len(axes) < others:
        return
    first = variable.shape.index(name)
    own = axes[first : len(axes) - others + first]
    whole = Axis(math.prod(axis.size for axis in own), next((axis.fleet for axis in own if axis.fleet), None))
    known = component.opened.get(name)
    if known is None:
        fits = name not in component.axes or component.axes[name].size == whole.size
    else:
        fits = [axis.size for axis in known] == [axis.size for axis in own] and not any(axis.fleet for axis in known)
    if fits:
        component.axes[name], component.opened[name] = whole, own


def spelled_out(component: Component, variable: Variable) -> tuple[int | str, ...]:
    """The dimensions of a variable, axis by axis: sizes for an open one that is known."""
    if open_dimension(variable) is None:
        return variable.shape
    found: list[int | str] = []
    for dimension in variable.shape:
        if isinstance(dimension, OpenDimension) and dimension in component.axes:
            found += [axis.size for axis in component.axes_of(dimension)]
        else:
            found.append(dimension)
    return tuple(found)


def shape_text(component: Component, variable: Variable) -> str:
    """The shape of a variable, as far as it is known, such as `(n = 3, 2)`."""
    texts = []
    for dimension in variable.shape:
        if isinstance(dimension, OpenDimension) and dimension in component.axes:
            texts += [f"{dimension} = {axis.size}" for axis in component.axes_of(dimension)]
        else:
            known = component.axes.get(dimension) if isinstance(dimension, str) else None
            texts.append(f"{dimension} = {known.size}" if known else str(dimension))
    return f"({', '.join(texts)})"


def is_waiting(component: Component) -> bool:
    """Whether wires will say what an open dimension of a component is."""
    return any(is_unknown(component, component.declaration.variables[port]) for port in component.wires)


def close_known(components: Mapping[str, Component]) -> bool:
    """Let open dimensions be none that nothing can say any more; whether there were any."""
    ready = [c for c in components.values() if _has_unknown(c) and _is_ready(components, c)]
    for component in ready:
        _close(component)
    return bool(ready)


def close_one(components: Mapping[str, Component]) -> bool:
    """Let the open dimensions of one block in a ring be none, if nothing else is missing; whether there was one."""
    waiting = next((c for c in components.values() if _has_unknown(c)), None)
    if waiting is None or _others_missing(components):
        return False
    _close(waiting)
    return True


def _close(component: Component) -> None:
    for variable in component.declaration.variables.values():
        if is_unknown(component, variable) and not follows(component, variable):
            name = str(open_dimension(variable))
            component.axes[name], component.opened[name] = Axis(1), ()
    while widen(component):
        pass


def _has_unknown(component: Component) -> bool:
    return any(is_unknown(component, variable) for variable in component.declaration.variables.values())


def _is_ready(components: Mapping[str, Component], component: Component) -> bool:
    """Whether all that is wired to a component is known."""
    sources = [source for wires in component.wires.values() for source in wires]
    return all(source.variable and _is_known(components[source.component], source.variable) for source in sources)


def _is_known(component: Component, name: str) -> bool:
    return component.signal_axes(component.declaration.variables[name]) is not None


def _others_missing(components: Mapping[str, Component]) -> bool:
    """Whether dimensions that are not open, or sources of wires, are missing, from which more might be learnt."""
    for component in components.values():
        opened = {open_dimension(v) for v in component.declaration.variables.values()}
        if set(component.declaration.dimension_names()) - opened - component.axes.keys():
            return True
        if any(not source.variable for wires in component.wires.values() for source in wires):
            return True
    return False
