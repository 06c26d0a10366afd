"""Numbers as kernels have them.

float64 (IEEE 754, so that 1/0 is infinite and sqrt(-1) is NaN) is numpy's; integers have 64 bits and wrap; truth values
count as 0 and 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from cosim.compiling.interpreted.libm import as_compiled

_SIGN, _MODULUS = 1 << 63, 1 << 64
_REPEATED = 0x10000  # up to this exponent, an integer power is a repeated product


def checked(value: int) -> Integer:
    """An integer that is known to have 64 bits."""
    return int.__new__(Integer, value)


def number(value: Any) -> Any:
    """What a kernel makes of a constant, or of an element that it reads."""
    if type(value) is np.float64:
        return value
    if isinstance(value, (bool, np.bool_)):
        return truth(value)
    if isinstance(value, (int, np.integer)):
        return Integer(value)
    if isinstance(value, (float, np.floating)):
        return np.float64(value)
    return value


def truth(value: Any) -> Any:
    """A truth value that counts as in kernels; anything else that a comparison gives as it is."""
    return Truth(value) if isinstance(value, (bool, np.bool_)) else value


def exponent(value: Any) -> Any:
    """What stands behind `**`: a real number there computes the power itself, as numpy would ask the C library."""
    return _Exponent(value) if isinstance(value, float) else value


def plain(value: Any) -> Any:
    """A number as numpy knows it."""
    return int(value) if isinstance(value, Integer) else value


class Integer(int):
    """A 64-bit integer."""

    __array_ufunc__ = None  # so that numpy's numbers leave the operation to this class

    def __new__(cls, value: Any = 0) -> Self:
        """Raises: OverflowError for what is no 64-bit integer, NaN among it."""
        if not -_SIGN <= value < _SIGN:
            raise OverflowError("no 64-bit integer")
        return super().__new__(cls, value)

    def __truediv__(self, other: Any) -> Any:
        return np.float64(self) / np.float64(other) if isinstance(other, (int, float, np.integer)) else NotImplemented

    def __rtruediv__(self, other: Any) -> Any:
        return np.float64(other) / np.float64(self) if isinstance(other, (int, float, np.integer)) else NotImplemented

    def __pow__(self, other: Any, modulus: Any = None) -> Any:
        if isinstance(other, float):
            return np.float64(as_compiled("pow", 2)(float(self), float(other)))
        if not 0 <= other <= _REPEATED:
            raise ValueError(f"an integer to a power below 0 or above {_REPEATED}")
        return _wrapped(pow(int(self), int(other), _MODULUS))

    def __rpow__(self, other: Any, modulus: Any = None) -> Any:
        return _power(np.float64(other), self) if isinstance(other, float) else Integer(other) ** self

    def __lshift__(self, other: Any) -> Any:
        return _wrapped(int(self) << _places(other))

    def __rlshift__(self, other: Any) -> Any:
        return _wrapped(int(other) << _places(self))

    def __rshift__(self, other: Any) -> Any:
        return Integer(int(self) >> _places(other))

    def __rrshift__(self, other: Any) -> Any:
        return Integer(int(other) >> _places(self))

    def __divmod__(self, other: Any) -> Any:
        return self // other, self % other

    def __rdivmod__(self, other: Any) -> Any:
        return other // self, other % self

    def __neg__(self) -> Integer:
        return _wrapped(-int(self))

    def __abs__(self) -> Integer:
        return _wrapped(abs(int(self)))

    def __invert__(self) -> Integer:
        return Integer(~int(self))

    def __pos__(self) -> Integer:
        return self

    def view(self, dtype: Any) -> Any:
        """The same 64 bits as a number of another type."""
        return number(np.int64(self).view(dtype))

    __hash__ = int.__hash__


class _Exponent(np.float64):
    """A real number, to whose power others are raised as kernels do."""

    def __rpow__(self, base: Any) -> Any:  # type: ignore[override]  # numpy's gives complex numbers, too
        return np.float64(as_compiled("pow", 2)(float(base), float(self)))


class Truth(Integer):
    """A truth value, which counts as 0 or 1: what `bool` is to interpreted functions."""

    def __new__(cls, value: Any = False) -> Truth:  # noqa: PYI034  # no other
        """One of the two that there are."""
        return _TRUTHS[1 if value else 0]


_TRUTHS = tuple(int.__new__(Truth, value) for value in range(2))


def _wrapped(value: int) -> Integer:
    return checked((value + _SIGN) % _MODULUS - _SIGN)


def _places(value: Any) -> int:
    if not 0 <= value < 64:
        raise ValueError("a shift by less than 0 or more than 63 places")
    return int(value)


def _power(base: np.float64, exponent: int) -> np.float64:
    """An integer power: a repeated product, as kernels have it."""
    if base == 0.0 and exponent < 0:
        raise ZeroDivisionError("0.0 to a negative integer power")
    left = abs(int(exponent))
    if left > _REPEATED:
        return np.float64(as_compiled("pow", 2)(base, float(exponent)))
    result, factor = np.float64(1.0), base
    while left:
        if left & 1:
            result = result * factor
        left >>= 1
        factor = factor * factor
    return np.float64(1.0) / result if exponent < 0 else result


def _binary(name: str, swapped: bool) -> Callable[[Any, Any], Any]:
    operation = getattr(int, f"__{name}__")
    real = getattr(np.float64, f"__{name}__")
    divides = name in ("floordiv", "mod")

    def compute(self: Any, other: Any) -> Any:
        if isinstance(other, (int, np.integer, np.bool_)):
            a, b = (int(other), int(self)) if swapped else (int(self), int(other))
            if divides and (a, b) == (-_SIGN, -1):
                raise OverflowError("no 64-bit integer")
            return _wrapped(operation(a, b))
        if isinstance(other, float):
            x, y = np.float64(self), np.float64(other)
            return real(y, x) if swapped else real(x, y)
        return NotImplemented

    return compute


def _compared(name: str) -> Callable[[Any, Any], Any]:
    exact, real = getattr(int, f"__{name}__"), getattr(float, f"__{name}__")

    def compare(self: Any, other: Any) -> Any:
        return real(float(self), float(other)) if isinstance(other, float) else exact(self, other)

    return compare


for _name in ("add", "sub", "mul", "floordiv", "mod"):
    setattr(Integer, f"__{_name}__", _binary(_name, swapped=False))
    setattr(Integer, f"__r{_name}__", _binary(_name, swapped=True))
for _name in ("lt", "le", "eq", "ne", "gt", "ge"):
    setattr(Integer, f"__{_name}__", _compared(_name))
for _name in ("and", "or", "xor"):
    for _prefix in ("", "r"):
        _bits = getattr(int, f"__{_name}__")
        setattr(Integer, f"__{_prefix}{_name}__", lambda self, other, bits=_bits: Integer(bits(int(self), int(other))))
