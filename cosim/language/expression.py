"""Arithmetic in diagrams, such as "2*pi*i/N": read by Python's own parser, evaluated by a whitelist, never by `eval`.

All numbers are floats, so that no power is dear: one that is too large is refused in no time.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache

from cosim.errors import ExpressionError, Position, nearest

CONSTANTS = {"pi": math.pi, "e": math.e, "inf": math.inf}
OF_A_FLEET = {"i": "the number of a fleet's member", "N": "the size of a fleet"}
FUNCTIONS: dict[str, Callable[..., float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "abs": abs,
    "min": min,
    "max": max,
    "floor": math.floor,
    "ceil": math.ceil,
}
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_LONGEST = 1000
_DATE = re.compile(r"\d{4}-\d{1,2}-\d{1,2}")
_GROUPED = re.compile(r"(?<![\w.])\d+(?:_\d+)+")
_THOUSANDS = re.compile(r"\d{1,3}(_\d{3})+")

Names = Mapping[str, float]
Evaluator = Callable[[Names], float]


def evaluate(text: str, names: Names | None = None, position: Position | None = None) -> float:
    """The value of an arithmetic expression over constants, functions and the given names (which win over constants).

    Raises: ExpressionError, at the given position.
    """
    try:
        value = _read(text)(names or {})
        if isinstance(value, complex) or math.isnan(value):
            raise ExpressionError(f"`{text}` is not a real number", fix="take even roots of positive numbers only")
        if math.isinf(value) and "inf" not in text:
            raise ExpressionError(f"`{text}` is too large for a number", fix="at most 1.7e308, or `inf`")
    except ExpressionError as error:
        raise ExpressionError(error.message, position, error.fix) from None
    except (ArithmeticError, TypeError, ValueError, RecursionError) as error:
        raise ExpressionError(f"`{text}` cannot be evaluated: {error}", position, "check its values") from None
    return float(value)


def names(text: str) -> frozenset[str]:
    """The names that an expression uses, functions and constants among them; none if it cannot be read."""
    try:
        return frozenset(node.id for node in ast.walk(_parse(text)) if isinstance(node, ast.Name))
    except ExpressionError:
        return frozenset()


def check(text: str, known: Iterable[str]) -> None:
    """See that a text is an expression of the known names. Raises: ExpressionError."""
    _read(text)
    for name in sorted(names(text) - {*known, *CONSTANTS, *FUNCTIONS}):
        raise ExpressionError(f"unknown name `{name}` in `{text}`", fix=nearest(name, [*known, *CONSTANTS, *FUNCTIONS]))


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
    try:
        return _build(_parse(text), text)
    except RecursionError:
        raise _unreadable(text) from None


def _parse(text: str) -> ast.expr:
    if len(text) > _LONGEST:
        raise ExpressionError(f"an expression of {len(text)} characters is too long", fix=f"at most {_LONGEST}")
    if _DATE.fullmatch(text.strip()):
        raise ExpressionError(f"`{text}` is a date, not a number", fix="put spaces around a minus sign")
    for number in _GROUPED.findall(text):
        if not _THOUSANDS.fullmatch(number):
            plain, real = number.replace("_", ""), number.replace("_", ".", 1)
            fix = f"write {plain} or {real}; `_` may group thousands, as in 1_000"
            raise ExpressionError(f"`{number}` groups digits as no number does", fix=fix)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise _unreadable(text) from None


def _unreadable(text: str) -> ExpressionError:
    message = f"`{text}` is neither a number nor an arithmetic expression"
    return ExpressionError(message, fix='write a number, or arithmetic such as "2*pi/3"')


def _build(node: ast.expr, text: str) -> Evaluator:
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as number):
            if isinstance(number, int) and number.bit_length() > 1023:
                raise ExpressionError(f"a number in `{text}` is too large", fix="at most 1e308")
            constant = float(number)
            return lambda names: constant
        case ast.Name(id=name):
            return lambda names: _value(name, names, text)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            sign, inner = _UNARY[type(op)], _build(operand, text)
            return lambda names: sign(inner(names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            apply, a, b = _BINARY[type(op)], _build(left, text), _build(right, text)
            return lambda names: apply(a(names), b(names))
        case ast.BinOp(op=ast.BitXor()):
            raise ExpressionError(f"`^` in `{text}` is not a power", fix="write `**`")
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            if name not in FUNCTIONS:
                raise ExpressionError(f"unknown function `{name}` in `{text}`", fix=nearest(name, FUNCTIONS))
            function, parts = FUNCTIONS[name], [_build(arg, text) for arg in args]
            return lambda names: function(*[part(names) for part in parts])
    raise ExpressionError(
        f"`{ast.unparse(node)}` is not arithmetic", fix=f"numbers, + - * / // % **, and {', '.join(FUNCTIONS)}"
    )


def _value(name: str, names: Names, text: str) -> float:
    if name in names:
        return names[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    if name in FUNCTIONS:
        raise ExpressionError(f"function `{name}` in `{text}` has no argument", fix=f"write `{name}(…)`")
    if name in OF_A_FLEET:
        fix = f"write `per:` for the block, or a value without `{name}`"
        raise ExpressionError(f"`{name}` in `{text}` is {OF_A_FLEET[name]}, and there is none", fix=fix)
    raise ExpressionError(f"unknown name `{name}` in `{text}`", fix=nearest(name, [*names, *CONSTANTS, *FUNCTIONS]))
