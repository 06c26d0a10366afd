"""What a function does to its arguments, in a form to be read."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class NamedNode:
    """Where a function does something to the argument `name`."""

    node: Any
    name: str


@dataclass(frozen=True)
class LeftOut:
    """An element that no loop reaches: its index along one axis, negative from the end, and one of the loops."""

    loop: Any
    axis: int
    index: int


@dataclass
class Effects:
    """What a function does to its arguments.

    surely: those that every path to the end writes; partly: of those that it does not, the elements that are left;
    left_out: of those that loops write, an element that they do not reach;
    maybe: everything that some statement writes, also through views and helpers; rebound: arguments that are given
    another value; returned: `return` statements with a value; stale: reads of what is not yet written on some path;
    handed_on: arguments that the returned value may be a view of.
    """

    arguments: tuple[str, ...]
    surely: frozenset[str] = frozenset()
    partly: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    left_out: dict[str, LeftOut] = field(default_factory=dict)
    maybe: list[NamedNode] = field(default_factory=list)
    rebound: list[NamedNode] = field(default_factory=list)
    returned: list[Any] = field(default_factory=list)
    stale: list[NamedNode] = field(default_factory=list)
    handed_on: frozenset[str] = frozenset()
    unknown: frozenset[str] = frozenset()  # given to what cannot be looked into

    @property
    def touched(self) -> frozenset[str]:
        """All arguments that may be written."""
        return frozenset(p.name for p in self.maybe) | self.unknown

    def given(self, call: ast.Call) -> list[tuple[str, Any]]:
        """The arguments that a call of the function gives, each with its expression."""
        return [
            *zip(self.arguments, call.args, strict=False),
            *((k.arg, k.value) for k in call.keywords if k.arg is not None),
        ]
