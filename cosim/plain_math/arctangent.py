"""The angle of a point: atan(q) for |q| <= tan(pi/8), and a multiple of pi/4, which the point's place says.

With a the larger, b the smaller of |x| and |y|, q is b / a, or (b - a) / (b + a), in two parts. The polynomial is that
of fdlibm's s_atan.c (Sun Microsystems, 1993).
"""

from __future__ import annotations

import math
from typing import Any

from cosim.plain_math.operations import bits, polynomial, select, signed
from cosim.plain_math.pairs import added, joined, multiplied

_SERIES = (
    *(-3.33333333333329318027e-01, 1.99999999998764832476e-01, -1.42857142725034663711e-01, 1.11111104054623557880e-01),
    *(-9.09088713343650656196e-02, 7.69187620504482999495e-02, -6.66107313738753120669e-02, 5.83357013379057348645e-02),
    *(-4.97687799461593236017e-02, 3.65315727442169155270e-02, -1.62858201153657823623e-02),
)
_PI, _PI_REST = 3.141592653589793, 1.2246467991473532e-16
_THREE = (2.356194490192345, 9.184850993605148e-17)  # 3 pi / 4
_STEEP = 0.41421356237309503  # tan(pi/8)


def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y), within 0.8 ulp."""
    wide, tall = abs(x), abs(y)
    swapped = tall > wide
    a, b = _scaled(select(swapped, tall, wide), select(swapped, wide, tall))
    steep = b > _STEEP * a
    top, top_rest = added(b, -a)
    bottom, bottom_rest = added(b, a)
    top, top_rest = select(steep, top, b), select(steep, top_rest, 0.0)
    bottom, bottom_rest = select(steep, bottom, a), select(steep, bottom_rest, 0.0)
    inverse = 1.0 / bottom
    q = top * inverse
    product, product_rest = multiplied(q, bottom)
    q_rest = (((top - product) - product_rest) + (top_rest - q * bottom_rest)) * inverse
    z = q * q
    small = (q_rest - z * q_rest) + q * (z * polynomial(z, _SERIES))
    behind = bits(x) < 0
    # In turns of pi: atan(b/a), or a half less that, or one less all that.
    turns = select(steep, 0.25, 0.0)
    turns = select(swapped, 0.5 - turns, turns)
    turns = select(behind, 1.0 - turns, turns)
    back = swapped ^ behind
    q, small = select(back, -q, q), select(back, -small, small)
    three = turns == 0.75  # times pi is the one that is rounded
    angle, rest = joined(select(three, _THREE[0], turns * _PI), q)
    angle = angle + (rest + (small + select(three, _THREE[1], turns * _PI_REST)))
    return select((x != x) | (y != y), math.nan, signed(angle, y))  # noqa: PLR0124  # NaN alone


def _scaled(a: Any, b: Any) -> tuple[Any, Any]:
    """The larger and the smaller, with the same ratio where that is a number at all, so that nothing overflows."""
    both = b == math.inf
    endless = a == math.inf
    a, b = select(endless, 1.0, a), select(endless, select(both, 1.0, 0.0), b)
    a = select(a == 0.0, 1.0, a)
    low = (b < 2.0**-900) & (a < 2.0**500)
    factor = select(a > 2.0**1000, 2.0**-60, select(low, 2.0**400, 1.0))
    return a * factor, b * factor
