"""From an expression to the function of a block that computes an output by it, as an author would have written it.

Operands are elements of arrays of one size, or scalars; each is read once. What consists of numbers alone is computed
here. No operation ever fails: what has no value is NaN or infinite, and goes on to the output, where it ends the run.
"""

from __future__ import annotations

import keyword
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from cosim.errors import ExpressionError
from cosim.language.elementary import NotRealError
from cosim.language.expression import CONSTANTS, VALUES
from cosim.language.expression_tree import Applied, Expression, Literal, Name, is_truth, named
from cosim.language.misreadings import shown

_SIGNS = ("+", "-", "*", "/", "//", "%", "**")
_PRODUCTS = (2.0, 3.0, 4.0)  # exponents up to which a product is as exact as a power, to a bit or two, and much faster
_DEEPEST = 20  # brackets in one line, as what follows the text of a function is recursive
_NO_NUMBER = "a comparison with what is not a number"


@dataclass(frozen=True)
class OutputCode:
    """How an output is computed: by the text of a function.

    calls: the operations that it calls, each after the name that it has for it. reads: of the block's variables and the
    time. truth: whether it gives truth values.
    """

    name: str
    function: str
    text: str
    calls: tuple[tuple[str, str], ...]
    reads: tuple[str, ...]
    truth: bool


def output_code(output: str, expression: Expression, function: str, variables: Mapping[str, bool]) -> OutputCode:
    """The code of an output. function: its name; variables: of the block, and whether they are truth values.

    Raises: ExpressionError for numbers of which an operation makes none.
    """
    reads = dict.fromkeys(n.name for n in named(expression) if n.name in variables or n.name == "time")
    body = _Body(variables)
    result, q, truth = body.text_of(expression), body.index, is_truth(expression)
    elements = [body.element(name) for name in reads if name != "time"]
    lines = [*elements, *body.lines]
    if truth:
        verdict = body.fresh("verdict")
        lines += [f"{verdict} = {result}", f"if {verdict} != {verdict}:", f'    raise ValueError("{_NO_NUMBER}")']
        result = f"{verdict} == 1.0"
    heading = [
        f"def {function}({', '.join([*reads, output])}):",
        f"    for {q} in {body.call('range')}({output}.size):",
    ]
    text = "\n".join([*heading, *(f"        {line}" for line in lines), f"        {output}[{q}] = {result}", ""])
    return OutputCode(output, function, text, tuple(body.calls.items()), tuple(reads), truth)


@dataclass(frozen=True)
class _Part:
    """A part of an expression as text, with so many brackets in brackets; value: of one of numbers alone."""

    text: str
    depth: int = 0
    value: float | None = None


class _Body:
    """The lines of one function, and the names in it. calls: by name the operation that it stands for."""

    def __init__(self, variables: Mapping[str, bool]) -> None:
        self.lines: list[str] = []
        self.calls: dict[str, str] = {}
        self._variables = variables
        self._taken = {*variables, "time"}
        self._names = {name: self.fresh(f"{name}_") for name in variables}
        self._known: dict[int, _Part] = {}
        self.index = self.fresh("q")

    def fresh(self, word: str) -> str:
        """A name like a word that nothing else has."""
        while word in self._taken or keyword.iskeyword(word):
            word += "_"
        self._taken.add(word)
        return word

    def call(self, operation: str) -> str:
        """The name that an operation has in the function."""
        known = next((name for name, other in self.calls.items() if other == operation), None)
        if known is None:
            known = self.fresh(operation.replace(" ", "_"))
            self.calls[known] = operation
        return known

    def element(self, name: str) -> str:
        """The line that reads a variable, one number of it or the only one, of whatever type."""
        one = f"{name}[{self.index} if {name}.size > 1 else 0]"
        read = f"1.0 if {one} else 0.0" if self._variables[name] else f"{self.call('float')}({one})"
        return f"{self._names[name]} = {read}"

    def text_of(self, expression: Expression) -> str:
        """An expression, after the lines that it needs. Raises: ExpressionError."""
        return self._part(expression).text

    def _part(self, expression: Expression) -> _Part:
        if isinstance(expression, Literal):
            return _constant(expression.value)
        if isinstance(expression, Name):
            return self._name(expression.name)
        links = []
        first: Expression = expression
        while isinstance(first, Applied) and id(first) not in self._known:
            links.append(first)
            first = first.operands[0]
        found = self._known[id(first)] if id(first) in self._known else self._part(first)
        for link in reversed(links):
            found = self._known[id(link)] = self._applied(link, [found, *map(self._part, link.operands[1:])])
        return found

    def _name(self, name: str) -> _Part:
        if name in self._variables:
            return _Part(self._names[name])
        return _constant(CONSTANTS[name]) if name in CONSTANTS else _Part(name)

    def _applied(self, applied: Applied, parts: list[_Part]) -> _Part:
        """An operation of parts."""
        operation, (first, *others) = applied.operation, parts
        if operation == "if" and first.value is not None:
            return others[0] if first.value else others[1]
        if all(part.value is not None for part in parts):
            return _constant(_computed(applied, [part.value for part in parts if part.value is not None]))
        depth = 1 + max(part.depth for part in parts)
        if operation == "neg":
            return self._short(_Part(f"(-{first.text})", depth))
        if operation in _SIGNS:
            second = others[0]
            if operation == "**" and second.value in _PRODUCTS:
                second = _Part(f"{second.value:.0f}")
            return self._short(_Part(f"({first.text} {operation} {second.text})", depth))
        text = f"{self.call(operation)}({', '.join(part.text for part in parts)})"
        return self._line(text)

    def _short(self, part: _Part) -> _Part:
        return part if part.depth < _DEEPEST else self._line(part.text)

    def _line(self, text: str) -> _Part:
        """A part with a line and a name of its own."""
        name = self.fresh(f"part_{len(self.lines) + 1}")
        self.lines.append(f"{name} = {text}")
        return _Part(name)


def _constant(value: float) -> _Part:
    text = repr(abs(value)) if math.isfinite(value) else "1e999"
    return _Part(f"(-{text})" if math.copysign(1.0, value) < 0 else text, 0, value)


def _computed(applied: Applied, values: Collection[float]) -> float:
    """What an operation makes of numbers. Raises: ExpressionError."""
    said = ""
    try:
        value = VALUES[applied.operation](*values)
    except NotRealError:
        said = "is not a real number"
    except (ArithmeticError, ValueError) as error:
        said = f"has no value: {error}"
    else:
        if math.isnan(value):
            said = "is not a real number"
        elif math.isinf(value) and all(map(math.isfinite, values)):
            said = "is too large for a number"
        else:
            return float(value)
    raise ExpressionError(f"`{shown(applied.text)}` {said}", fix="check its numbers").at(applied.offset)
