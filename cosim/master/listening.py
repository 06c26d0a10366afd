"""What of an algebraic loop's f is noise, by its fourth differences at points near z.

Of what is smooth these are as good as nothing, as the points are about as near as f is to z, or some times wider apart;
and of noise many times its size. There has to be noise on both sides, as a jump is on one. Where f is far from z, it
may bend as much from point to point as noise would; so it is first heard much nearer. There noise is as loud, or f goes
along a line from one rounding to the next; while where it is a curve, it has no more noise than its bends. After Moré
and Wild 2011, Estimating computational noise. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.master.linear import HUGE
from cosim.master.unknowns import (
    ALLOWED,
    DIVISORS,
    FUZZ,
    KEPT,
    LARGEST,
    MOST,
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

SIDES, POINTS = 2, 9  # on either side, at which f is listened to
HEARINGS = 2 * SIDES * POINTS  # near by, and farther away
APART = 1.375  # residuals between two of these at least
NEARER = 2.0**-12  # times that, where it is heard whether f bends
SILENT = 16.0  # rounding units of f: what is no more than that
LOUDER = 16.0  # times its bends there: no noise
WIDEST = 2.0**-14  # of an unknown, or else a residual, at most: f is taken for a cubic there
FOURTH = math.sqrt(70.0)  # of noise alone, differences of fourth order over its standard deviation
LOUDEST = 16.0  # standard deviations of noise: what a residual may be
MOST_NOISE = 0.25e-12  # of the larger of an unknown and its nominal value: a last step may leave four times as much


def move_on(base: int, u: Any, point: int, wider: float) -> None:
    """Be at a point, of the guess that is kept; wider: so many times as far from each other as need be.

    The first half of them are nearer to each other, to hear whether f bends.
    """
    z, r, kept = vector(base, u, Z), vector(base, u, R), vector(base, u, KEPT)
    farther = NEARER if point < SIDES * POINTS else wider
    for j in range(z.size):
        own = max(abs(kept[j]), abs(r[j]))
        apart = farther * APART * max(abs(r[j]), 4.0 * unit(u) * own)
        apart = min(apart, max(APART * abs(r[j]), WIDEST * own))
        z[j] = kept[j] + (point % (SIDES * POINTS) - POINTS + 0.5) * apart


def differ(base: int, u: Any, point: int) -> None:
    """Take f at a point, in TRIAL, after those before."""
    f, fuzz, before = vector(base, u, TRIAL), vector(base, u, FUZZ), vector(base, u, ALLOWED)
    values, slopes = vector(base, u, DIVISORS), vector(base, u, ROW_DIVISORS)
    bends, thirds, most = vector(base, u, LARGEST), vector(base, u, WEIGHT), vector(base, u, MOST)
    near = point < SIDES * POINTS
    for j in range(f.size):
        if point == SIDES * POINTS:
            bent = min(before[j], fuzz[j])
            most[j] = LOUDER * bent if bent > 0.0 else HUGE
        if point % (SIDES * POINTS) == 0:
            values[j] = slopes[j] = bends[j] = thirds[j] = fuzz[j] = 0.0
        if point % (SIDES * POINTS) == POINTS:
            before[j] = fuzz[j]
            fuzz[j] = 0.0
        slope = f[j] - values[j]
        bend = slope - slopes[j]
        third = bend - bends[j]
        heard = abs(bend if near else third - thirds[j])
        if point % POINTS >= (2 if near else 4) and heard > SILENT * unit(u) * abs(f[j]):
            fuzz[j] = max(fuzz[j], heard)
        values[j] = f[j]
        slopes[j] = slope
        bends[j] = bend
        thirds[j] = third


def settle(base: int, u: Any) -> None:
    """Be back at z, and know of the noise, of which a part of the nominal value is allowed."""
    z, kept, fuzz, before = vector(base, u, Z), vector(base, u, KEPT), vector(base, u, FUZZ), vector(base, u, ALLOWED)
    size, nominal, most = vector(base, u, SIZE), vector(base, u, NOMINAL), vector(base, u, MOST)
    for j in range(z.size):
        z[j] = kept[j]
        noise = min(before[j], fuzz[j])
        if noise > most[j]:
            noise = 0.0
        fuzz[j] = min(LOUDEST / FOURTH * noise, MOST_NOISE * max(size[j], nominal[j]))
