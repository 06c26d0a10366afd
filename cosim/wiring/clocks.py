"""When blocks are due: periods and offsets as exact fractions, and the ticks that all of them are multiples of.

So 1 ms, 3 ms and a third of a second meet exactly where they should, and the master stops where something is due and
nowhere else, however fine the ticks are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

from cosim.language.reader import multiple

MOST_TICKS = 2**53
_DIGITS = (3, 6, 9, 12, 15)


@dataclass(frozen=True)
class Clock:
    """Due at `offset` and every `period` after it, both in s."""

    period: Fraction
    offset: Fraction = Fraction(0)

    def __str__(self) -> str:
        text = f"every {float(self.period):g} s"
        return f"{text} from {float(self.offset):g} s" if self.offset else text

    def later(self, time: Fraction) -> Clock:
        """The same so much later (s)."""
        return Clock(self.period, self.offset + time)

    def follows(self, other: Clock) -> bool:
        """Whether the other is due whenever this is."""
        since = self.offset - other.offset
        return self.period == other.period and since >= 0 and since % self.period == 0


@dataclass(frozen=True)
class Schedule:
    """When the master stops.

    tick: what all times are multiples of (s). grid: the communication step, in ticks; least: the shortest that it may
    become. clocks: those of blocks, and of what jumps by itself.
    """

    tick: Fraction
    grid: int
    least: int
    clocks: tuple[Clock, ...]

    def most_points(self, time: Fraction) -> int:
        """At how many communication points the master stops at most within a time (s), both ends included."""
        periods = [self.least * self.tick, *(clock.period for clock in self.clocks)]
        return sum(time // period + 1 for period in periods)

    def ticks(self, time: Fraction) -> int:
        """A time (s) that is due, in ticks."""
        count = time / self.tick
        assert count.denominator == 1, time
        return count.numerator


def schedule(step: float, clocks: Iterable[Clock | None], smallest: float | None = None) -> Schedule:
    """The schedule of a run with this communication step (s), each clock once; smallest: where the step may vary."""
    several = tuple(dict.fromkeys(clock for clock in clocks if clock))
    grid = exact(step)
    tick = common([grid, *(time for clock in several for time in (clock.period, clock.offset))])
    while smallest is not None and tick > smallest:
        tick /= 2
    count = (grid / tick).numerator
    return Schedule(tick, count, count if smallest is None else 1, several)


def exact(time: float, step: float | None = None) -> Fraction:
    """The simplest fraction that stands for a time (s): 0.001 is 1/1000, and 1/3 a third.

    step: the communication step (s), of which a time is a whole multiple that is one up to rounding.
    """
    if step is not None and (count := multiple(time, step)):
        return count * exact(step)
    found = (Fraction(time).limit_denominator(10**digits) for digits in _DIGITS)
    return next((fraction for fraction in found if float(fraction) == time), Fraction(time))


def common(times: Iterable[Fraction]) -> Fraction:
    """The largest time (s) of which all are multiples."""
    several = [time for time in times if time]
    denominator = lcm(*(time.denominator for time in several))
    return Fraction(gcd(*(int(time * denominator) for time in several)), denominator)
