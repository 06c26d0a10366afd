"""Random expressions as trees, their text, and what they are worth by Python's `math`: an oracle of its own.

A tree is a number, a name, or a tuple of an operation and trees. A number is a float, NaN where there is none; a truth
value is True, False, or None where what is compared is no number.
"""

from __future__ import annotations

import math

from hypothesis import strategies as st

from cosim.compiling.interpreted.libm import as_compiled
from cosim.plain_math.definitions import FUNCTIONS

NAMES = ("a", "b", "c")
_WORDS = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh sqrt exp log log2 log10 abs sign floor ceil"
_ONE = _WORDS.split()
_CONSTANTS = {"pi": math.pi, "e": math.e}


@st.composite
def trees(draw, truth=False, depth=4):
    """A tree of a number, or of a truth value."""
    if truth:
        return draw(_truths(depth))
    leaf = st.one_of(
        st.sampled_from([*NAMES, *NAMES, "time", *_CONSTANTS]),
        st.floats(-5, 5).map(lambda x: round(x, 2)),
        st.integers(-3, 9),
    )
    return draw(leaf if depth == 0 else st.one_of(leaf, _numbers(depth)))


@st.composite
def _numbers(draw, depth):
    kind = draw(st.sampled_from(["one", "two", "two", "power", "if", "many", "neg"]))
    number = trees(depth=depth - 1)
    if kind == "one":
        return draw(st.sampled_from(_ONE)), draw(number)
    if kind == "two":
        return draw(st.sampled_from(["+", "-", "*", "/", "//", "%", "atan2", "log of"])), draw(number), draw(number)
    if kind == "power":
        exponent = st.one_of(st.sampled_from([2, 3, 4, -1, 0.5]), number)
        return "**", draw(number), draw(exponent)
    if kind == "if":
        return "if", draw(_truths(depth - 1)), draw(number), draw(number)
    if kind == "many":
        return draw(st.sampled_from(["min", "max"])), *draw(st.lists(number, min_size=2, max_size=3))
    return "neg", draw(number)


@st.composite
def _truths(draw, depth):
    number, few = trees(depth=max(depth - 1, 0)), max(depth - 1, 0)
    kinds = ["compare", "chain", "and", "or", "not", "if"] if depth > 0 else ["compare"]
    kind = draw(st.sampled_from(kinds))
    compared = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    if kind == "compare":
        return draw(compared), draw(number), draw(number)
    if kind == "chain":
        return "chain", draw(compared), draw(compared), draw(number), draw(number), draw(number)
    if kind == "not":
        return "not", draw(_truths(few))
    if kind == "if":
        return "if", draw(_truths(few)), draw(_truths(few)), draw(_truths(few))
    return kind, draw(_truths(few)), draw(_truths(few))


def text(tree):
    """A tree as somebody may write it."""
    if not isinstance(tree, tuple):
        return tree if isinstance(tree, str) else f"({tree})" if math.copysign(1.0, tree) < 0.0 else str(tree)
    operation, *parts = tree
    if operation == "chain":
        first, second, *parts = parts
        a, b, c = map(text, parts)
        return f"({a} {first} {b} {second} {c})"
    words = [text(part) for part in parts]
    if operation == "if":
        return f"if({', '.join(words)})" if len(words[0]) % 2 else f"({words[1]} if {words[0]} else {words[2]})"
    if operation == "neg":
        return f"(-{words[0]})"
    if operation == "not":
        return f"(not {words[0]})"
    if operation == "log of":
        return f"log({words[0]}, {words[1]})"
    if operation.isalnum() and operation not in ("and", "or"):
        return f"{operation}({', '.join(words)})"
    return f"({words[0]} {operation} {words[1]})"


def value(tree, names):
    """What a tree is worth."""
    if isinstance(tree, str):
        return names[tree] if tree in names else _CONSTANTS[tree]
    if not isinstance(tree, tuple):
        return float(tree)
    operation, *parts = tree
    if operation in ("and", "or"):
        first = value(parts[0], names)
        decided = first is None or first is (operation == "or")
        return first if decided else value(parts[1], names)
    if operation == "if":
        condition = value(parts[0], names)
        chosen = value(parts[2 if condition is False else 1], names)
        if condition is None:
            return None if chosen is None or isinstance(chosen, bool) else math.nan
        return chosen
    if operation == "chain":
        first, second, *parts = parts
        a, b, c = (value(part, names) for part in parts)
        found = _compared(first, a, b)
        return _compared(second, b, c) if found is True else found
    values = [value(part, names) for part in parts]
    if operation == "not":
        return None if values[0] is None else not values[0]
    if operation in ("<", "<=", ">", ">=", "==", "!="):
        return _compared(operation, *values)
    if operation == "**" and values[1] in (2.0, 3.0, 4.0) and [*map(_is_constant, parts)] == [False, True]:
        a = values[0]  # a product
        return {2.0: a * a, 3.0: a * (a * a), 4.0: (a * a) * (a * a)}[values[1]]
    return _number(operation, values)


def _is_constant(tree):
    return all(map(_is_constant, tree[1:])) if isinstance(tree, tuple) else tree not in (*NAMES, "time")


def _compared(operation, a, b):
    if math.isnan(a) or math.isnan(b):
        return None
    return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[operation]


def _number(operation, values):
    if any(map(math.isnan, values)):
        # Powers are those of C, where 1 to any power and any number to the power 0 are 1.
        return _power(*values) if operation == "**" else math.nan
    if operation in ("min", "max"):
        return {"min": min, "max": max}[operation](values)
    a, b = values[0], values[-1]
    if operation == "**":
        return _power(a, b)
    if operation == "log of":
        return _divided(_number("log", [a]), _number("log", [b]))
    if operation in ("/", "//", "%"):
        return _divided(a, b) if operation == "/" else _whole(operation, a, b)
    if operation in ("+", "-", "*", "neg"):
        return {"+": a + b, "-": a - b, "*": a * b, "neg": -a}[operation]
    if operation == "sign":
        return math.copysign(1.0, a) if a else a
    if operation in ("floor", "ceil", "abs"):
        return a if math.isinf(a) and operation != "abs" else float(getattr(math, operation, abs)(a))
    return _of_math(operation, values)


def _of_math(operation, values):
    """What cosim's own functions give, which have tests of their own; of others `math`, or C where Python raises."""
    if operation in FUNCTIONS:
        return as_compiled(operation, len(values))(*values)
    try:
        return getattr(math, operation)(*values)
    except OverflowError:
        return math.copysign(math.inf, values[0]) if operation == "sinh" else math.inf
    except ValueError:
        pole = {"log2": 0.0, "log10": 0.0}.get(operation)
        if pole == values[0]:
            return -math.inf
        return math.copysign(math.inf, values[0]) if operation == "atanh" and abs(values[0]) == 1.0 else math.nan


def _divided(a, b):
    if math.isnan(a) or math.isnan(b):
        return math.nan
    if b:
        return a / b
    return math.copysign(math.inf, a) * math.copysign(1.0, b) if a else math.nan


def _whole(operation, a, b):
    """Of Python; by zero the quotient is that of `/`, and there is no remainder."""
    if not b:
        return _divided(a, b) if operation == "//" else math.nan
    if math.isinf(a):
        return math.nan
    return a // b if operation == "//" else a % b


def _power(a, b):
    return as_compiled("pow", 2)(a, b)
