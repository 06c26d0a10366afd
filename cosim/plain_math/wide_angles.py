"""The remainder of an angle of any size modulo a quarter turn, after Payne and Hanek (1983).

|x| = M 2^e with a whole number M below 2^53. Of 2/pi only those bits count whose product with M 2^e is no multiple of
4: a window of 224 bits, as the remainder of a float64 may begin with 62 zeros.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from cosim.plain_math.operations import bits, pick, select, whole
from cosim.plain_math.pairs import added, joined, multiplied

#: 2/pi, to so many bits behind the point.
TWO_OVER_PI_BITS = 1260
TWO_OVER_PI = int(
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a424dd2e006492eea09d1921cfe1deb1cb"
    "129a73ee88235f52ebb4484e99c7026b45f7e413991d639835339f49c845f8bbdf9283b1ff897ffde05980fef2f118b5a0a6d1f6d"
    "367ecf27cb09b74f463f669e5fea2d7527bac7ebe5f17b3d0739f78a5292ea6bfb5fb11f8d5d0856033046fc7b6babf0cfbc209af",
    16,
)
_LIMB = 28
_MASK = (1 << _LIMB) - 1
_BEFORE = 1077  # zeros before the point, so that the smallest numbers need no other way
_LIMBS = (_BEFORE + TWO_OVER_PI_BITS) // _LIMB + 1
_TABLE = tuple(
    (TWO_OVER_PI << (_LIMBS * _LIMB - _BEFORE - TWO_OVER_PI_BITS)) >> (_LIMB * (_LIMBS - 1 - k)) & _MASK
    for k in range(_LIMBS)
)
_WINDOW = 8  # limbs
_HALF_PI, _HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17


def quarters(x: Any) -> tuple[Any, Any, Any]:
    """An integer that is n modulo 4, and r as the sum of two, with x = n pi/2 + r. x: finite."""
    word = bits(abs(x))
    start = word >> 52
    first = (start * 2341) >> 16  # start / 28
    shift = start - first * _LIMB
    limbs = [pick(_TABLE, first + k) for k in range(_WINDOW + 1)]
    window = [((a << shift) & _MASK) | (b >> (_LIMB - shift)) for a, b in pairwise(limbs)]
    mantissa = (word & ((1 << 52) - 1)) | (1 << 52)
    low, high = mantissa & _MASK, mantissa >> _LIMB
    columns = [low * a + high * b for a, b in pairwise(window)]
    for k in range(len(columns) - 1, 0, -1):
        columns[k - 1] = columns[k - 1] + (columns[k] >> _LIMB)
        columns[k] = columns[k] & _MASK
    turned = columns[0] & _MASK
    n = (turned + (1 << 25)) >> 26
    parts = [whole(turned - (n << 26)), *map(whole, columns[1:5])]
    r, tail = _angle([part * 2.0 ** (-26 - _LIMB * k) for k, part in enumerate(parts)])
    return select(x < 0.0, 0 - n, n), select(x < 0.0, -r, r), select(x < 0.0, -tail, tail)


def _angle(parts: list[Any]) -> tuple[Any, Any]:
    """The sum of parts of a quarter turn, as an angle of two parts."""
    total, rest = added(parts[0], parts[1])
    total, second = added(total, parts[2])
    total, third = added(total, parts[3])
    total, rest = joined(total, (rest + second) + (third + parts[4]))
    high, low = multiplied(total, _HALF_PI)
    return joined(high, low + (total * _HALF_PI_REST + rest * _HALF_PI))
