"""Formulas of requirements in signal temporal logic: text -> a tree of terms and conditions.

    always[1, 30](max(abs(controller.u)) < 150)
    eventually[0, 5](always(formation.e_x < 0.05))
    (plant.x > 1) until[0, 2] (plant.v < 0)

From what binds most: `**`; `-x`; `* /`; `+ -`; comparisons, which may be chained; `not`; `and`; `or`; `until`;
`implies`. Bounds are in seconds. A signal is block.port; in brackets behind it, the numbers of a member and an element.
After Maler and Nickovic, Monitoring temporal properties of continuous signals, FORMATS 2004.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cosim.errors import FormulaError, Position, nearest
from cosim.language.formula_tree import (
    Condition,
    Junction,
    Mention,
    Not,
    Number,
    Operation,
    Predicate,
    Proposition,
    Temporal,
    Term,
    Until,
    depth,
)

Tree = Term | Condition
Place = Callable[[int], Position | None]
"""Where a character of a text stands."""

CONSTANTS = {"pi": math.pi, "e": math.e}
ELEMENTWISE = {"abs": 1, "sqrt": 1, "exp": 1, "log": 1, "sin": 1, "cos": 1, "tan": 1, "atan2": 2}
"""Functions of each element, and how many arguments they take."""
OVERALL = ("max", "min", "sum", "mean", "norm")
"""Functions of all elements, and members of a fleet; `norm` is of each member's own elements."""
TEMPORAL = ("always", "eventually")
WORDS = ("and", "or", "not", "implies", "until", *TEMPORAL)
COMPARISONS = ("<", "<=", ">", ">=")
EQUALITIES = ("=", "==", "!=")
NESTED = 30
"""Levels of parentheses and the like, each of which takes some fifteen calls to read."""
DEEPEST = 200
LONGEST = 10_000
SHOWN = 200
LONGEST_INDEX = 18
"""Digits of a number of 64 bits."""
OTHERWISE = {
    **{"G": "always", "globally": "always", "F": "eventually", "finally": "eventually", "U": "until"},
    **{
        "&": "and",
        "&&": "and",
        "|": "or",
        "||": "or",
        "!": "not",
        "~": "not",
        "->": "implies",
        "=>": "implies` or `>=",
    },
    "^": "**",
}
"""What other tools write, and how it is written here."""

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)"
    r"|(?P<signal>[^\W\d][\w-]*(?:/[^\W\d][\w-]*)*\.[^\W\d]\w*(?:\.[^\W\d]\w*)*)"
    r"|(?P<word>[^\W\d]\w*)"
    r"|(?P<foreign>->|=>|&&?|\|\|?|!(?!=)|[~^])"
    r"|(?P<sign>\*\*|<=|>=|==?|!=|[-+*/()<>\[\],]))"
)


def nowhere(at: int) -> None:
    """The place of a character of a text that stands in no file."""


def parse(text: str, place: Place = nowhere) -> Condition:
    """The tree of a formula. Raises: FormulaError, at the place of what is wrong."""
    if len(text) > LONGEST:
        raise FormulaError(f"a formula of {len(text)} characters is too long", place(0), f"at most {LONGEST}")
    return _Parser(text, place).formula()


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    at: int


class _Words:
    """The tokens of a formula, and what is made of them alone."""

    def __init__(self, text: str, place: Place) -> None:
        self.text, self.place = text, place
        self.tokens = list(self._split())
        self.next = 0

    def _split(self) -> Iterator[_Token]:
        end, size = 0, len(self.text.rstrip())
        while end < size:
            found = _TOKEN.match(self.text, end)
            if not found or not found.lastgroup:
                at = end + len(self.text[end:]) - len(self.text[end:].lstrip())
                raise self.refused(
                    f"`{self.text[at]}` has no meaning in a formula", at, "signals, numbers, + - * / ** < > ( )"
                )
            token = _Token(found.lastgroup, found[found.lastgroup], found.start(found.lastgroup))
            if token.kind == "foreign":
                fix = f"write `{OTHERWISE[token.text]}`"
                raise self.refused(f"`{token.text}` has no meaning in a formula", token.at, fix)
            yield token
            end = found.end()
        yield _Token("end", "", size)

    def refused(self, message: str, at: int, fix: str = "") -> FormulaError:
        text = self.text.strip()
        shown = text if len(text) <= SHOWN else f"{text[:SHOWN]}…"
        return FormulaError(f"{message}, in `{shown}`", self.place(at), fix)

    @property
    def token(self) -> _Token:
        return self.tokens[self.next]

    def took(self, *texts: str) -> _Token | None:
        """The next token if it is one of these, which is then passed."""
        if self.token.kind in ("sign", "word") and self.token.text in texts:
            self.next += 1
            return self.tokens[self.next - 1]
        return None

    def expect(self, text: str, fix: str = "") -> None:
        if not self.took(text):
            found = f"`{self.token.text}`" if self.token.text else "the end"
            raise self.refused(f"`{text}` is expected instead of {found}", self.token.at, fix)

    def index(self) -> tuple[int, ...]:
        if not self.took("["):
            return ()
        numbers = []
        while True:
            token = self.token
            if token.kind != "number" or not token.text.isdecimal() or not float(token.text):
                raise self.refused("members and elements are whole numbers from 1", token.at, "such as plant.x[2, 1]")
            self.next += 1
            if len(token.text) > LONGEST_INDEX:
                raise self.refused("no signal has so many elements", token.at)
            numbers.append(int(token.text))
            if not self.took(","):
                break
        self.expect("]")
        return tuple(numbers)

    def window(self) -> tuple[float, float]:
        """The bounds of a temporal operator; without them, from now to the end of the run."""
        begin = self.took("[")
        if not begin:
            return 0.0, math.inf
        start = self.bound()
        self.expect(",")
        stop = self.bound()
        self.expect("]")
        if not 0 <= start <= stop or math.isinf(start):
            raise self.refused(
                f"the window [{start:g}, {stop:g}] is empty", begin.at, "from a time to a later one, in s"
            )
        return start, stop

    def bound(self) -> float:
        token = self.token
        if token.kind != "number" and token.text != "inf":
            raise self.refused("the bounds of a window are numbers, in s", token.at, "such as [0, 5], or [1, inf]")
        self.next += 1
        return math.inf if token.text == "inf" else self.number(token)

    def number(self, token: _Token) -> float:
        value = float(token.text)
        if math.isinf(value):
            raise self.refused(f"`{token.text}` is beyond all numbers", token.at)
        return value


class _Parser(_Words):
    """Precedence climbing, a method for each level."""

    depth = 0

    def formula(self) -> Condition:
        tree = self.condition()
        if self.token.kind != "end":
            fix = "write `and` or `or` between two conditions" if self.token.kind != "sign" else ""
            fix = "put the first of them in parentheses" if self.token.text == "until" else fix
            raise self.refused(f"`{self.token.text}` is one too many", self.token.at, fix)
        if depth(tree) > DEEPEST:
            raise self.refused(f"more than {DEEPEST} operations upon one another", 0, "let a block compute some")
        return tree

    # ---- conditions ----

    def condition(self) -> Condition:
        at = self.token.at
        return self.as_condition(self.implication(), at)

    def implication(self) -> Tree:
        at = self.token.at
        left = self.until()
        if token := self.took("implies"):
            right = self.as_condition(self.nested(self.implication), self.token.at)
            return Junction(False, (Not(self.as_condition(left, at)), right), token.at)
        return left

    def until(self) -> Tree:
        at = self.token.at
        left = self.junction("or")
        if token := self.took("until"):
            start, stop = self.window()
            begin = self.token.at
            right = self.as_condition(self.junction("or"), begin)
            return Until(start, stop, self.as_condition(left, at), right, token.at)
        return left

    def junction(self, word: str) -> Tree:
        at, inner = self.token.at, self.conjunction if word == "or" else self.negation
        first, sign = inner(), self.token.at
        if not self.took(word):
            return first
        found = [self.as_condition(first, at)]
        while len(found) == 1 or self.took(word):
            begin = self.token.at
            found.append(self.as_condition(inner(), begin))
        return Junction(word == "and", tuple(found), sign)

    def conjunction(self) -> Tree:
        return self.junction("and")

    def negation(self) -> Tree:
        if self.took("not"):
            begin = self.token.at
            return Not(self.as_condition(self.nested(self.negation), begin))
        return self.comparison()

    def comparison(self) -> Tree:
        at = self.token.at
        left = self.sum()
        found: list[Condition] = []
        while sign := self.took(*COMPARISONS, *EQUALITIES):
            if sign.text in EQUALITIES:
                raise self.refused(
                    f"`{sign.text}` has no margin",
                    sign.at,
                    "write abs(a - b) < 0.01, or the signal alone if it is boolean",
                )
            begin = self.token.at
            right = self.as_term(self.sum(), begin)
            found.append(Predicate(sign.text, self.as_term(left, at), right, sign.at))
            left, at = right, begin
        if not found:
            return left
        return found[0] if len(found) == 1 else Junction(True, tuple(found), at)

    # ---- terms ----

    def sum(self) -> Tree:
        return self.chain(("+", "-"), self.product)

    def product(self) -> Tree:
        return self.chain(("*", "/"), self.factor)

    def chain(self, signs: tuple[str, str], inner: Callable[[], Tree]) -> Tree:
        at = self.token.at
        left: Tree = inner()
        while sign := self.took(*signs):
            begin = self.token.at
            right = self.as_term(inner(), begin)
            left = Operation(sign.text, (self.as_term(left, at), right), sign.at)
        return left

    def factor(self) -> Tree:
        if sign := self.took("-", "+"):
            begin = self.token.at
            inner = self.as_term(self.nested(self.factor), begin)
            return inner if sign.text == "+" else Operation("negative", (inner,), sign.at)
        at = self.token.at
        base = self.atom()
        if sign := self.took("**"):
            begin = self.token.at
            return Operation("**", (self.as_term(base, at), self.as_term(self.nested(self.factor), begin)), sign.at)
        return base

    def atom(self) -> Tree:
        token = self.token
        self.next += token.kind != "end"
        if token.kind == "number":
            return Number(self.number(token))
        if token.kind == "signal":
            return Mention(token.text, self.index(), token.at)
        if token.text == "(":
            inner = self.nested(self.implication)
            self.expect(")")
            return inner
        if token.kind == "word":
            return self.word(token)
        what = f"`{token.text}`" if token.text else "the end"
        raise self.refused(f"a signal, a number or `(` is expected instead of {what}", token.at)

    def word(self, token: _Token) -> Tree:
        name = token.text
        if name in TEMPORAL:
            start, stop = self.window()
            self.expect("(", f"such as {name}(plant.x < 1)")
            begin = self.token.at
            inner = self.as_condition(self.nested(self.implication), begin)
            self.expect(")")
            return Temporal(name == "always", start, stop, inner, token.at)
        if name in (*ELEMENTWISE, *OVERALL):
            return self.call(token)
        if name in CONSTANTS:
            return Number(CONSTANTS[name])
        if self.token.text == "(":
            raise self.refused(
                f"there is no function `{name}`", token.at, nearest(name, [*TEMPORAL, *ELEMENTWISE, *OVERALL])
            )
        fix = "write block.port, such as plant.x" if name not in WORDS else "a condition on both sides"
        fix = f"write `{OTHERWISE[name]}`" if name in OTHERWISE else fix
        raise self.refused(f"`{name}` is no signal", token.at, fix)

    def call(self, token: _Token) -> Operation:
        self.expect("(")
        arguments = []
        while True:
            begin = self.token.at
            arguments.append(self.as_term(self.nested(self.implication), begin))
            if not self.took(","):
                break
        self.expect(")")
        wanted = ELEMENTWISE.get(token.text, 1)
        several = token.text in ("max", "min") and len(arguments) > 1
        if len(arguments) != wanted and not several:
            raise self.refused(
                f"`{token.text}` takes {wanted} argument{'s' * (wanted > 1)}, not {len(arguments)}", token.at
            )
        return Operation(token.text, tuple(arguments), token.at)

    # ---- kinds ----

    def nested(self, inner: Callable[[], Tree]) -> Tree:
        """What stands within something else, to a depth that nobody writes."""
        self.depth += 1
        if self.depth > NESTED:
            raise self.refused(f"more than {NESTED} levels of nesting", self.token.at, "fewer parentheses")
        found: Tree = inner()
        self.depth -= 1
        return found

    def as_condition(self, tree: Tree, at: int) -> Condition:
        if isinstance(tree, Mention):
            return Proposition(tree)
        if isinstance(tree, Number | Operation):
            raise self.refused("a condition is expected, not a number", at, "compare it, such as abs(plant.x) < 1")
        return tree

    def as_term(self, tree: Tree, at: int) -> Term:
        if not isinstance(tree, Number | Mention | Operation):
            raise self.refused(
                "a number is expected, not a condition", at, "put conditions in parentheses, with and, or, not"
            )
        return tree
