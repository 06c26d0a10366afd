"""Terms of formulas as functions of samples, batch by batch, with their shapes and units."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from cosim.errors import FormulaError, Position, WrongUnit
from cosim.language import units
from cosim.language.formula import Place
from cosim.language.formula_tree import Mention, Number, Operation, Term
from cosim.language.units import BaseUnit
from cosim.requirements.folds import LARGEST, LENGTH, SMALLEST, TOTAL, fold, folded
from cosim.requirements.two_engines import kernel

Array = np.ndarray[Any, Any]
Samples = Mapping[Hashable, Array]
"""The samples (k, *shape) of signals."""


@dataclass(frozen=True)
class Seen:
    """A signal as formulas see it. key: in samples; fleets: of each axis, the fleet whose members it counts.

    index: what is taken of it before a formula takes more, numbers from 1.
    """

    key: Hashable
    shape: tuple[int, ...]
    fleets: tuple[str | None, ...]
    dtype: np.dtype[Any]
    unit: Any
    index: tuple[int, ...] = ()


Look = Callable[[str, Position | None], Seen]
"""Finds the signal of a text, named at a place. Raises: CosimError."""


@dataclass(frozen=True)
class Quantity:
    """A number along a run. of: samples -> (k, *shape).

    unit: None where nothing is known of it; label: the unit as it is written, "" where that is not known. constant: a
    number that the formula gives, which has the unit of what it is compared with.
    """

    shape: tuple[int, ...]
    fleets: tuple[str | None, ...]
    unit: BaseUnit | None
    label: str
    of: Callable[[Samples], Array]
    constant: bool = False


@dataclass(frozen=True)
class Scope:
    """What a formula's terms are read by. native: whether compiled code does what is dear."""

    look: Look
    place: Place
    native: bool = True

    def refused(self, message: str, at: int, fix: str = "") -> FormulaError:
        """The error of a part of the formula."""
        return FormulaError(message, self.place(at), fix)


def quantity(term: Term, scope: Scope) -> Quantity:
    """What a term is. Raises: FormulaError, WrongUnit, and what `look` raises, at the part's place."""
    match term:
        case Number(value):
            number = np.array(value)
            return Quantity((), (), None, "", lambda samples: number, True)
        case Mention():
            return signal(term, scope)
        case Operation(name, [argument], _) if name in _OVERALL:
            return _overall(name, argument, scope)
        case Operation(name, arguments, at):
            parts = [quantity(argument, scope) for argument in arguments]
            if name in ("max", "min") and len(parts) > 1:
                pick = np.maximum if name == "max" else np.minimum
                return reduce(lambda a, b: joined(name, pick, a, b, scope, at), parts)
            if name in _BINARY:
                return joined(name, _BINARY[name], parts[0], parts[1], scope, at)
            return _elementwise(name, parts[0], scope, at)
    raise AssertionError(term)


def signal(mention: Mention, scope: Scope) -> Quantity:
    """The samples of a signal as numbers, or of some of its elements. Raises: FormulaError, and what `look` raises."""
    seen = scope.look(mention.signal, scope.place(mention.at))
    if seen.dtype.kind == "b":
        message = f"`{mention.signal}` is true or false, and no number"
        raise scope.refused(message, mention.at, f"write {mention.signal} as a condition of its own")
    took, shape, fleets = taken(seen, mention, scope)
    unit = seen.unit
    if isinstance(unit, tuple):
        index = (*seen.index, *mention.index)
        unit = unit[index[-1] - 1] if not shape else unit[0] if len(set(unit)) == 1 else None
    known = units.base(unit) if unit is not None else None
    return Quantity(shape, fleets, known, unit or "", lambda samples: np.asarray(took(samples), np.float64))


def taken(
    seen: Seen, mention: Mention, scope: Scope
) -> tuple[Callable[[Samples], Array], tuple[int, ...], tuple[str | None, ...]]:
    """The samples that an index takes, with what is left of the shape. Raises: FormulaError."""
    index = (*seen.index, *mention.index)
    if len(index) > len(seen.shape):
        message = f"`{mention.signal}` has {len(seen.shape) or 'no'} axes, not {len(index)}"
        raise scope.refused(message, mention.at, "fewer numbers in the brackets" if seen.shape else "no brackets")
    for number, size in zip(index, seen.shape, strict=False):
        if number > size:
            message = f"`{mention.signal}` has {size} elements along an axis, so there is no {number}"
            raise scope.refused(message, mention.at, f"from 1 to {size}")
    where = (slice(None), *(number - 1 for number in index))
    return lambda samples: samples[seen.key][where], seen.shape[len(index) :], seen.fleets[len(index) :]


def joined(name: str, function: Any, a: Quantity, b: Quantity, scope: Scope, at: int) -> Quantity:
    """Two quantities as one, element by element; one with fewer axes is the same along those it lacks.

    Raises: FormulaError for shapes that do not fit, WrongUnit.
    """
    short, long = sorted((a.shape, b.shape), key=len)
    if long[: len(short)] != short:
        message = f"`{name}` joins shapes {a.shape} and {b.shape}"
        raise scope.refused(message, at, "take max, min, sum or norm of one, or an element such as plant.x[1]")
    if other := next(
        ((one, two) for one, two in zip(a.fleets, b.fleets, strict=False) if one and two and one != two), None
    ):
        message = f"`{name}` joins members of {other[0]} with those of {other[1]}"
        raise scope.refused(message, at, "take max, min or an element of one, such as plant.x[1]")
    left, right = spreader(a.shape, long), spreader(b.shape, long)
    unit, label = _unit(name, a, b, scope, at)
    fleets = a.fleets if a.shape == long else b.fleets
    constant = a.constant and b.constant
    return Quantity(
        long, fleets, unit, label, lambda samples: function(left(a.of(samples)), right(b.of(samples))), constant
    )


def spreader(shape: tuple[int, ...], whole: tuple[int, ...]) -> Callable[[Array], Array]:
    """What gives samples (k, *shape) the axes that `whole` has behind them."""
    if shape == whole:
        return lambda samples: samples
    more = (1,) * (len(whole) - len(shape))
    return lambda samples: np.reshape(samples, (*np.shape(samples), *more)) if np.ndim(samples) else samples


def _unit(name: str, a: Quantity, b: Quantity, scope: Scope, at: int) -> tuple[BaseUnit | None, str]:
    """The unit of two quantities' operation; numbers have that of what they are added to. Raises: WrongUnit."""
    if name in ("*", "/"):
        if b.constant or (a.constant and name == "*"):
            kept = a if b.constant else b
            return kept.unit, kept.label
        if a.unit is None or b.unit is None:
            return None, ""
        return a.unit.times(b.unit, 1 if name == "*" else -1), ""
    if name == "**":
        return None, ""
    if a.unit is not None and b.unit is not None and not _same(a.unit, b.unit):
        message = f"`{name}` between {a.label or 'one unit'} and {b.label or 'another'}"
        raise WrongUnit(message, scope.place(at), "compare and add what has the same unit")
    if name == "atan2":
        return None, ""
    known = a if a.unit is not None else b
    return known.unit, known.label


def _same(a: BaseUnit, b: BaseUnit) -> bool:
    return a.exponents == b.exponents and math.isclose(a.factor, b.factor, rel_tol=1e-12) and a.offset == b.offset


def _elementwise(name: str, a: Quantity, scope: Scope, at: int) -> Quantity:
    function = _UNARY[name]
    if name in _OF_ANGLES and a.unit not in (None, BaseUnit(), units.base("rad")):
        message = f"`{name}` of {a.label or 'what is no angle'}"
        raise WrongUnit(message, scope.place(at), "it takes radians: multiply by a block, or its FMU's unit")
    kept = name in ("abs", "negative")
    of = a.of
    unit, label = (a.unit, a.label) if kept else (None, "")
    return Quantity(a.shape, a.fleets, unit, label, lambda samples: function(of(samples)), a.constant)


def _overall(name: str, argument: Term, scope: Scope) -> Quantity:
    """All elements as one number; `norm`: those of each member."""
    whole = quantity(argument, scope)
    members = name == "norm" and len(whole.shape) > 0 and whole.fleets[0] is not None
    left = 1 if members else 0
    if len(whole.shape) == left:
        return whole if name != "norm" else replace(whole, of=lambda samples: np.abs(whole.of(samples)))
    of, sizes = whole.of, False
    match argument:
        case Operation("abs", [inner], _) if name in ("max", "min"):  # in the same pass
            of, sizes = quantity(inner, scope).of, True
    function, kind, count = kernel(fold, scope.native), _OVERALL[name], math.prod(whole.shape[left:])

    def overall(samples: Samples) -> Array:
        found = folded(function, kind, of(samples), left, sizes)
        return found / count if name == "mean" else found

    return Quantity(whole.shape[:left], whole.fleets[:left], whole.unit, whole.label, overall)


_BINARY: dict[str, Any] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
    "atan2": np.arctan2,
}
_UNARY: dict[str, Any] = {
    "negative": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
}
_OF_ANGLES = ("sin", "cos", "tan")
_OVERALL = {"max": LARGEST, "min": SMALLEST, "sum": TOTAL, "mean": TOTAL, "norm": LENGTH}
