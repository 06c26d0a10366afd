"""Unit expressions such as "m/s2", "kg.m2", "N*m" or "1/s", read as exponents over FMI's base units.

Grammar: factors joined by `.`, `*` or `/` (from left to right), parentheses, and integer powers written `m2`, `m^2`,
`m**2` or `s-1`. A symbol may have one SI prefix. FMI 2.0.4 and 3.0, section "BaseUnit": the bases are kg, m, s, A, K,
mol, cd and rad; a value in the unit is `factor * value + offset` in base units.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache

from cosim.errors import WrongUnit, nearest

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Unit = str | tuple[str, ...] | None


@dataclass(frozen=True)
class BaseUnit:
    """A unit in FMI's terms. exponents: one for each of `BASES`."""

    exponents: tuple[int, ...] = (0,) * len(BASES)
    factor: float = 1.0
    offset: float = 0.0

    def times(self, other: BaseUnit, power: int) -> BaseUnit:
        """The product with a power of another unit; offsets have no meaning in products."""
        exponents = tuple(a + power * b for a, b in zip(self.exponents, other.exponents, strict=True))
        return BaseUnit(exponents, self.factor * other.factor**power)


def _unit(factor: float = 1.0, offset: float = 0.0, **exponents: int) -> BaseUnit:
    return BaseUnit(tuple(exponents.get(base, 0) for base in BASES), factor, offset)


_PREFIXES = {
    **{"Y": 1e24, "Z": 1e21, "E": 1e18, "P": 1e15, "T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "h": 1e2, "da": 1e1},
    **{"d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15, "a": 1e-18},
}
_PREFIXED = {
    "m": _unit(m=1),
    "s": _unit(s=1),
    "g": _unit(1e-3, kg=1),
    "A": _unit(A=1),
    "K": _unit(K=1),
    "mol": _unit(mol=1),
    "cd": _unit(cd=1),
    "rad": _unit(rad=1),
    "Hz": _unit(s=-1),
    "N": _unit(kg=1, m=1, s=-2),
    "Pa": _unit(kg=1, m=-1, s=-2),
    "bar": _unit(1e5, kg=1, m=-1, s=-2),
    "J": _unit(kg=1, m=2, s=-2),
    "W": _unit(kg=1, m=2, s=-3),
    "C": _unit(A=1, s=1),
    "V": _unit(kg=1, m=2, s=-3, A=-1),
    "F": _unit(kg=-1, m=-2, s=4, A=2),
    "Ohm": _unit(kg=1, m=2, s=-3, A=-2),
    "ohm": _unit(kg=1, m=2, s=-3, A=-2),
    "Ω": _unit(kg=1, m=2, s=-3, A=-2),
    "S": _unit(kg=-1, m=-2, s=3, A=2),
    "Wb": _unit(kg=1, m=2, s=-2, A=-1),
    "T": _unit(kg=1, s=-2, A=-1),
    "H": _unit(kg=1, m=2, s=-2, A=-2),
    "l": _unit(1e-3, m=3),
    "L": _unit(1e-3, m=3),
    "eV": _unit(1.602176634e-19, kg=1, m=2, s=-2),
    "Wh": _unit(3600.0, kg=1, m=2, s=-2),
}
_EXACT = {
    "1": _unit(),
    "%": _unit(0.01),
    "ppm": _unit(1e-6),
    "deg": _unit(math.pi / 180, rad=1),
    "°": _unit(math.pi / 180, rad=1),
    "rev": _unit(2 * math.pi, rad=1),
    "rpm": _unit(2 * math.pi / 60, rad=1, s=-1),
    "min": _unit(60.0, s=1),
    "h": _unit(3600.0, s=1),
    "d": _unit(86400.0, s=1),
    "t": _unit(1e3, kg=1),
    "degC": _unit(1.0, 273.15, K=1),
    "°C": _unit(1.0, 273.15, K=1),
    "degF": _unit(5 / 9, 273.15 - 32 * 5 / 9, K=1),
    "in": _unit(0.0254, m=1),
    "ft": _unit(0.3048, m=1),
    "lb": _unit(0.45359237, kg=1),
}
#: Words that people write for a symbol; also with an s at the end.
_WORDS = {
    **{"metre": "m", "meter": "m", "second": "s", "sec": "s", "minute": "min", "hour": "h", "hr": "h", "day": "d"},
    **{"gram": "g", "kilogram": "kg", "kilo": "kg", "tonne": "t", "ton": "t", "litre": "l", "liter": "l"},
    **{"radian": "rad", "degree": "deg", "revolution": "rev", "newton": "N", "pascal": "Pa", "joule": "J"},
    **{"watt": "W", "volt": "V", "ampere": "A", "amp": "A", "hertz": "Hz", "kelvin": "K", "celsius": "degC"},
    **{"inch": "in", "foot": "ft", "feet": "ft", "percent": "%", "none": "1"},
}
_TOKEN = re.compile(
    r"\s*(?:(?P<symbol>[^\W\d_]+|[°%][^\W\d_]*|1(?![0-9]))(?:(?:\^|\*\*)?(?P<power>[-+]?[0-9]{1,2}))?|(?P<sign>[*./·()]))\s*"
)


def base(unit: str) -> BaseUnit:
    """The unit in FMI's base units.

    Raises: WrongUnit.
    """
    return _read(unit)


def same(a: Unit, b: Unit) -> bool:
    """Whether two units have the same dimension, factor and offset, element by element where they are tuples.

    None says nothing, and agrees with all. Raises: WrongUnit.
    """
    if a is None or b is None:
        return True
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, tuple):
        return all(same(element, b) for element in a)
    if isinstance(b, tuple):
        return same(b, a)
    one, other = base(a), base(b)
    close = math.isclose(one.factor, other.factor, rel_tol=1e-12) and math.isclose(one.offset, other.offset)
    return one.exponents == other.exponents and close


_LONGEST = 200


@lru_cache(maxsize=1024)
def _read(text: str) -> BaseUnit:
    if len(text) > _LONGEST:
        raise WrongUnit(f"a unit of {len(text)} characters is too long", fix=f"at most {_LONGEST}")
    tokens = list(_tokens(text))
    unit, rest = _product(text, tokens)
    if rest:
        raise _broken(text)
    return unit


def _tokens(text: str) -> list[re.Match[str]]:
    tokens = []
    end = 0
    while end < len(text):
        match = _TOKEN.match(text, end)
        if not match:
            raise _broken(text)
        tokens.append(match)
        end = match.end()
    return tokens


def _product(text: str, tokens: list[re.Match[str]]) -> tuple[BaseUnit, list[re.Match[str]]]:
    """The product that the tokens begin with, and the tokens after it."""
    unit, power = BaseUnit(), 1
    while True:
        factor, tokens = _factor(text, tokens)
        alone = power == 1 and unit == BaseUnit() and not (tokens and tokens[0]["sign"] in tuple("*./·"))
        unit = factor if alone else unit.times(factor, power)
        if not tokens or tokens[0]["sign"] == ")":
            return unit, tokens
        if tokens[0]["sign"] in (None, "("):
            raise _broken(text)
        power, tokens = (-1 if tokens[0]["sign"] == "/" else 1), tokens[1:]


def _factor(text: str, tokens: list[re.Match[str]]) -> tuple[BaseUnit, list[re.Match[str]]]:
    if not tokens:
        raise _broken(text)
    token, rest = tokens[0], tokens[1:]
    if token["sign"] == "(":
        unit, rest = _product(text, rest)
        if not rest or rest[0]["sign"] != ")":
            raise _broken(text)
        return unit, rest[1:]
    if token["sign"]:
        raise _broken(text)
    unit = _symbol(token["symbol"], text)
    return (BaseUnit().times(unit, int(token["power"])) if token["power"] else unit), rest


def _symbol(symbol: str, text: str) -> BaseUnit:
    if unit := _known(symbol):
        return unit
    product = next((f"{symbol[:k]}.{symbol[k:]}" for k in range(1, len(symbol)) if _is_product(symbol, k)), None)
    word = symbol.lower()
    product = _WORDS.get(word) or _WORDS.get(word.removesuffix("s")) or product
    known = f"did you mean `{product}`?" if product else nearest(symbol, [*_EXACT, *_PREFIXED, "kg", "mm", "km"])
    raise WrongUnit(f"unknown unit `{symbol}` in `{text}`", fix=known)


def _known(symbol: str) -> BaseUnit | None:
    if unit := _EXACT.get(symbol) or _PREFIXED.get(symbol):
        return unit
    for prefix, factor in _PREFIXES.items():
        unit = _PREFIXED.get(symbol.removeprefix(prefix)) if symbol.startswith(prefix) else None
        if unit:
            return BaseUnit(unit.exponents, unit.factor * factor)
    return None


def _is_product(symbol: str, k: int) -> bool:
    return bool(_known(symbol[:k]) and _known(symbol[k:]))


def _broken(text: str) -> WrongUnit:
    return WrongUnit(f"`{text}` is not a unit", fix='such as "m/s2", "kg.m2" or "1" for none')
