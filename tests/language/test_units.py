"""Unit expressions against the definitions of the SI."""

import math

import pytest

from cosim.errors import WrongUnit
from cosim.language.units import BASES, base, same

UNITS = [
    ("1", {}, 1.0),
    ("%", {}, 0.01),
    ("kg", {"kg": 1}, 1.0),
    ("g", {"kg": 1}, 1e-3),
    ("m/s2", {"m": 1, "s": -2}, 1.0),
    ("m/s^2", {"m": 1, "s": -2}, 1.0),
    ("m/s**2", {"m": 1, "s": -2}, 1.0),
    ("m.s-2", {"m": 1, "s": -2}, 1.0),
    ("m/s/s", {"m": 1, "s": -2}, 1.0),
    ("m/(s.s)", {"m": 1, "s": -2}, 1.0),
    ("kg.m2", {"kg": 1, "m": 2}, 1.0),
    ("kg*m2", {"kg": 1, "m": 2}, 1.0),
    ("kg·m2", {"kg": 1, "m": 2}, 1.0),
    (" kg * m2 ", {"kg": 1, "m": 2}, 1.0),
    ("kg.m2/(s2.K)", {"kg": 1, "m": 2, "s": -2, "K": -1}, 1.0),
    ("N", {"kg": 1, "m": 1, "s": -2}, 1.0),
    ("N.m", {"kg": 1, "m": 2, "s": -2}, 1.0),
    ("1/s", {"s": -1}, 1.0),
    ("Hz", {"s": -1}, 1.0),
    ("rad/s", {"rad": 1, "s": -1}, 1.0),
    ("deg", {"rad": 1}, math.pi / 180),
    ("rpm", {"rad": 1, "s": -1}, math.pi / 30),
    ("rev/min", {"rad": 1, "s": -1}, math.pi / 30),
    ("km/h", {"m": 1, "s": -1}, 1 / 3.6),
    ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    ("mV/A", {"kg": 1, "m": 2, "s": -3, "A": -2}, 1e-3),
    ("Wb/s", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    ("C/F", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    ("H.A/s", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    ("T.m2/s", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    ("Ohm.S", {}, 1.0),
    ("mm", {"m": 1}, 1e-3),
    ("µm", {"m": 1}, 1e-6),
    ("mm2", {"m": 2}, 1e-6),
    ("cd", {"cd": 1}, 1.0),
    ("mol/l", {"mol": 1, "m": -3}, 1e3),
    ("min", {"s": 1}, 60.0),
    ("Pa", {"kg": 1, "m": -1, "s": -2}, 1.0),
    ("kWh", {"kg": 1, "m": 2, "s": -2}, 3.6e6),
    ("degC/s", {"K": 1, "s": -1}, 1.0),
]


@pytest.mark.parametrize(("word", "symbol"), [("metre", "m"), ("Meters", "m"), ("degrees", "deg"), ("seconds", "s")])
def test_a_word_for_a_unit_is_answered_with_its_symbol(word, symbol):
    with pytest.raises(WrongUnit, match=f"unknown unit `{word}`") as caught:
        base(f"{word}/s")
    assert caught.value.fix == f"did you mean `{symbol}`?"


@pytest.mark.parametrize(("text", "exponents", "factor"), UNITS)
def test_base(text, exponents, factor):
    unit = base(text)
    assert dict(zip(BASES, unit.exponents, strict=True)) == {b: exponents.get(b, 0) for b in BASES}
    assert unit.factor == pytest.approx(factor, rel=1e-14)
    assert unit.offset == 0.0


@pytest.mark.parametrize("text", ["degC", "°C", "(degC)"])
def test_an_offset_counts_for_the_unit_alone(text):
    assert base(text).offset == 273.15


def test_fahrenheit():
    unit = base("degF")
    assert unit.factor * 212 + unit.offset == pytest.approx(373.15)
    assert unit.factor * 32 + unit.offset == pytest.approx(273.15)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ("N.m", "J", True),
        ("m/s", "s-1.m", True),
        ("1/s", "Hz", True),
        ("km/h", "m/s", False),
        ("m", "mm", False),
        ("rad/s", "1/s", False),
        ("degC", "K", False),
        ("deg", "rad", False),
        (None, "m", True),
        ("m", None, True),
        (("m", "m", "rad"), ("m", "m", "rad"), True),
        (("m", "m", "rad"), ("m", "m", "deg"), False),
        (("m", "m"), ("m", "m", "m"), False),
        (("m", "m"), "m", True),
        ("m", ("m", "rad"), False),
    ],
)
def test_same(a, b, expected):
    assert same(a, b) is expected
    assert same(b, a) is expected


@pytest.mark.parametrize(
    ("text", "fix"),
    [
        ("", 'such as "m/s2"'),
        ("m//s", 'such as "m/s2"'),
        ("m s", 'such as "m/s2"'),
        ("m.", 'such as "m/s2"'),
        ("(m", 'such as "m/s2"'),
        ("m)", 'such as "m/s2"'),
        ("m^", 'such as "m/s2"'),
        ("3", 'such as "m/s2"'),
        ("m/s!", 'such as "m/s2"'),
        ("Nm", "did you mean `N.m`?"),
        ("rads", "did you mean `rad.s`?"),
        ("xyz", "one of: %, 1, A"),
        ("Ohms", "did you mean `Ohm.s`?"),
        ("kdeg", "did you mean `deg`?"),
    ],
)
def test_unknown(text, fix):
    with pytest.raises(WrongUnit) as caught:
        base(text)
    assert f"`{text}`" in caught.value.message
    assert fix in caught.value.fix
