"""Formulas of requirements: what binds how, and mistakes, each with its place and the usual fix."""

import math

import pytest

from cosim.errors import FormulaError, Position
from cosim.language.formula import DEEPEST, LONGEST, NESTED, parse
from cosim.language.formula_tree import (
    Junction,
    Mention,
    Not,
    Number,
    Operation,
    Predicate,
    Proposition,
    Temporal,
    Until,
    depth,
    horizon,
    is_instant,
    mentions,
)


def plain(tree) -> str:
    """A tree with all its parentheses."""
    match tree:
        case Number(value):
            return f"{value:g}"
        case Mention(signal, index):
            return signal + (str(list(index)) if index else "")
        case Operation(name, arguments):
            return f"{name}({', '.join(map(plain, arguments))})"
        case Predicate(sign, left, right):
            return f"({plain(left)} {sign} {plain(right)})"
        case Proposition(signal):
            return plain(signal)
        case Not(operand):
            return f"!{plain(operand)}"
        case Junction(every, operands):
            return f"({(' & ' if every else ' | ').join(map(plain, operands))})"
        case Temporal(every, start, stop, operand):
            return f"{'G' if every else 'F'}[{start:g},{stop:g}]{plain(operand)}"
        case Until(start, stop, left, right):
            return f"({plain(left)} U[{start:g},{stop:g}] {plain(right)})"
    raise AssertionError(tree)


READ = {
    "a.x < 1": "(a.x < 1)",
    "a.x + b.y * 2 < 1 - 3": "(+(a.x, *(b.y, 2)) < -(1, 3))",
    "a.x - 1 - 2 < 1 / 2 / 3": "(-(-(a.x, 1), 2) < /(/(1, 2), 3))",
    "-a.x ** 2 < 2 ** -1": "(negative(**(a.x, 2)) < **(2, negative(1)))",
    "2 ** 3 ** 2 < a.x": "(**(2, **(3, 2)) < a.x)",
    "-2 * a.x < +1": "(*(negative(2), a.x) < 1)",
    "(a.x + 1) * 2 >= (3)": "(*(+(a.x, 1), 2) >= 3)",
    "1 < a.x <= b.y": "((1 < a.x) & (a.x <= b.y))",
    "a.x < 1 < b.y > 2": "((a.x < 1) & (1 < b.y) & (b.y > 2))",
    "a.p and b.q or c.r": "((a.p & b.q) | c.r)",
    "a.p or b.q and c.r": "(a.p | (b.q & c.r))",
    "a.p and b.q and c.r": "(a.p & b.q & c.r)",
    "not a.p and b.q": "(!a.p & b.q)",
    "not a.x < 1": "!(a.x < 1)",
    "not not a.p": "!!a.p",
    "a.p implies b.q": "(!a.p | b.q)",
    "a.p implies b.q implies c.r": "(!a.p | (!b.q | c.r))",
    "a.p and b.q until c.r or d.s": "((a.p & b.q) U[0,inf] (c.r | d.s))",
    "a.p until b.q implies c.r": "(!(a.p U[0,inf] b.q) | c.r)",
    "a.p until[1, 2.5] b.q": "(a.p U[1,2.5] b.q)",
    "(a.p until b.q) until c.r": "((a.p U[0,inf] b.q) U[0,inf] c.r)",
    "always(a.x < 1)": "G[0,inf](a.x < 1)",
    "always [ .5 , 1e1 ] ( a.p )": "G[0.5,10]a.p",
    "eventually[2, inf](a.p)": "F[2,inf]a.p",
    "always(eventually[0, 1](a.p implies always(b.q)))": "G[0,inf]F[0,1](!a.p | G[0,inf]b.q)",
    "not always(a.p) or eventually(b.q)": "(!G[0,inf]a.p | F[0,inf]b.q)",
    "max(abs(a.x), 2, b.y) < pi": f"(max(abs(a.x), 2, b.y) < {math.pi:g})",
    "norm(a.x) + atan2(a.y, e) < 1": f"(+(norm(a.x), atan2(a.y, {math.e:g})) < 1)",
    "outer/inner-2.x.y[2, 1] < 1": "(outer/inner-2.x.y[2, 1] < 1)",
    "a.x[3] < b.y [1]": "(a.x[3] < b.y[1])",
    "a.p\n  and b.q": "(a.p & b.q)",
    "größe.λ < 1": "(größe.λ < 1)",
    "a.x<-1": "(a.x < negative(1))",
    "always_on.x < 1": "(always_on.x < 1)",
}


@pytest.mark.parametrize(("text", "wanted"), READ.items())
def test_what_binds_how(text, wanted):
    assert plain(parse(text)) == wanted


WRONG = {
    # text: column, message, fix
    "": (1, "a signal, a number or `(` is expected instead of the end", ""),
    "   ": (1, "instead of the end", ""),
    "a.x <": (6, "a signal, a number or `(` is expected instead of the end", ""),
    "a.x < )": (7, "instead of `)`", ""),
    "< 1": (1, "instead of `<`", ""),
    "a.x < 1)": (8, "`)` is one too many", ""),
    "(a.x < 1": (9, "`)` is expected instead of the end", ""),
    "a.x < 1 b.y < 2": (9, "`b.y` is one too many", "`and` or `or`"),
    "a.x 1": (5, "`1` is one too many", "`and` or `or`"),
    "1": (1, "a condition is expected, not a number", "compare it"),
    "a.x + 1": (1, "a condition is expected, not a number", "compare it"),
    "a.x < 1 and 2": (13, "a condition is expected, not a number", "compare it"),
    "not abs(a.x)": (5, "a condition is expected, not a number", "compare it"),
    "always(a.x * 2)": (8, "a condition is expected, not a number", "compare it"),
    "(a.x < 1) + 2 < 3": (1, "a number is expected, not a condition", "parentheses"),
    "1 + (a.x < 1) < 3": (5, "a number is expected, not a condition", "parentheses"),
    "abs(a.x < 1) < 1": (5, "a number is expected, not a condition", "parentheses"),
    "(a.x < 1) < 2": (1, "a number is expected, not a condition", "parentheses"),
    "-always(a.p) < 1": (2, "a number is expected, not a condition", "parentheses"),
    "a.x == 1": (5, "`==` has no margin", "abs(a - b)"),
    "a.x != 1": (5, "`!=` has no margin", "abs(a - b)"),
    "a.x = 1": (5, "`=` has no margin", "abs(a - b)"),
    "a.p && b.q": (5, "`&&` has no meaning", "write `and`"),
    "a.p | b.q": (5, "`|` has no meaning", "write `or`"),
    "!a.p": (1, "`!` has no meaning", "write `not`"),
    "a.p -> b.q": (5, "`->` has no meaning", "write `implies`"),
    "a.x => 1": (5, "`=>` has no meaning", "`>=`"),
    "a.x ^ 2 < 1": (5, "`^` has no meaning", "write `**`"),
    "a.x < 1; b.p": (8, "`;` has no meaning", "signals, numbers"),
    "a.x < 'one'": (7, "`'` has no meaning", "signals, numbers"),
    "G[0, 5](a.p)": (1, "`G` is no signal", "write `always`"),
    "globally(a.p)": (1, "there is no function `globally`", "always"),
    "alway(a.p)": (1, "there is no function `alway`", "did you mean `always`?"),
    "plant < 1": (1, "`plant` is no signal", "block.port"),
    "a.x < inf": (7, "`inf` is no signal", "block.port"),
    "and a.p": (1, "`and` is no signal", "on both sides"),
    "a.p and": (8, "instead of the end", ""),
    "a.p until b.q until c.r": (15, "`until` is one too many", "parentheses"),
    "always a.p": (8, "`(` is expected instead of `a.p`", "such as always("),
    "always[5, 1](a.p)": (7, "the window [5, 1] is empty", "to a later one"),
    "always[inf, inf](a.p)": (7, "is empty", "to a later one"),
    "always[-1, 1](a.p)": (8, "the bounds of a window are numbers, in s", "such as [0, 5]"),
    "always[0; 1](a.p)": (9, "`;` has no meaning", ""),
    "always[0 1](a.p)": (10, "`,` is expected instead of `1`", ""),
    "always[0, 1)(a.p)": (12, "`]` is expected instead of `)`", ""),
    "always[0, a.x](a.p)": (11, "the bounds of a window are numbers", ""),
    "always[0, 1e999](a.p)": (11, "`1e999` is beyond all numbers", ""),
    "a.x < 1e999": (7, "`1e999` is beyond all numbers", ""),
    "a.x[0] < 1": (5, "whole numbers from 1", "such as plant.x[2, 1]"),
    "a.x[1.5] < 1": (5, "whole numbers from 1", "such as"),
    "a.x[b.y] < 1": (5, "whole numbers from 1", "such as"),
    "a.x[1 < 1": (7, "`]` is expected instead of `<`", ""),
    f"a.x[{'1' * 5000}] < 1": (5, "no signal has so many elements", ""),
    "abs() < 1": (5, "instead of `)`", ""),
    "abs(a.x, 1) < 1": (1, "`abs` takes 1 argument, not 2", ""),
    "atan2(a.x) < 1": (1, "`atan2` takes 2 arguments, not 1", ""),
    "norm(a.x, b.y) < 1": (1, "`norm` takes 1 argument, not 2", ""),
    "(" * 400 + "a.p" + ")" * 400: (NESTED + 2, f"more than {NESTED} levels", "fewer"),
    " implies ".join(["a.p"] * 700): (None, f"more than {NESTED} levels", "fewer"),
    "+".join(["a.x"] * 2000) + " < 1": (1, f"more than {DEEPEST} operations", "block"),
    " and ".join(["a.p"] * 800): (1, f"more than {DEEPEST} operations", "block"),
    "a.x < 1 " + " " * LONGEST: (1, "characters is too long", str(LONGEST)),
}


@pytest.mark.parametrize(("text", "wanted"), WRONG.items(), ids=lambda v: repr(v)[:30])
def test_a_mistake_has_its_place_and_the_usual_fix(text, wanted):
    column, message, fix = wanted
    with pytest.raises(FormulaError) as caught:
        parse(text, lambda at: Position("d.yaml", 7, 1 + at))
    assert message in caught.value.message
    assert fix in caught.value.fix
    assert (caught.value.position.file, caught.value.position.line) == ("d.yaml", 7)
    assert column is None or caught.value.position.column == column
    assert len(caught.value.message) < 400


def test_there_are_many_mistakes():
    assert len(WRONG) > 50


def test_a_formula_of_a_program_has_no_place():
    with pytest.raises(FormulaError) as caught:
        parse("a.x <")
    assert caught.value.position is None


def test_the_largest_formulas_can_be_used():
    """As deep and as long as it may be, without a hang or the end of Python's stack."""
    nested = "(" * (NESTED - 1) + "a.p" + ")" * (NESTED - 1)
    assert plain(parse(nested)) == "a.p"
    tree = parse("+".join(["a.x"] * DEEPEST) + " < 1")
    assert depth(tree) == DEEPEST and len(list(mentions(tree))) == DEEPEST and is_instant(tree)
    assert len({tree, parse("a.p")}) == 2


def test_how_far_a_formula_looks_ahead():
    assert horizon(parse("a.p")) == 0
    assert horizon(parse("always[1, 5](a.p)")) == 5
    assert horizon(parse("always[1, inf](a.p)")) == 1
    assert horizon(parse("always[0, 20](eventually[0, 10](a.p)) and always(b.q until[2, 50] a.p)")) == 50
    assert horizon(parse("always[0, 20](eventually[0, 10](a.p))")) == 30


def test_mentions_are_where_they_stand():
    text = "always(a.x[1] < 1 and\n  b.y < 2)"
    assert [(m.signal, text[m.at : m.at + 3]) for m in mentions(parse(text))] == [("a.x", "a.x"), ("b.y", "b.y")]
