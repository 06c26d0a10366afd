"""What sensors and links do to a signal: offsets, drop-outs, resolution. A delay is `delay:` of a wire, or `Delay`."""

import math

import numpy as np

from cosim import Block, Input, Output, Parameter, State, rule
from cosim.blocks.nonlinear import clamp


class Sensor(Block):
    """A sensor with an error of its gain, a bias, and a range.

    ::

        y = min(max((1 + gain_error) u + bias, lower), upper)
    """

    u = Input("n?", description="true value")
    gain_error = Parameter("n?", unit="1", default=0.0, description="relative error of the gain")
    bias = Parameter("n?", default=0.0, description="offset")
    lower = Parameter("n?", default=-np.inf, description="lower end of the range")
    upper = Parameter("n?", default=np.inf, description="upper end of the range")
    y = Output("n?", description="measured value")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(lower < upper)))

    def outputs(u, gain_error, bias, lower, upper, y):
        for q in range(y.size):
            y[q] = clamp((1.0 + gain_error[q]) * u[q] + bias[q], lower[q], upper[q])


class DropOut(Block):
    """A link that breaks down for a time: the last value is held meanwhile; sampled.

    ::

        y[k] = u[k] outside begin <= t < end,   y[k-1] within
    """

    u = Input("n?", description="signal")
    begin = Parameter("drops?", unit="s", default=np.inf, description="when each drop-out begins")
    end = Parameter("drops?", unit="s", default=np.inf, description="when it ends")
    last = State("n?", description="last value that came through")
    y = Output("n?", description="what comes through")
    valid = Output(dtype=bool, unit="1", description="whether it is a new value")

    ordered = rule("begin <= end")(lambda begin, end: bool(np.all(begin <= end)))

    def outputs(time, u, begin, end, last, y, valid):
        broken = False
        for k in range(begin.size):
            broken = broken or begin[k] <= time < end[k]
        valid[0] = not broken
        for q in range(y.size):
            y[q] = last[q] if broken else u[q]

    def update(y, next_last):
        for q in range(y.size):
            next_last[q] = y[q]


class Encoder(Block):
    """An incremental encoder: whole counts of an angle.

    ::

        counts = floor(u counts_per_turn / (2 pi)),   y = 2 pi counts / counts_per_turn
    """

    u = Input("n?", unit="rad", description="angle")
    counts_per_turn = Parameter("n?", unit="1", default=1024.0, description="counts in a turn, all edges counted")
    y = Output("n?", unit="rad", description="angle of the count")
    counts = Output("n?", unit="1", description="counts")

    positive = rule("counts_per_turn > 0, and finite")(
        lambda counts_per_turn: bool(np.all((counts_per_turn > 0.0) & np.isfinite(counts_per_turn)))
    )

    def outputs(u, counts_per_turn, y, counts):
        for q in range(y.size):
            counts[q] = math.floor(u[q] * counts_per_turn[q] / (2.0 * math.pi))
            y[q] = 2.0 * math.pi * counts[q] / counts_per_turn[q]
