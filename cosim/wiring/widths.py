"""Open dimensions that have the axes of the widest of several others: scalars serve all elements of what is wider."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.authoring.variables import OpenDimension, Variable
from cosim.errors import Problems, WrongShape
from cosim.wiring.network import Component


def widen(component: Component) -> bool:
    """Give such dimensions their axes, as soon as one of several elements is known, or all are; whether it did."""
    before = len(component.axes)
    for name, dimension in component.declaration.dimensions.items():
        known = [other for other in dimension.widest if other in component.axes]
        if not known or name in component.axes:
            continue
        widest = max(known, key=lambda other: _width(component, other))
        if _several(component, widest) or len(known) == len(dimension.widest):
            component.axes[name] = component.axes[widest]
            component.opened[name] = component.axes_of(OpenDimension(widest))
    return len(component.axes) > before


def follows(component: Component, variable: Variable) -> bool:
    """Whether a variable has such a dimension."""
    dimensions = component.declaration.dimensions
    return any(d in dimensions and bool(dimensions[str(d)].widest) for d in variable.shape)


def report(components: Mapping[str, Component], problems: Problems) -> None:
    """A WrongShape for what has several elements, and others than what it is combined with."""
    for component in components.values():
        variables = {d: v for v in component.declaration.variables.values() for d in v.shape}
        for dimension in component.declaration.dimensions.values():
            wide = [d for d in dimension.widest if d in component.axes and _several(component, d)]
            shapes = {d: component.shape(variables[d]) for d in wide}
            for other in (d for d in wide[1:] if shapes[d] != shapes[wide[0]]):
                problems.add(_mismatch(component, variables[other], shapes[other], variables[wide[0]], shapes[wide[0]]))


def _mismatch(
    component: Component, variable: Variable, shape: tuple[int, ...], first: Variable, needed: tuple[int, ...]
) -> WrongShape:
    entry = component.entry
    given = {**entry.start, **entry.parameters, **entry.inputs}
    place = given[variable.name].position if variable.name in given else entry.position
    what = f"`{variable.name}` has the shape {_text(shape)}, and `{first.name}` {_text(needed)}"
    fix = "an expression is computed element by element: give both one shape, or one of them one element"
    return WrongShape(f"block {component.name}: {what}", place, fix)


def _several(component: Component, name: str) -> bool:
    return component.axes[name].size > 1


def _width(component: Component, name: str) -> tuple[int, int, bool]:
    axes = component.axes_of(OpenDimension(name))
    return component.axes[name].size, len(axes), any(axis.fleet for axis in axes)


def _text(shape: tuple[int, ...]) -> str:
    return f"({', '.join(map(str, shape))})"
