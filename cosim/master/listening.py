"""What of an algebraic loop's f is noise, by its fourth differences at points near z.

Of what is smooth these are as good as nothing, as the points are about as near as f is to z, or some times wider apart;
and of noise many times its size. There has to be noise on both sides, as a jump is on one. After Moré and Wild 2011,
Estimating computational noise. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.master.unknowns import (
    ALLOWED,
    DIVISORS,
    FUZZ,
    KEPT,
    LARGEST,
    NOMINAL,
    ROW_DIVISORS,
    SIZE,
    TRIAL,
    WEIGHT,
    R,
    Z,
    unit,
    vector,
)

POINTS = 9  # on either side, at which f is listened to
APART = 1.375  # residuals between two of these at least
WIDEST = 2.0**-14  # of an unknown, or else a residual, at most: f is taken for a cubic there
FOURTH = math.sqrt(70.0)  # of noise alone, differences of fourth order over its standard deviation
LOUDEST = 16.0  # standard deviations of noise: what a residual may be
MOST_NOISE = 0.25e-12  # of the larger of an unknown and its nominal value: a last step may leave four times as much


def move_on(base: int, u: Any, point: int, wider: float) -> None:
    """Be at a point, of the guess that is kept; wider: so many times as far from each other as need be."""
    z, r, kept, size = vector(base, u, Z), vector(base, u, R), vector(base, u, KEPT), vector(base, u, SIZE)
    for j in range(z.size):
        apart = wider * APART * max(abs(r[j]), 4.0 * unit(u) * size[j])
        apart = min(apart, max(APART * abs(r[j]), WIDEST * size[j]))
        z[j] = kept[j] + (point - POINTS + 0.5) * apart


def differ(base: int, u: Any, point: int) -> None:
    """Take f at a point, in TRIAL, after those before."""
    f, fuzz, before = vector(base, u, TRIAL), vector(base, u, FUZZ), vector(base, u, ALLOWED)
    values, slopes = vector(base, u, DIVISORS), vector(base, u, ROW_DIVISORS)
    bends, thirds = vector(base, u, LARGEST), vector(base, u, WEIGHT)
    for j in range(f.size):
        if point == 0:
            values[j] = slopes[j] = bends[j] = thirds[j] = fuzz[j] = 0.0
        if point == POINTS:
            before[j] = fuzz[j]
            fuzz[j] = 0.0
        slope = f[j] - values[j]
        bend = slope - slopes[j]
        third = bend - bends[j]
        if point % POINTS >= 4:
            fuzz[j] = max(fuzz[j], abs(third - thirds[j]))
        values[j] = f[j]
        slopes[j] = slope
        bends[j] = bend
        thirds[j] = third


def settle(base: int, u: Any) -> None:
    """Be back at z, and know of the noise, of which a part of the nominal value is allowed."""
    z, kept, fuzz, before = vector(base, u, Z), vector(base, u, KEPT), vector(base, u, FUZZ), vector(base, u, ALLOWED)
    size, nominal = vector(base, u, SIZE), vector(base, u, NOMINAL)
    for j in range(z.size):
        z[j] = kept[j]
        fuzz[j] = min(LOUDEST / FOURTH * min(before[j], fuzz[j]), MOST_NOISE * max(size[j], nominal[j]))
