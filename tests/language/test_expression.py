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
    ("(" * 400, "neither a number nor", "arithmetic"),
    ("1+" * 600 + "1", "too long", "at most 1000"),
    ("2^3", "`^` in `2^3` is not a power", "write `**`"),
    ("pie", "unknown name `pie`", "did you mean `pi`?"),
    ("sqr(2)", "unknown function `sqr`", "did you mean `sqrt`?"),
    ("sqrt", "function `sqrt` in `sqrt` has no argument", "write `sqrt(…)`"),
    ("sin(1, 2)", "cannot be evaluated", "check its values"),
    ("1/0", "division by zero", "check its values"),
    ("log(0)", "cannot be evaluated", "check its values"),
    ("floor(inf)", "cannot be evaluated", "check its values"),
    ("9**9**9", "cannot be evaluated", "check its values"),
    ("1" + "0" * 400, "too large", "at most 1e308"),
    ("inf - inf", "not a real number", "even roots"),
    ("(-1)**0.5", "not a real number", "even roots"),
    ("True", "is not arithmetic", "numbers, + -"),
    ("'a'", "is not arithmetic", "numbers, + -"),
    ("1j", "is not arithmetic", "numbers, + -"),
    ("1 < 2", "is not arithmetic", "numbers, + -"),
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


@given(st.text("0123456789.+-*/%()eipNsqrt, ^", max_size=30))
def test_any_text_has_a_value_or_a_typed_error(text):
    try:
        value = evaluate(text, {"i": 2, "N": 6})
    except CosimError as error:
        assert isinstance(error, ExpressionError)
        assert error.fix
    else:
        assert not math.isnan(value)
