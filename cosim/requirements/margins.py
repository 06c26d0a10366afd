"""Conditions of one instant as margins: positive where they hold, in the unit of what they compare.

A margin of zero says nothing of whether `<` or `<=` was written; so the smallest number there is stands for it, with
the sign of what holds.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from cosim.errors import WrongUnit
from cosim.language.formula_tree import Condition, Junction, Not, Predicate, Proposition
from cosim.requirements.terms import Array, Quantity, Samples, Scope, joined, quantity, taken

NO_MARGIN = 5e-324
"""What stands for a margin of zero."""


def margin(condition: Condition, scope: Scope) -> Quantity:
    """By how much a condition of one instant holds. Raises: as `quantity`."""
    match condition:
        case Predicate():
            return _predicate(condition, scope)
        case Proposition():
            return _truth(condition, scope)
        case Not(operand):
            inner = margin(operand, scope)
            return Quantity(inner.shape, inner.fleets, inner.unit, inner.label, lambda s: -inner.of(s))
        case Junction(every, operands, at):
            pick = np.minimum if every else np.maximum
            word = "and" if every else "or"
            return reduce(
                lambda a, b: joined(word, pick, *alike(a, b), scope, at), (margin(o, scope) for o in operands)
            )
    raise AssertionError(condition)


def alike(a: Quantity, b: Quantity) -> tuple[Quantity, Quantity]:
    """Two margins as they are if they have the same unit, else without one: each condition may have its own."""
    if a.label == b.label and a.unit == b.unit:
        return a, b
    return _bare(a), _bare(b)


def _bare(a: Quantity) -> Quantity:
    return Quantity(a.shape, a.fleets, None, "", a.of)


def _predicate(predicate: Predicate, scope: Scope) -> Quantity:
    a, b = quantity(predicate.left, scope), quantity(predicate.right, scope)
    low, high = (a, b) if predicate.sign.startswith("<") else (b, a)
    try:
        difference = joined("-", np.subtract, high, low, scope, predicate.at)
    except WrongUnit:
        message = f"`{predicate.sign}` compares {a.label or 'one unit'} with {b.label or 'another'}"
        raise WrongUnit(message, scope.place(predicate.at), "compare what has the same unit") from None
    at_zero = -NO_MARGIN if len(predicate.sign) == 1 else NO_MARGIN
    return Quantity(
        difference.shape,
        difference.fleets,
        difference.unit,
        difference.label,
        lambda samples: _signed(difference.of(samples), at_zero),
    )


def _signed(margins: Array, at_zero: float) -> Array:
    if np.all(margins):
        return margins
    return np.where(margins == 0.0, at_zero, margins)


def _truth(condition: Proposition, scope: Scope) -> Quantity:
    """True or false has no size: its margin is infinite."""
    mention = condition.signal
    seen = scope.look(mention.signal, scope.place(mention.at))
    if seen.dtype.kind != "b":
        message = f"`{mention.signal}` is a number, not true or false"
        raise scope.refused(message, mention.at, f"compare it, such as {mention.signal} < 1")
    took, shape, fleets = taken(seen, mention, scope)

    def of(samples: Samples) -> Array:
        return np.where(took(samples), np.inf, -np.inf)

    return Quantity(shape, fleets, None, "", of)
