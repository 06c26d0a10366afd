"""Non-linear characteristics: limits, dead zones, hysteresis, switches, levels. Corners and jumps are events."""

import math

import numpy as np

from cosim import Block, Indicator, Input, Local, Output, Parameter, State, rule


def clamp(value: float, lower: float, upper: float) -> float:
    """A value, or the limit that it is beyond."""
    return lower if value < lower else (min(value, upper))


def distance(value: float, limit: float) -> float:
    """How far a value is above a limit, which may be infinite, as an indicator: 1 or -1 if it is never reached."""
    return value - limit if math.isfinite(limit) else (-1.0 if limit > 0.0 else 1.0)


class Saturation(Block):
    """A signal between two limits.

    ::

        y = min(max(u, lower), upper)
    """

    u = Input("n?", description="signal")
    lower = Parameter("n?", default=-1.0, description="lower limit")
    upper = Parameter("n?", default=1.0, description="upper limit")
    above_lower = Indicator("n?", description="distance from the lower limit")
    above_upper = Indicator("n?", description="distance from the upper limit")
    y = Output("n?", description="limited signal")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(lower < upper)))

    def outputs(u, lower, upper, y):
        for q in range(y.size):
            y[q] = clamp(u[q], lower[q], upper[q])

    def indicators(u, lower, upper, above_lower, above_upper):
        for q in range(u.size):
            above_lower[q] = distance(u[q], lower[q])
            above_upper[q] = distance(u[q], upper[q])


class DeadZone(Block):
    """Nothing between two limits, and what is beyond them outside.

    ::

        y = u - upper for u > upper,   u - lower for u < lower,   0 between
    """

    u = Input("n?", description="signal")
    lower = Parameter("n?", default=-0.5, description="lower end")
    upper = Parameter("n?", default=0.5, description="upper end")
    above_lower = Indicator("n?", description="distance from the lower end")
    above_upper = Indicator("n?", description="distance from the upper end")
    y = Output("n?", description="what is beyond")

    ordered = rule("lower <= upper")(lambda lower, upper: bool(np.all(lower <= upper)))

    def outputs(u, lower, upper, y):
        for q in range(y.size):
            y[q] = u[q] - clamp(u[q], lower[q], upper[q])

    def indicators(u, lower, upper, above_lower, above_upper):
        for q in range(u.size):
            above_lower[q] = distance(u[q], lower[q])
            above_upper[q] = distance(u[q], upper[q])


class Relay(Block):
    """A switch with hysteresis: on from `upper` upwards, off from `lower` downwards, as it was between.

    ::

        y = on_value while on,   off_value while off

    It switches at an event, where u reaches a limit. Between the limits it starts as `starts_on` says.
    """

    u = Input("n?", description="signal")
    lower = Parameter("n?", default=-0.1, description="where it switches off")
    upper = Parameter("n?", default=0.1, description="where it switches on")
    off_value = Parameter("n?", default=-1.0, description="output while off")
    on_value = Parameter("n?", default=1.0, description="output while on")
    starts_on = Parameter("n?", dtype=bool, unit="1", default=False, description="whether it is on at first")
    on = State("n?", dtype=bool, start=False, description="whether it is on")
    crossed = Indicator("n?", crossing="rising", description="how far u is beyond the limit that is next")
    y = Output("n?", description="output")

    ordered = rule("lower <= upper")(lambda lower, upper: bool(np.all(lower <= upper)))

    def start(u, lower, upper, starts_on, on):
        for q in range(on.size):
            on[q] = u[q] >= upper[q] or (starts_on[q] and u[q] > lower[q])

    def outputs(off_value, on_value, on, y):
        for q in range(y.size):
            y[q] = on_value[q] if on[q] else off_value[q]

    def indicators(u, lower, upper, on, crossed):
        for q in range(u.size):
            crossed[q] = lower[q] - u[q] if on[q] else u[q] - upper[q]

    def event(crossed, on, next_on):
        for q in range(crossed.size):
            if crossed[q] > 0:
                next_on[q] = not on[q]


class Sign(Block):
    """The sign of a signal: 1, -1, or 0. Its jumps are events.

    ::

        y = sign(u)
    """

    u = Input("n?", description="signal")
    crossed = Indicator("n?", crossing="rising", description="how far the signal is beyond zero, or away from it")
    y = Output("n?", unit="1", held=True, description="its sign")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = 1.0 if u[q] > 0.0 else (-1.0 if u[q] < 0.0 else 0.0)

    def indicators(u, y, crossed):
        for q in range(u.size):
            crossed[q] = -y[q] * u[q] if y[q] != 0.0 else abs(u[q])


class Quantiser(Block):
    """A signal rounded to multiples of an interval, halves upwards. Its jumps are events.

    ::

        y = interval floor(u / interval + 1/2)
    """

    u = Input("n?", description="signal")
    interval = Parameter("n?", default=0.1, description="distance of two levels")
    above = Indicator("n?", crossing="rising", description="how far u is above where the next level begins")
    below = Indicator("n?", crossing="rising", description="how far u is below where the level begins")
    y = Output("n?", held=True, description="nearest level")

    positive = rule("interval > 0")(lambda interval: bool(np.all(interval > 0.0)))

    def outputs(u, interval, y):
        for q in range(y.size):
            level = math.floor(u[q] / interval[q] + 0.5)
            y[q] = interval[q] * level
            if u[q] > y[q] + 0.5 * interval[q]:  # as rounding may have it; the indicators compare in the same way
                y[q] = interval[q] * (level + 1.0)
            elif u[q] < y[q] - 0.5 * interval[q]:
                y[q] = interval[q] * (level - 1.0)

    def indicators(u, interval, y, above, below):
        for q in range(u.size):
            above[q] = u[q] - (y[q] + 0.5 * interval[q])
            below[q] = y[q] - 0.5 * interval[q] - u[q]


class Switch(Block):
    """One of two signals, as a third one is above a threshold or not. Where it switches is an event.

    ::

        y = u_1 for control >= threshold,   u_2 else
    """

    u_1 = Input("n?", description="signal while control is at or above the threshold")
    control = Input(description="what chooses")
    u_2 = Input("n?", description="signal while control is below the threshold")
    threshold = Parameter(default=0.5, description="threshold")
    crossed = Indicator(crossing="rising", description="how far control is beyond the threshold")
    above = Local(dtype=bool, unit="1", held=True, description="whether control is at or above the threshold")
    y = Output("n?", description="the chosen signal")

    def outputs_above(control, threshold, above):
        above[0] = control >= threshold

    def outputs(u_1, u_2, above, y):
        for q in range(y.size):
            y[q] = u_1[q] if above else u_2[q]

    def indicators(control, threshold, above, crossed):
        crossed[0] = threshold - control if above else control - threshold


class RateLimit(Block):
    """A signal that rises and falls no faster than allowed; sampled.

    ::

        y[k] = min(max(u[k], y[k-1] - falling T), y[k-1] + rising T),   T the period

    It begins where u does. In continuous time, an `Integrator` of a `Saturation` of (u - y) / T follows u so, T behind.
    """

    u = Input("n?", description="signal")
    rising = Parameter("n?", default=1.0, description="fastest rise in a second")
    falling = Parameter("n?", default=1.0, description="fastest fall in a second, above 0")
    last = State("n?", description="output at the last sample")
    y = Output("n?", description="limited signal")

    positive = rule("rising, falling > 0")(lambda rising, falling: bool(np.all(rising > 0.0) and np.all(falling > 0.0)))

    def start(u, last):
        for q in range(last.size):
            last[q] = u[q]

    def outputs(u, rising, falling, last, period, y):
        for q in range(y.size):
            y[q] = clamp(u[q], last[q] - falling[q] * period, last[q] + rising[q] * period)

    def update(y, next_last):
        for q in range(y.size):
            next_last[q] = y[q]


class Backlash(Block):
    """Play of some width between two parts, one of which pulls the other along; sampled.

    ::

        y[k] = min(max(y[k-1], u[k] - width/2), u[k] + width/2)
    """

    u = Input("n?", description="position of the driving part")
    width = Parameter("n?", default=0.1, description="width of the play")
    last = State("n?", description="position of the driven part at the last sample")
    y = Output("n?", description="position of the driven part")

    positive = rule("width >= 0")(lambda width: bool(np.all(width >= 0.0)))

    def outputs(u, width, last, y):
        for q in range(y.size):
            y[q] = clamp(last[q], u[q] - 0.5 * width[q], u[q] + 0.5 * width[q])

    def update(y, next_last):
        for q in range(y.size):
            next_last[q] = y[q]
