"""Arithmetic as a person writes it -> a tree of numbers, names and operations, each of them known.

Python's own parser reads it, and the tree is made anew of what is on a list; nothing is ever handed to `eval`.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

from cosim.errors import ExpressionError
from cosim.language.elementary import FUNCTIONS
from cosim.language.misreadings import CALLED, shown, unreadable

LONGEST, MOST_LEVELS = 1000, 50
TRUTHS = ("below", "at most", "equal", "both", "either", "opposite")
"""The operations that give a truth value."""
_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.Pow: "**",
}
_COMPARED: dict[type[ast.cmpop], tuple[str, bool, bool]] = {
    ast.Lt: ("below", False, False),
    ast.LtE: ("at most", False, False),
    ast.Gt: ("below", True, False),
    ast.GtE: ("at most", True, False),
    ast.Eq: ("equal", False, False),
    ast.NotEq: ("equal", False, True),
}
"""Which operation a comparison is, whether of the second number with the first, and whether it is its opposite."""
_IF = "\N{OLD PERSIAN SIGN A}\N{OLD PERSIAN SIGN I}"
"""What Python's parser sees of `if(`, which is a function here and a word there: as long, and no name of anybody's."""
_CONDITION = re.compile(r"(?:^|[-+*/%(,<>=]|\b(?:and|or|not|if|else)\s)\s*(if)(?=\s*\()")
_DATE = re.compile(r"\d{4}-\d{1,2}-\d{1,2}")
_GROUPED = re.compile(r"(?<![\w.])\d+(?:_\d+)+")
_THOUSANDS = re.compile(r"\d{1,3}(_\d{3})+")


@dataclass(frozen=True)
class Literal:
    """A number, real even where it is written as a whole one."""

    value: float


@dataclass(frozen=True)
class Name:
    """A name, at an offset of the text. truth: whether what stands there is a truth value."""

    name: str
    offset: int
    truth: bool


@dataclass(frozen=True)
class Applied:
    """An operation of others: of `_BINARY`, "neg", of TRUTHS, "if", or a function. text: all of it, at an offset."""

    operation: str
    operands: tuple[Expression, ...]
    text: str
    offset: int


Expression = Literal | Name | Applied


@lru_cache(maxsize=4096)
def read(text: str) -> Expression:
    """What a text says. Raises: ExpressionError, with its offset."""
    try:
        return _Reader(text).whole(_parse(text))
    except RecursionError:
        raise unreadable(text) from None


def is_truth(expression: Expression) -> bool:
    """Whether it gives a truth value."""
    if isinstance(expression, Applied):
        return is_truth(expression.operands[1]) if expression.operation == "if" else expression.operation in TRUTHS
    return isinstance(expression, Name) and expression.truth


def named(expression: Expression) -> Iterator[Name]:
    """The names that stand for numbers and truth values, each time that they are named, in the order of the text."""
    found: dict[int, Name] = {}
    waiting = [expression]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Name):
            found[part.offset] = part
        elif isinstance(part, Applied):
            waiting += part.operands
    yield from (found[offset] for offset in sorted(found))


def words(text: str) -> frozenset[str]:
    """The names in a text, those of functions among them; none if it cannot be read."""
    try:
        return frozenset(node.id for node in ast.walk(_parse(text)) if isinstance(node, ast.Name)) - {_IF}
    except ExpressionError:
        return frozenset()


def _parse(text: str) -> ast.expr:
    """Python's tree of a text. Raises: ExpressionError."""
    if len(text) > LONGEST:
        raise ExpressionError(f"an expression of {len(text)} characters is too long", fix=f"at most {LONGEST}")
    if _DATE.fullmatch(text.strip()):
        raise ExpressionError(f"`{text}` is a date, not a number", fix="put spaces around a minus sign")
    for number in _GROUPED.findall(text):
        if not _THOUSANDS.fullmatch(number):
            plain, real = number.replace("_", ""), number.replace("_", ".", 1)
            fix = f"write {plain} or {real}; `_` may group thousands, as in 1_000"
            raise ExpressionError(f"`{number}` groups digits as no number does", fix=fix)
    if "#" in text:
        raise unreadable(text, text.index("#"))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(_as_python(text), mode="eval").body
    except SyntaxError as error:
        raise unreadable(text, (_indent(text) + error.offset if error.offset else len(text.rstrip())) - 1) from None
    except (ValueError, RecursionError, MemoryError):
        raise unreadable(text) from None


def _as_python(text: str) -> str:
    """The text from its first character on, on one line, with a name in the place of each `if(`."""
    line, begin = re.sub(r"\s", " ", text).strip(), 0
    while found := _CONDITION.search(line, begin):
        begin = found.end(1)
        line = f"{line[: found.start(1)]}{_IF}{line[begin:]}"
    return line


def _indent(text: str) -> int:
    return len(text) - len(text.lstrip())


class _Reader:
    """Makes the tree of one text anew."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._indent = _indent(text)
        self._line = _as_python(text).encode()

    def whole(self, node: ast.expr) -> Expression:
        """The tree, of a number or a truth value."""
        return self._truth(node, 0) if _is_truth(node) else self._number(node, 0)

    def _number(self, node: Any, level: int) -> Expression:
        """A part in the place of a number. Raises: ExpressionError."""
        self._check_level(node, level)
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() as number):
                return self._constant(node, number)
            case ast.Name(id=name) if name != _IF:
                return Name(name, self._offset(node), truth=False)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._number(operand, level + 1)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._applied("neg", node, self._number(operand, level + 1))
            case ast.BinOp(op=op) if type(op) in _BINARY:
                return self._chain(node, level)
            case ast.IfExp() | ast.Call() if _choice_in(node):
                return self._choice(node, level, self._number)
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                return self._call(node, name, args, level)
        if _is_truth(node):
            raise self._mistake(
                node, f"`{self._shown(node)}` is a truth value, not a number", "write if(condition, 1, 0)"
            )
        raise self._refused(node)

    def _constant(self, node: Any, number: float) -> Literal:
        """A number as it is written, if a real number can be so large or small."""
        if (isinstance(number, int) and number.bit_length() > 1023) or number == math.inf:
            raise self._mistake(node, f"a number in `{shown(self._text)}` is too large", "at most 1.7e308, or `inf`")
        if number == 0 and re.search("[1-9]", re.split("[eE]", self._source(node))[0]):
            raise self._mistake(node, f"a number in `{shown(self._text)}` is too small", "from 5e-324, or 0")
        return Literal(float(number))

    def _chain(self, node: ast.BinOp, level: int) -> Expression:
        """Operations of which each has the one before as its first number: a long sum is not deep."""
        links: list[ast.BinOp] = []
        first: ast.expr = node
        while isinstance(first, ast.BinOp) and type(first.op) in _BINARY:
            links.append(first)
            first = first.left
        value = self._number(first, level + 1)
        for link in reversed(links):
            value = self._applied(_BINARY[type(link.op)], link, value, self._number(link.right, level + 1))
        return value

    def _choice(self, node: Any, level: int, read: Any) -> Expression:
        """`a if condition else b`, or if(condition, a, b)."""
        parts = _choice_in(node)
        if len(parts) != 3 or getattr(node, "keywords", None):
            raise self._mistake(node, f"`{self._shown(node)}` has not three parts", "write if(condition, a, b)")
        condition, one, other = parts
        found = read(one, level + 1), read(other, level + 1)
        return self._applied("if", node, self._truth(condition, level + 1), *found)

    def _call(self, node: ast.Call, name: str, arguments: Sequence[ast.expr], level: int) -> Expression:
        """A function of numbers, of several two by two."""
        if name not in FUNCTIONS:
            close = get_close_matches(name, FUNCTIONS, n=1)
            fix = f"write {name}*(…) for a product; functions are {', '.join(FUNCTIONS)}"
            fix = CALLED.get(name) or (f"did you mean `{close[0]}`?" if close else fix)
            raise self._mistake(node, f"unknown function `{name}` in `{shown(self._text)}`", fix)
        known, numbers = FUNCTIONS[name], [self._number(argument, level + 1) for argument in arguments]
        if not known.least <= len(numbers) <= known.most:
            what = f"`{name}` is a function of {known.count}, not of {len(numbers)}"
            raise self._mistake(node, what, f"write {name}({', '.join('abcdef'[: known.least])})")
        if name == "log" and len(numbers) == 2:
            return self._applied("/", node, *(self._applied("log", node, number) for number in numbers))
        value = self._applied(name, node, *numbers[:2])
        for number in numbers[2:]:
            value = self._applied(name, node, value, number)
        return value

    def _truth(self, node: Any, level: int) -> Expression:
        """A part in the place of a truth value. Raises: ExpressionError."""
        self._check_level(node, level)
        match node:
            case ast.Name(id=name) if name != _IF:
                return Name(name, self._offset(node), truth=True)
            case ast.Compare(ops=ops) if all(type(op) in _COMPARED for op in ops):
                return self._comparison(node, level)
            case ast.Compare():
                raise self._refused(node)
            case ast.BoolOp(op=op, values=values):
                first, *others = (self._truth(value, level + 1) for value in values)
                for other in others:
                    first = self._applied("both" if isinstance(op, ast.And) else "either", node, first, other)
                return first
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self._applied("opposite", node, self._truth(operand, level + 1))
            case ast.IfExp() | ast.Call() if _choice_in(node):
                return self._choice(node, level, self._truth)
        self._number(node, level)  # what is wrong inside is told first
        what = f"`{self._shown(node)}` is a number where a condition stands"
        raise self._mistake(node, what, "compare it with another, such as `> 0`")

    def _comparison(self, node: ast.Compare, level: int) -> Expression:
        """Whether each of several numbers is to the next as it says."""
        numbers = [self._number(part, level + 1) for part in (node.left, *node.comparators)]
        found: Expression | None = None
        for k, op in enumerate(node.ops):
            operation, swapped, negated = _COMPARED[type(op)]
            pair = numbers[k : k + 2]
            one = self._applied(operation, node, *(pair[::-1] if swapped else pair))
            one = self._applied("opposite", node, one) if negated else one
            found = self._applied("both", node, found, one) if found else one
        assert found
        return found

    # ---- words ----

    def _applied(self, operation: str, node: Any, *operands: Expression) -> Applied:
        return Applied(operation, operands, self._source(node), self._offset(node))

    def _check_level(self, node: Any, level: int) -> None:
        if level > MOST_LEVELS:
            what = f"`{shown(self._text)}` is nested more than {MOST_LEVELS} levels deep"
            raise self._mistake(node, what, "use fewer levels")

    def _refused(self, node: Any) -> ExpressionError:
        what = f"`{self._shown(node)}` is not arithmetic"
        match node:
            case ast.BinOp(op=ast.BitXor()):
                what, fix = f"`^` in `{shown(self._text)}` is not a power", "write `**`"
            case ast.BinOp(op=ast.BitAnd()):
                fix = "write `and`"
            case ast.BinOp(op=ast.BitOr()):
                fix = "write `or`"
            case ast.UnaryOp(op=ast.Invert()):
                fix = "write `not`"
            case ast.Attribute(value=ast.Name()):
                fix = "a signal is read by an input only: wire it to one"
            case ast.Subscript(value=ast.Name()):
                fix = "an element is read by an input only: wire it to one, such as block.port[1]"
            case ast.Call(func=ast.Constant() | ast.BinOp() | ast.Call()):
                fix = "write `*` before the bracket"
            case _:
                known = ", ".join(FUNCTIONS)
                fix = f"numbers, + - * / // % **, comparisons, and, or, not, if(condition, a, b), and {known}"
        return self._mistake(node, what, fix)

    def _mistake(self, node: Any, what: str, fix: str) -> ExpressionError:
        return ExpressionError(what, fix=fix).at(self._offset(node))

    def _shown(self, node: Any) -> str:
        return shown(self._source(node))

    def _source(self, node: Any) -> str:
        end = len(self._line[: node.end_col_offset].decode())
        return self._text[self._offset(node) : self._indent + end]

    def _offset(self, node: Any) -> int:
        """The characters before a part; Python's parser counts bytes."""
        return self._indent + len(self._line[: node.col_offset].decode())


def _choice_in(node: Any) -> list[ast.expr]:
    """The condition of a choice and what there is to choose from; nothing where a node is none."""
    match node:
        case ast.IfExp(test=condition, body=one, orelse=other):
            return [condition, one, other]
        case ast.Call(func=ast.Name(id=name), args=args) if name == _IF:
            return [*args] or [node.func]
    return []


def _is_truth(node: Any) -> bool:
    """Whether a part of Python's tree gives a truth value."""
    if isinstance(node, ast.Compare | ast.BoolOp):
        return True
    opposite = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return opposite or any(map(_is_truth, _choice_in(node)[1:]))
