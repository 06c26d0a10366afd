"""Where a figure goes as the step goes to zero, judged by its values at three steps, each half the one before.

Where the method is in order, y(h) = y + c h^p + …, and the differences between the three fall by 2^p:

    p = log2(|y(h) - y(h/2)| / |y(h/2) - y(h/4)|),    y ≈ y(h/4) + (y(h/4) - y(h/2)) / (2^p - 1)

(Richardson 1911; with the observed order it is Aitken's process.) What is extrapolated is not seen, so it counts as
uncertain by as much again: the limit is no farther from y(h/4) than twice that. For first order this is the factor
1.25 of Roache's grid convergence index. Where the differences do not fall so, there is no order, and nothing is
extrapolated: the limit then lies around y(h/4), as far to either side as the differences suggest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.accuracy.refinement import EARLY
from cosim.results.metrics import Array

ORDER, UNSETTLED, NO_ORDER, ROUNDING = "order", "unsettled", "no order", "rounding"
"""How certain a limit is. ORDER: the observed order is a whole number, as theory has it. UNSETTLED: the differences
fall, but between two orders, as where steps are still too large for the first term alone. ROUNDING: they are as small
as arithmetic makes them."""
LEAST_ORDER = 0.5
"""Differences that fall more slowly tell nothing of what is left."""
NEAR = 0.25
"""How far an observed order may be from a whole number."""
ALIKE = 0.5
"""Cosine of the angle between two differences of a course, from which they point the same way; of noise it is -0.5."""
MOVED = 2.0
"""How many times the difference between y(h) and y(h/4) a figure that has an order may seem to be moved by stops a
little before common points: where errors cancel, what such a stop changes of one is more than their sum."""
STRAYING = 0.1
"""What part of the difference between y(h) and y(h/4) a run whose steps lie elsewhere may stray from the order."""
ROUNDINGS = 4.0
"""The rounding errors of n steps walk at random: they add up to this many times sqrt(n) units in the last place."""
LATE = EARLY / 4
"""How many times as late as one that stops early the finest of three runs may be for what is before a common point."""
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Fall:
    """How the differences of three values fall. order: observed, None without one. rest: the error of the third."""

    kind: str
    order: float | None
    rest: float


@dataclass(frozen=True)
class Limit:
    """Between which numbers the limit lies, the best guess of it, and kind and order as of `Fall`."""

    guess: float
    low: float
    high: float
    kind: str
    order: float | None = None

    def error(self, figure: float) -> float:
        """By how much a figure may be off: its distance from the farther end."""
        return max(abs(figure - self.low), abs(figure - self.high))

    def offset(self, figure: float) -> float:
        """The best guess of a figure's error, with its sign."""
        return figure - self.guess


def fall(first: float, second: float, aligned: bool, highest: int, noise: float) -> Fall:
    """How differences fall: the sizes of y(h/2) - y(h) and y(h/4) - y(h/2), whether they point the same way.

    highest: the order of the best integrator; some figures have one more, as energies of symplectic methods do.
    noise: how large rounding errors may be.
    """
    if second <= noise and first <= noise * 2.0 ** (highest + 1):
        return Fall(ROUNDING, None, noise if first or second else 0.0)
    if aligned and first > 0.0 < second:
        order = math.log2(first) - math.log2(second)
        if LEAST_ORDER <= order <= highest + 1 + NEAR:
            rest = second / (2.0**order - 1.0)
            settled = abs(order - round(order)) <= NEAR and round(order) >= 1
            return Fall(ORDER, order, rest) if settled else Fall(UNSETTLED, order, max(rest, second))
    faster = aligned and second < first / 4  # than theory: h is too large a step to tell, and h/2 may not be
    return Fall(NO_ORDER, None, max(2.0 * second, first / 2 if faster else first))


def share(found: Fall, ratio: float) -> float:
    """Where a figure at the step `ratio` h is to be expected between those at h/4, which is 0, and h, which is 1."""
    if found.order is None:
        return 1.0
    finest = 4.0**-found.order
    return float((ratio**found.order - finest) / (1.0 - finest))


def checked(found: Fall, strays: float, ends: float, noise: float, margin: float = 1.0) -> Fall:
    """What remains of an order where a run whose steps lie elsewhere strays from it so far.

    Three steps of which each divides the one before have all their points in common. So whatever happens a little after
    one of these, between two steps, is as wrong in all three, and the differences do not show it.

    ends: the distance between the figures at h and h/4. strays: without an order, from the figure at h. margin: by how
    much more it may have strayed with other luck.
    """
    if found.kind == NO_ORDER:  # three steps that agree by their common points are no surer than the fourth has it
        return Fall(NO_ORDER, None, max(found.rest, strays))
    if strays <= STRAYING * ends + 2.0 * noise:
        return found
    return Fall(NO_ORDER, None, max(2.0 * found.rest, margin * strays))


def warned(found: Fall, moves: float, ends: float, noise: float) -> Fall:
    """What remains of an order where stopping early, before what runs have in common, moves a figure so far.

    What happens a little before a common point is as late in all runs, and in one that stops early almost on time. So
    it may be off by as many times more as it may happen earlier. An order moves it too, by a part of its own error.

    moves: the distance between the figures at h without and with such stops. ends: as of `checked`. noise: how large
    rounding errors may be, of which short steps make more.
    """
    hidden = LATE * max(moves - noise, 0.0)
    if found.kind == NO_ORDER or hidden <= MOVED * ends:
        return found
    return Fall(NO_ORDER, None, max(2.0 * found.rest, hidden))


def limit(
    figures: Sequence[float],
    highest: int,
    noise: float,
    believed: bool = True,
    elsewhere: tuple[float, float] | None = None,
    early: tuple[float, float] | None = None,
) -> Limit:
    """The limit of a figure at three steps, h, h/2 and h/4.

    noise: how large the figures' rounding errors may be. believed: whether there is reason to look for an order.
    elsewhere: another step, as a part of h, most points of which lie between those of h, and the figure there.
    early: the figure at h of a run that stops a little before the points that all have in common, and how large
    its rounding errors may be.
    """
    coarse, middle, fine = figures
    first, second = middle - coarse, fine - middle
    found = fall(abs(first), abs(second), believed and (first > 0.0) == (second > 0.0), highest, noise)
    if elsewhere:
        ratio, figure = elsewhere
        expected = fine + share(found, ratio) * (coarse - fine)
        found = checked(found, abs(figure - expected), abs(coarse - fine), noise, margin=2.0)
    if early:
        found = warned(found, abs(early[0] - coarse), abs(coarse - fine), early[1])
    guess = fine + math.copysign(found.rest, second) if found.order else fine
    rest = (2.0 * found.rest if found.order else found.rest) + EPSILON * max(map(abs, figures))
    return Limit(guess, fine - rest, fine + rest, found.kind, found.order)


def falls(coarse: Array, middle: Array, fine: Array, noise: float) -> bool:
    """Whether a whole course converges, without which one figure of it may look so by chance.

    Each an array (instants, elements) of numbers, or what is not finite. noise: how large their rounding errors may be.
    Looks at what is added to the differences from one instant to the next: that of a random walk is as many numbers
    that have nothing to do with each other. Yes, where nothing else is known of it.
    """
    if not coarse.shape == middle.shape == fine.shape:
        return False
    known = np.isfinite(coarse) & np.isfinite(middle) & np.isfinite(fine)
    coarse, middle, fine = (np.where(known, course, 0.0) for course in (coarse, middle, fine))
    first, second = (np.diff(d, axis=0, prepend=0.0).ravel() for d in (middle - coarse, fine - middle))
    if float(np.abs(second).max(initial=0.0)) <= noise:
        return True
    sizes = float(np.abs(first).sum()), float(np.abs(second).sum())
    if not sizes[0]:
        return False
    first, second = first / sizes[0], second / sizes[1]
    alike = float(first @ second) >= ALIKE * math.sqrt(float(first @ first) * float(second @ second))
    return alike and sizes[0] >= 2.0**LEAST_ORDER * sizes[1]


def most_noise(noise: float, steps: int) -> float:
    """How large the rounding error of a figure may be that walks one way for so many steps; noise: at random."""
    return noise * math.sqrt(steps)


def noise(scale: float, steps: int) -> float:
    """How large the rounding error of a figure may be, of numbers of that size, after so many steps."""
    return ROUNDINGS * EPSILON * scale * math.sqrt(steps)
