"""Readers of single values: a wrong one is a mistake with its place, and a default stands in for it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from cosim.errors import CosimError, MissingKey, Problems, TooLarge, WrongType, WrongValue, nearest
from cosim.language.expression import evaluate, is_arithmetic
from cosim.language.source import Node, describe

MOST = 2**31 - 1  # that compiled loops count to
_BLOCK_NAME = re.compile(r"[^\W\d][\w-]*(/[^\W\d][\w-]*)*")


class Reader:
    """Reads single values; a wrong one is reported, and the given default stands in for it."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems

    def wrong(self, node: Node, message: str, fix: str, error: type[CosimError] = WrongType) -> None:
        """Report a wrong value, of which nothing has been said yet."""
        if not any(known.position == node.position for known in self.problems.errors):
            self.problems.add(error(message, node.position, fix))

    def missing(self, node: Node, message: str, fix: str) -> None:
        """Report that a mapping lacks something, unless what stands in its place is known to be no mapping."""
        if not any(isinstance(e, WrongType) and e.position == node.position for e in self.problems.errors):
            self.problems.add(MissingKey(message, node.place, fix))

    def text(self, node: Node, name: str) -> str:
        """A text; "" for anything else."""
        if isinstance(node.value, str) and node.value:
            return node.value
        several = isinstance(node.value, list | dict)
        said = "is an empty text" if node.value == "" else f"must be text, not {describe(node)}"
        fix = "write one text" if several or node.value == "" else "put it between quotation marks"
        self.wrong(node, f"`{name}` {said}", fix)
        return ""

    def choice(self, node: Node, name: str, known: Iterable[str]) -> str:
        """One of the known words; the first of them for anything else."""
        known = tuple(known)
        if node.value in known:
            return str(node.value)
        self.wrong(node, f"`{name}` cannot be {describe(node)}", nearest(str(node.value), known), WrongValue)
        return known[0]

    def truth(self, node: Node, name: str) -> bool:
        """true or false; False for anything else."""
        if not isinstance(node.value, bool):
            self.wrong(node, f"`{name}` must be true or false, not {describe(node)}", "write true or false")
        return node.value is True

    def number(self, node: Node, name: str, default: float = 1.0) -> float:
        """A finite number or an expression of constants."""
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            self.wrong(node, f"`{name}` must be a number, not {describe(node)}", 'write a number, or "pi/3"')
            return default
        if isinstance(value, str):
            try:
                value = evaluate(value, position=node.position)
            except CosimError as error:
                self.problems.add(error)
                return default
        if not math.isfinite(value):
            self.wrong(node, f"`{name}` must be finite, not {describe(node)}", "write a number", WrongValue)
            return default
        return float(value)

    def positive(self, node: Node, name: str, default: float = 1.0) -> float:
        """A number above zero."""
        value = self.number(node, name, default)
        if value <= 0:
            self.wrong(node, f"`{name}` must be above zero, not {describe(node)}", "such as 0.001", WrongValue)
            return default
        return value

    def not_negative(self, node: Node, name: str, default: float = 0.0) -> float:
        """A number from zero."""
        value = self.number(node, name, default)
        if value < 0:
            self.wrong(node, f"`{name}` must not be negative, not {describe(node)}", "such as 0.001", WrongValue)
            return default
        return value

    def count(self, node: Node, name: str, most: int = MOST) -> int:
        """A whole number from one."""
        value = self.number(node, name)
        if value < 1 or value != round(value):
            fix = "such as 1, 2, 3"
            self.wrong(node, f"`{name}` must be a whole number from 1, not {describe(node)}", fix, WrongValue)
            return 1
        if value > most:
            self.wrong(node, f"`{name}` cannot be {describe(node)}", f"at most {most}", TooLarge)
            return 1
        return round(value)

    def order(self, node: Node, name: str, most: int) -> int:
        """A whole number from zero."""
        value = self.number(node, name, 0.0)
        if value not in range(most + 1):
            fix = f"one of: {', '.join(map(str, range(most + 1)))}"
            self.wrong(node, f"`{name}` must be a whole number from 0 to {most}, not {describe(node)}", fix, WrongValue)
            return 0
        return int(value)

    def endpoint(self, node: Node, name: str) -> bool:
        """Whether the value has the form `block.port`, else a report."""
        if isinstance(node.value, str):
            block, port = endpoint(node.value)
            if port and _BLOCK_NAME.fullmatch(block):
                if node.value != f"{block}.{port}":
                    message = f"`{name}` has spaces around the dot of `{node.value}`"
                    self.wrong(node, message, f"write {block}.{port}", WrongValue)
                return True
        fix = "write block.port, such as plant.x"
        self.wrong(node, f"`{name}` must have the form block.port, not {describe(node)}", fix, WrongValue)
        return False

    def endpoints(self, node: Node, name: str) -> list[Node]:
        """One or several texts of the form `block.port`: those that are."""
        nodes = node.value if isinstance(node.value, list) else [node]
        return [n for n in nodes if self.endpoint(n, name)]

    def block_name(self, name: str, node: Node) -> None:
        """Report a name that no wire could be written to."""
        if not _BLOCK_NAME.fullmatch(name):
            fix = "letters, digits, _ and -, beginning with a letter"
            self.problems.add(WrongValue(f"a block cannot be called `{name}`", node.place, fix))


def endpoint(text: str) -> tuple[str, str]:
    """The block and the port of `block.port`; a port's name may contain dots, a block's cannot."""
    block, _, port = text.partition(".")
    return block.strip(), port.strip()


def is_constant(node: Node) -> bool:
    """Whether what is written for an input is a value, which it has throughout, and not what it reads."""
    if isinstance(node.value, list):
        return bool(node.value) and all(map(is_constant, node.value))
    if isinstance(node.value, str):
        block, port = endpoint(node.value)
        return not (port and _BLOCK_NAME.fullmatch(block)) and is_arithmetic(node.value)
    return isinstance(node.value, bool | int | float)


def multiple(value: float, step: float) -> int | None:
    """How many whole steps a time is, within 1e-9 of it; None if it is no whole number of them, from 1 to 2**53."""
    ratio = value / step if step else math.inf
    if not 0.5 < ratio < 2**53:
        return None
    count = round(ratio)
    return count if abs(ratio - count) <= 1e-9 * ratio else None
