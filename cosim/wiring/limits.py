"""Whether values keep the limits that their variables declare; and whether what is declared fits the sizes found."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cosim.authoring.variables import Numbers, Variable, spread
from cosim.errors import DeclarationError, Position, WrongValue
from cosim.wiring.network import Component

_LISTED = ("unit", "display", "nominal", "min", "max")


def misfits(component: Component) -> Iterator[DeclarationError]:
    """What is declared for each element of an axis that turns out to have more or fewer of them."""
    for variable in component.declaration.variables.values():
        for key in _LISTED:
            given = getattr(variable, key)
            if isinstance(given, tuple) and len(given) != (size := component.shape(variable)[0]):
                what = f"`{key}` of `{variable.name}` has {len(given)} entries for {size} elements"
                message = f"block {component.name}: {what}"
                fix = f"in {component.declaration.name}, write one for each, or one for all"
                yield DeclarationError(message, component.entry.position, fix)


def check(component: Component, variable: Variable, values: np.ndarray, position: Position | None) -> None:
    """Raises: WrongValue for the first value (of instances or 1, *shape) beyond a limit."""
    started = {name for function in component.declaration.kind("start") for name in function.writes}
    if variable.name in started - component.given:
        return  # a start function computes it, so its default is never used
    own = component.shape(variable)
    for limit, word, is_beyond in (
        (variable.min, "below its minimum", np.less),
        (variable.max, "above its maximum", np.greater),
    ):
        bounds = spread(limit, own, variable.dtype)
        if bounds is None:
            continue
        beyond = np.argwhere(is_beyond(values, bounds) | np.isnan(values))
        if len(beyond):
            first = tuple(int(k) for k in beyond[0])
            member = f" of {component.fleet} {first[0] + 1}" if component.fleet and len(values) > 1 else ""
            element = f"[{','.join(str(k + 1) for k in first[1:])}]" if own else ""
            message = f"block {component.name}: `{variable.name}{element}`{member} is {values[first]:g}, {word}"
            raise WrongValue(f"{message}, {bounds[first[1:]]:g}", position, f"give a number {words(variable)}")


def words(variable: Variable) -> str:
    """The limits in words, with the unit where there is one; "" where there are no limits."""
    unit = f" {variable.unit}" if isinstance(variable.unit, str) and variable.unit != "1" else ""
    low, high = text(variable.min), text(variable.max)
    if not high:
        return f"from {low}{unit} on" if low else ""
    return f"from {low} to {high}{unit}" if low else f"up to {high}{unit}"


def text(numbers: Numbers) -> str:
    """A limit or a nominal value as a person writes it; "" where there is none."""
    if numbers is None:
        return ""
    return f"({', '.join(f'{n:g}' for n in numbers)})" if isinstance(numbers, tuple) else f"{numbers:g}"
