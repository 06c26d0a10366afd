"""What a formula of signal temporal logic is made of: terms, which are numbers, and conditions, which hold or not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True)
class Mention:
    """A signal, block.port; index: numbers of a member and elements, from 1; at: where in the text."""

    signal: str
    index: tuple[int, ...]
    at: int


@dataclass(frozen=True)
class Operation:
    """A function or an operator of terms; at: where in the text."""

    name: str
    arguments: tuple[Term, ...]
    at: int


@dataclass(frozen=True)
class Predicate:
    """One of COMPARISONS between two terms; at: where in the text."""

    sign: str
    left: Term
    right: Term
    at: int


@dataclass(frozen=True)
class Proposition:
    """A signal that is true or false."""

    signal: Mention


@dataclass(frozen=True)
class Not:
    """What holds where a condition does not."""

    operand: Condition


@dataclass(frozen=True)
class Junction:
    """What holds where all of several conditions do, or any of them; at: where in the text."""

    every: bool
    operands: tuple[Condition, ...]
    at: int


@dataclass(frozen=True)
class Temporal:
    """A condition at all times from `start` to `stop` (s) from now, or at any of them; stop: inf for the run's end.

    at: where in the text.
    """

    every: bool
    start: float
    stop: float
    operand: Condition
    at: int


@dataclass(frozen=True)
class Until:
    """`right` at a time from `start` to `stop` (s) from now, and `left` at all times before that.

    at: where in the text.
    """

    start: float
    stop: float
    left: Condition
    right: Condition
    at: int


Term = Number | Mention | Operation
Condition = Predicate | Proposition | Not | Junction | Temporal | Until


def mentions(tree: Term | Condition) -> Iterator[Mention]:
    """All signals of a formula."""
    if isinstance(tree, Mention):
        yield tree
    for part in parts(tree):
        yield from mentions(part)


def parts(tree: Term | Condition) -> tuple[Term | Condition, ...]:
    """What a term or a condition is made of."""
    match tree:
        case Operation(arguments=found) | Junction(operands=found):
            return found
        case Predicate(left=left, right=right) | Until(left=left, right=right):
            return left, right
        case Not(operand=part) | Temporal(operand=part) | Proposition(signal=part):
            return (part,)
    return ()


def depth(tree: Term | Condition) -> int:
    """How many operations lie upon one another; those of a row count one by one."""
    deepest, waiting = 0, [(tree, 0)]
    while waiting:
        part, level = waiting.pop()
        below = parts(part)
        deepest = max(deepest, level)
        waiting += [(inner, level + max(len(below) - 1, 1)) for inner in below]
    return deepest


def conditions(tree: Condition) -> tuple[Condition, ...]:
    """The conditions that a condition is made of."""
    match tree:
        case Junction(operands=found):
            return found
        case Not(operand=part) | Temporal(operand=part):
            return (part,)
        case Until(left=left, right=right):
            return left, right
    return ()


def is_instant(tree: Condition) -> bool:
    """Whether a condition speaks of one time only."""
    return not isinstance(tree, Temporal | Until) and all(map(is_instant, conditions(tree)))


def is_open(tree: Condition) -> bool:
    """Whether a condition has a window that ends with the run."""
    open_ = isinstance(tree, Temporal | Until) and math.isinf(tree.stop)
    return open_ or any(is_open(part) for part in conditions(tree))


def horizon(tree: Condition) -> float:
    """How much time (s) has to come for a condition to have a meaning; an open end needs its begin only."""
    own = 0.0
    if isinstance(tree, Temporal | Until):
        own = tree.stop if math.isfinite(tree.stop) else tree.start
    return own + max(map(horizon, conditions(tree)), default=0.0)
