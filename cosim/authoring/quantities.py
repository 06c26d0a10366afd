"""What is wrong with the units, nominal values, limits and names of components that a variable is declared with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from cosim.authoring.variables import OpenDimension
from cosim.errors import WrongUnit
from cosim.language import units


def mistakes(name: str, variable: Any) -> Iterator[tuple[str, str]]:
    """What is wrong, and the usual fix."""
    if said := _unit(variable.unit, variable.shape):
        yield f"the unit of `{name}`: {said[0]}", said[1]
    elif said := _display(variable):
        yield f"the display unit of `{name}`: {said[0]}", said[1]
    if said := _components(variable.components, variable.shape):
        yield f"the components of `{name}`: {said[0]}", said[1]
    wrong = False
    for key in ("nominal", "min", "max"):
        if said := _numbers(key, getattr(variable, key), variable):
            wrong = True
            yield f"`{key}` of `{name}`: {said[0]}", said[1]
    if not wrong and (pair := _crossed(variable)):
        yield f"`min` of `{name}`, {pair[0]:g}, is above its `max`, {pair[1]:g}", "exchange them"


def _unit(unit: Any, shape: tuple[Any, ...]) -> tuple[str, str] | None:
    """What is wrong with the unit, or the units along the first axis, of a variable of a shape."""
    parts = unit if isinstance(unit, tuple) else () if unit is None else (unit,)
    if not all(isinstance(part, str) for part in parts):
        what = f"{unit!r} is neither a text nor a tuple of texts"
        return what, 'write such as unit="m/s", or unit=("m", "rad") for the elements of the first axis'
    try:
        for part in parts:
            units.base(part)
    except WrongUnit as error:
        return error.message, error.fix or 'such as "m/s2", "kg.m2" or "1" for none'
    return _count(unit, shape, "units", "write one unit, as a text")


def _display(variable: Any) -> tuple[str, str] | None:
    if variable.display is None:
        return None
    if said := _unit(variable.display, variable.shape):
        return said
    if variable.unit is None:
        return "there is no unit that it could stand for", 'write unit="…" too'
    for shown, own in _pairs(variable.display, variable.unit):
        if units.base(shown).exponents != units.base(own).exponents:
            return f"`{shown}` is of another dimension than `{own}`", "such as deg for rad, or mm for m"
    return None


def _components(names: Any, shape: tuple[Any, ...]) -> tuple[str, str] | None:
    """What is wrong with the names of the elements of the first axis."""
    fix = 'write such as components=("x", "y") for the elements of the first axis'
    if not isinstance(names, tuple) or not all(isinstance(n, str) and n.strip() and "," not in n for n in names):
        return f"{names!r} is no tuple of names without commas", fix
    if len(set(names)) < len(names):
        return f"{names!r} has a name twice", "name each once"
    said = _count(names, shape, "names", fix) if names else None
    return (said[0], fix) if said else None


def _numbers(key: str, given: Any, variable: Any) -> tuple[str, str] | None:
    """What is wrong with a nominal value or a limit."""
    if given is None:
        return None
    parts = given if isinstance(given, tuple) else (given,)
    if variable.dtype.kind == "b" or (key == "nominal" and variable.dtype.kind != "f"):
        return f"a variable of the type {variable.dtype} has none", "leave it out"
    for part in parts:
        if isinstance(part, bool) or not isinstance(part, int | float) or not math.isfinite(part):
            what = f"{part!r} is no finite number"
            return what, f"write such as {key}=2.5, or {key}=(1.0, 0.1) for the elements of the first axis"
        if key == "nominal" and part <= 0:
            return f"{part:g} is not above 0", "give the usual size of its values"
        if variable.dtype.kind in "iu":
            least, most = np.iinfo(variable.dtype).min, np.iinfo(variable.dtype).max
            if part != int(part) or not least <= part <= most:
                return f"{part:g} is no {variable.dtype}", f"give a whole number from {least} to {most}"
    return _count(given, variable.shape, "numbers", "write one number")


def _count(given: Any, shape: tuple[Any, ...], words: str, fix: str) -> tuple[str, str] | None:
    """What is wrong with how many there are of something that may be a tuple."""
    if not isinstance(given, tuple):
        return None
    if not shape:
        return f"{given!r} are {words} for several elements of a scalar", fix
    if isinstance(shape[0], OpenDimension):
        return f"{given!r} are {words} along an axis that there may not be, as `{shape[0]}?` is open", fix
    if not given or (isinstance(shape[0], int) and len(given) != shape[0]):
        what = f"{len(given)} {words} for the {shape[0]} elements of the first axis"
        return what, "write one for each, or one for all"
    return None


def _pairs(one: Any, other: Any) -> Iterator[tuple[Any, Any]]:
    """What two values that may be tuples say of the same element."""
    many, others = (value if isinstance(value, tuple) else None for value in (one, other))
    size = len(many or others or (one,))
    yield from zip(many or (one,) * size, others or (other,) * size, strict=False)


def _crossed(variable: Any) -> tuple[float, float] | None:
    """The first pair of limits of which the lower is above the upper."""
    if variable.min is None or variable.max is None:
        return None
    return next(((low, high) for low, high in _pairs(variable.min, variable.max) if low > high), None)
