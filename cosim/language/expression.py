"""Arithmetic in diagrams, such as "2*pi*i/N", read by `cosim.language.expression_tree`, as a number.

All numbers are floats, so that no power is dear: one that is too large is refused in no time.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from cosim.errors import ExpressionError, Position, nearest
from cosim.language import elementary, expression_tree
from cosim.language.elementary import FUNCTIONS
from cosim.language.expression_tree import Applied, Expression, Literal, Name
from cosim.language.misreadings import shown

CONSTANTS = {"pi": math.pi, "e": math.e, "inf": math.inf}
OF_A_FLEET = {"i": "the number of a fleet's member", "N": "the size of a fleet"}
OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "//": operator.floordiv,
    "%": operator.mod,
    "**": operator.pow,
    "neg": operator.neg,
    "below": elementary.below,
    "at most": elementary.at_most,
    "equal": elementary.equal,
    "both": elementary.both,
    "either": elementary.either,
    "opposite": elementary.opposite,
    "if": elementary.chosen,
    **{name: function.python for name, function in FUNCTIONS.items()},
}
"""What each operation of an expression is, as an author would write it in a block."""
VALUES: dict[str, Callable[..., Any]] = {
    **OPERATIONS,
    **{name: elementary.plain(name) for name in elementary.PLAIN},
    "**": elementary.plain("pow", "the power", elementary.NotRealError),
    "sqrt": elementary.root,
}
"""What each operation makes of numbers: the same bits as in blocks, and on every system. Some of them take arrays."""
_SHORT = 20
"""Operations, each with the one before as its first operand, up to which functions call each other."""
_DECIDED = {"both": 0.0, "either": 1.0}
"""The first truth value that leaves the second without effect."""

Names = Mapping[str, Any]
Evaluator = Callable[[Names], Any]


def evaluate(text: str, names: Names | None = None, position: Position | None = None) -> float:
    """The value of an arithmetic expression over constants, functions and the given names (which win over constants).

    Raises: ExpressionError, at the given position.
    """
    try:
        value = _read(text)(names or {})
        if math.isnan(value):
            raise elementary.NotRealError
        if math.isinf(value) and "inf" not in text:
            raise ExpressionError(f"`{shown(text)}` is too large for a number", fix="at most 1.7e308, or `inf`")
    except ExpressionError as error:
        raise ExpressionError(error.message, position, error.fix) from None
    except elementary.NotRealError:
        fix = "take even roots of positive numbers only"
        raise ExpressionError(f"`{shown(text)}` is not a real number", position, fix) from None
    except (ArithmeticError, TypeError, ValueError, RecursionError) as error:
        raise ExpressionError(f"`{shown(text)}` cannot be evaluated: {error}", position, "check its values") from None
    return float(value)


def of_members(text: str, count: int) -> np.ndarray | None:
    """An expression's values (count,) for all members of a fleet at once; None where it has to be `evaluate` for each.

    Where one has no value, or an operation takes no arrays, that is to be seen, and said, one by one.
    """
    fleet = {"i": np.arange(1.0, count + 1.0), "N": float(count)}
    try:
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            values = np.broadcast_to(_read(text)(fleet), (count,))
    except (ArithmeticError, TypeError, ValueError, RecursionError, ExpressionError):
        return None
    return values if values.dtype == np.float64 and np.isfinite(values).all() else None


def names(text: str) -> frozenset[str]:
    """The names that an expression uses, functions and constants among them; none if it cannot be read."""
    return expression_tree.words(text)


def check(text: str, known: Iterable[str]) -> None:
    """See that a text is an expression of the known names. Raises: ExpressionError."""
    _read(text)
    for name in sorted(names(text) - {*known, *CONSTANTS, *FUNCTIONS}):
        raise _unknown(name, text, known)


def is_arithmetic(text: str) -> bool:
    """Whether a text is an expression, perhaps in the number of a fleet's member."""
    try:
        check(text, OF_A_FLEET)
    except ExpressionError:
        return False
    return True


@lru_cache(maxsize=4096)
def _read(text: str) -> Evaluator:
    """The function of the names that an expression is: read once, evaluated for each member of a fleet.

    Raises: ExpressionError.
    """
    found = expression_tree.read(text)
    if expression_tree.is_truth(found):
        raise ExpressionError(f"`{shown(text)}` is a truth value, not a number", fix="write if(condition, 1, 0)")
    return _build(found, text)


def _build(part: Expression, text: str) -> Evaluator:
    if isinstance(part, Literal):
        constant = part.value
        return lambda names: constant
    if isinstance(part, Name):
        name = part.name
        if part.truth:
            what = f"`{name}` in `{shown(text)}` is a number where a condition stands"
            raise ExpressionError(what, fix="compare it with another, such as `> 0`")
        return lambda names: _value(name, names, text)
    if part.operation == "if":
        condition, one, other = (_build(operand, text) for operand in part.operands)
        return lambda names: _chosen(condition(names), one, other, names)
    return _chain(part, text)


def _chosen(condition: Any, one: Evaluator, other: Evaluator, names: Names) -> Any:
    """What a condition chooses; nothing else is evaluated."""
    return condition if math.isnan(condition) else (one if condition else other)(names)


def _chain(part: Applied, text: str) -> Evaluator:
    """An operation whose first operand may be one too, and so on: a long sum is no deep recursion."""
    links: list[tuple[str, list[Evaluator]]] = []
    first: Expression = part
    while isinstance(first, Applied) and first.operation != "if":
        links.append((first.operation, [_build(operand, text) for operand in first.operands[1:]]))
        first = first.operands[0]
    begin = _build(first, text)
    if len(links) <= _SHORT:
        for operation, others in reversed(links):
            begin = _applied(operation, begin, others)
        return begin

    def value(names: Names) -> Any:
        found = begin(names)
        for operation, others in reversed(links):
            if _DECIDED.get(operation) != found:
                found = VALUES[operation](found, *(other(names) for other in others))
        return found

    return value


def _applied(operation: str, first: Evaluator, others: list[Evaluator]) -> Evaluator:
    """An operation of one or two operands."""
    apply, decided = VALUES[operation], _DECIDED.get(operation)
    if not others:
        return lambda names: apply(first(names))
    (second,) = others
    if decided is None:
        return lambda names: apply(first(names), second(names))

    def value(names: Names) -> Any:
        found = first(names)
        return found if found == decided else apply(found, second(names))

    return value


def _value(name: str, names: Names, text: str) -> Any:
    if name in names:
        return names[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    if name in FUNCTIONS:
        raise ExpressionError(f"function `{name}` in `{shown(text)}` has no argument", fix=f"write `{name}(…)`")
    if name in OF_A_FLEET:
        fix = f"write `per:` for the block, or a value without `{name}`"
        raise ExpressionError(f"`{name}` in `{shown(text)}` is {OF_A_FLEET[name]}, and there is none", fix=fix)
    raise _unknown(name, text, names)


def _unknown(name: str, text: str, known: Iterable[str]) -> ExpressionError:
    message = f"unknown name `{name}` in `{shown(text)}`"
    return ExpressionError(message, fix=nearest(name, [*known, *CONSTANTS, *FUNCTIONS]))
