"""Arithmetic in diagrams: values by Python's own arithmetic, refusals with the fix."""

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import CosimError, ExpressionError, Position
from cosim.language.expression import evaluate, names

VALUES = [
    ("1e-3", 1e-3),
    ("  2 + 3*4 ", 14.0),
    ("-(2 - 5)", 3.0),
    ("+7 // 2", 3.0),
    ("-7 % 3", 2.0),
    ("2**-1", 0.5),
    ("2**3**2", 512.0),
    ("pi/3", math.pi / 3),
    ("e", math.e),
    ("-inf", -math.inf),
    ("sin(pi/6)", math.sin(math.pi / 6)),
    ("cos(1) + tan(1)", math.cos(1) + math.tan(1)),
    ("asin(1)", math.pi / 2),
    ("acos(0) - atan(1)", math.pi / 4),
    ("atan2(1, -1)", 3 * math.pi / 4),
    ("sqrt(2)*exp(1)*log(2)", math.sqrt(2) * math.exp(1) * math.log(2)),
    ("abs(-2) + min(1, 2) + max(1, 2, 3)", 6.0),
    ("floor(1.5) + ceil(1.5)", 3.0),
    ("1_000*2 + 12_345_678", 12_347_678.0),
    ("sinh(1) - cosh(1) + tanh(1)", math.sinh(1) - math.cosh(1) + math.tanh(1)),
    ("asinh(1) + acosh(2) + atanh(0.5)", math.asinh(1) + math.acosh(2) + math.atanh(0.5)),
    ("log2(8) + log10(100) + log(81, 3)", 9.0),
    ("sign(-3) + 10*sign(0) + 100*sign(2)", 99.0),
    ("hypot(3, -4) + hypot(3e300, 4e300)/1e300 + hypot(3e-320, 4e-320)*0", 10.0),
    ("hypot(0, 0) + hypot(0, -2)", 2.0),
    ("floor(-0.5) + ceil(-1.5) + floor(1e300)/1e300", -1.0),
    ("floor(-inf)", -math.inf),
    ("if(1 < 2, 3, 4) + (5 if 1 >= 2 else 6)", 9.0),
    ("if(2 > 1, 1, 1/0)", 1.0),
    ("1 if 1 < 2 < 3 <= 3 != 4 else 0", 1.0),
    ("1 if 1 < 2 < 1 else 0", 0.0),
    ("1 if 2 == 2 and not 2 > 3 or 1/0 > 0 else 0", 1.0),
    ("1 if 3 < 2 and 1/0 > 0 else 2 if(1 > 0) else 3", 2.0),
    ("if(if(1 > 0, 2 > 1, 1 > 2), if (1 > 2, 3, 4), 5)", 4.0),
    ("2 *\n  3", 6.0),
    ("+".join(["1"] * 500), 500.0),
    ("(" * 50 + "1" + ")" * 50, 1.0),
]


@pytest.mark.parametrize(("text", "value"), VALUES)
def test_value(text, value):
    result = evaluate(text)
    assert type(result) is float
    assert result == pytest.approx(value, rel=1e-15)


def test_names_of_the_caller_win_over_constants():
    assert evaluate("2*pi*i/N", {"i": 3, "N": 6}) == pytest.approx(math.pi)
    assert evaluate("e", {"e": 5}) == 5.0


def test_one_text_has_a_value_for_each_member():
    assert [evaluate("i**2", {"i": i}) for i in (1, 2, 3)] == [1.0, 4.0, 9.0]


def test_names_that_an_expression_uses():
    assert names("sin(2*pi*i/N)") == {"sin", "pi", "i", "N"}
    assert names("i +") == frozenset()


def test_what_python_would_warn_of_stays_quiet(recwarn):
    with pytest.raises(ExpressionError):
        evaluate("1if 2else 3")
    assert not recwarn.list


REFUSED = [
    ("", "neither a number nor", 'write a number, or arithmetic such as "2*pi/3"'),
    ("1 +", "neither a number nor", "arithmetic"),
    ("four robots", "neither a number nor", "arithmetic"),
    ("a\0b", "neither a number nor", "arithmetic"),
    ("(" * 400, "neither a number nor", "close each bracket"),
    ("1+" * 600 + "1", "too long", "at most 1000"),
    ("2^3", "`^` in `2^3` is not a power", "write `**`"),
    ("pie", "unknown name `pie`", "did you mean `pi`?"),
    ("sqr(2)", "unknown function `sqr`", "did you mean `sqrt`?"),
    ("sqrt", "function `sqrt` in `sqrt` has no argument", "write `sqrt(…)`"),
    ("sin(1, 2)", "`sin` is a function of 1 number, not of 2", "write sin(a)"),
    ("min(1)", "`min` is a function of 2 numbers or more, not of 1", "write min(a, b)"),
    ("log(1, 2, 3)", "`log` is a function of 1 or 2 numbers, not of 3", "write log(a)"),
    ("atan2(1)", "`atan2` is a function of 2 numbers, not of 1", "write atan2(a, b)"),
    ("1/0", "division by zero", "check its values"),
    ("log(0)", "cannot be evaluated", "check its values"),
    ("9**9**9", "cannot be evaluated", "check its values"),
    ("1" + "0" * 400, "too large", "at most 1.7e308"),
    ("1e400", "a number in `1e400` is too large", "at most 1.7e308"),
    ("2 + 0.3e-400", "is too small", "from 5e-324"),
    ("inf - inf", "not a real number", "even roots"),
    ("((-1)**0.5)**0", "not a real number", "even roots"),
    ("1**min(2, (-1)**0.5)", "not a real number", "even roots"),
    ("(-1)**0.5", "not a real number", "even roots"),
    ("True", "is not arithmetic", "numbers, + -"),
    ("'a'", "is not arithmetic", "numbers, + -"),
    ("1j", "is not arithmetic", "numbers, + -"),
    ("1 < 2", "`1 < 2` is a truth value, not a number", "write if(condition, 1, 0)"),
    ("(1 < 2)*3", "`1 < 2` is a truth value, not a number", "write if(condition, 1, 0)"),
    ("if(i, 1, 2)", "`i` in `if(i, 1, 2)` is a number where a condition stands", "compare it"),
    ("if(2*i, 1, 2)", "`2*i` is a number where a condition stands", "compare it"),
    ("if(i > 1, 2)", "`if(i > 1, 2)` has not three parts", "write if(condition, a, b)"),
    ("if()", "`if()` has not three parts", "write if(condition, a, b)"),
    ("2 if i > 1", "neither a number nor", "write a number"),
    ("i in (1, 2)", "is not arithmetic", "numbers, + -"),
    ("if(inf - inf > 0, 1, 2)", "not a real number", "even roots"),
    ("i && 1", "neither a number nor", "write `and`"),
    ("i & 1", "`i & 1` is not arithmetic", "write `and`"),
    ("i | 1", "`i | 1` is not arithmetic", "write `or`"),
    ("~i", "`~i` is not arithmetic", "write `not`"),
    ("!i", "neither a number nor", "write `not`"),
    ("i ? 1 : 2", "neither a number nor", "write if(condition, a, b)"),
    ("i = 2", "neither a number nor", "compare with `==`"),
    ("2i", "neither a number nor", "write 2*i"),
    ("2 sin(i)", "neither a number nor", "write 2*sin"),
    ("ln(i)", "unknown function `ln`", "write log(a)"),
    ("2(i)", "`2(i)` is not arithmetic", "write `*` before the bracket"),
    ("i(2)", "unknown function `i`", "write i*(…) for a product; functions are sin,"),
    ("(i + 1)(2)", "`(i + 1)(2)` is not arithmetic", "write `*` before the bracket"),
    ("i − 1", "neither a number nor", "the minus sign of the keyboard"),
    ("2×i", "neither a number nor", "write `*`"),
    ("i²", "neither a number nor", "write `**2`"),
    ("i ≤ 2", "neither a number nor", "write `<=`"),
    ("lambda + 1", "neither a number nor", "`lambda` is a word of Python"),
    ("2*(i", "neither a number nor", "close each bracket"),
    ("2*i)", "neither a number nor", "more closing brackets"),
    ("1 # one", "neither a number nor", "leave out `#`"),
    ("1 # one\n + 2", "neither a number nor", "leave out `#`"),
    ("plant.x", "`plant.x` is not arithmetic", "read by an input only"),
    ("x[1]", "`x[1]` is not arithmetic", "read by an input only"),
    ("-" * 60 + "1", "is nested more than 50 levels deep", "use fewer levels"),
    ("1**" * 60 + "1", "is nested more than 50 levels deep", "use fewer levels"),
    ("x" * 100, f"unknown name `{'x' * 100}` in `{'x' * 59}…`", "pi"),
    ("[1]", "is not arithmetic", "numbers, + -"),
    ("(1).real", "is not arithmetic", "numbers, + -"),
    ("min(*[1])", "is not arithmetic", "numbers, + -"),
    ("max(1, key=2)", "is not arithmetic", "numbers, + -"),
    ("().__class__.__bases__[0]", "is not arithmetic", "numbers, + -"),
    ("__import__('os').getcwd()", "is not arithmetic", "numbers, + -"),
    ("lambda: 1", "is not arithmetic", "numbers, + -"),
]


@pytest.mark.parametrize(("text", "message", "fix"), REFUSED)
def test_refused(text, message, fix):
    place = Position("a.yaml", 3, 4)
    with pytest.raises(ExpressionError) as caught:
        evaluate(text, {"i": 1}, place)
    assert message in caught.value.message
    assert fix in caught.value.fix
    assert caught.value.position == place


def test_a_misspelt_name_of_the_caller():
    with pytest.raises(ExpressionError) as caught:
        evaluate("gian*2", {"gain": 1})
    assert caught.value.fix == "did you mean `gain`?"


def test_a_huge_power_is_refused_at_once():
    began = time.perf_counter()
    with pytest.raises(ExpressionError):
        evaluate("99999**99999**99999")
    assert time.perf_counter() - began < 0.5


def test_nothing_is_evaluated_but_what_a_condition_chooses():
    assert [evaluate("if(i > 1, 1/(i - 1), 0)", {"i": i}) for i in (1, 2, 3)] == [0.0, 1.0, 0.5]
    assert evaluate("if(i == 1 or 1/(i - 1) > 1, 2, 3)", {"i": 1}) == 2.0


@given(st.text("0123456789.+-*/%()eipNsqrt, ^<>=fandotlse", max_size=30))
def test_any_text_has_a_value_or_a_typed_error(text):
    try:
        value = evaluate(text, {"i": 2, "N": 6})
    except CosimError as error:
        assert isinstance(error, ExpressionError)
        assert error.fix
    else:
        assert not math.isnan(value)
