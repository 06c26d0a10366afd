"""Small blocks that the tests of the framework wire together."""

import math

from cosim import Block, CalculatedParameter, Dimension, Input, Local, Measure, Output, Parameter, State


def squashed(value):
    """A helper that kernels call."""
    return value / (1.0 + abs(value))


class Sine(Block):
    """y = A sin(f t), for each channel a multiple of it."""

    f = Parameter(default=1.0, unit="rad/s")
    A = Parameter(default="i", description="amplitude; a robot's number unless set")
    y = Output(2, unit="m")

    def outputs(time, f, A, y):
        for q in range(y.size):
            y[q] = (q + 1.0) * A * math.sin(f * time)


class Lag(Block):
    """T dx/dt = u - x - x_2 / 2, with an output that has direct feedthrough and an event."""

    u = Input("n")
    x = State("n", output=True)
    T = Parameter(default=1.0, unit="s")
    rate = CalculatedParameter(unit="1/s")
    y = Output("n")
    mean = Local()
    large = Output(dtype=bool, event="the lag is large")

    def calculate(T, rate):
        rate[0] = 1.0 / T

    def outputs_mean(x, mean):
        total = 0.0
        for q in range(x.size):
            total += x[q]
        mean[0] = total / x.size

    def outputs(x, u, y, large):
        for q in range(x.size):
            y[q] = squashed(x[q]) + u[q]
        large[0] = x[0] > 0.5

    def derivatives(u, x, mean, rate, d_x):
        for q in range(x.size):
            d_x[q] = rate * (u[q] - x[q] - 0.5 * mean)


class Oscillator(Block):
    """dx/dt = v, dv/dt = -w^2 x: its exact solution is known. Its velocity is local."""

    w = Parameter(default=2.0, unit="rad/s")
    x = State(output=True, start=1.0, unit="m")
    v = State(unit="m/s")

    def derivatives(x, v, w, d_x, d_v):
        d_x[0] = v
        d_v[0] = -w * w * x


class Integrator(Block):
    """dx/dt = u."""

    u = Input("n")
    x = State("n", output=True)

    def derivatives(u, d_x):
        for q in range(u.size):
            d_x[q] = u[q]


class Gain(Block):
    """y = k u."""

    u = Input("n")
    k = Parameter(default=1.0)
    y = Output("n")

    def outputs(u, k, y):
        for q in range(u.size):
            y[q] = k * u[q]


class Counter(Block):
    """Counts its samples, and holds the input of the last one: a unit delay."""

    u = Input()
    count = State(output=True, dtype=int)
    held = State(output=True)

    def update(u, next_count, next_held):
        next_count[0] += 1
        next_held[0] = u


class Average(Block):
    """Network block: the mean over a fleet, and a number for each member."""

    neighbours = Dimension(default=3)
    u = Input("robots", "n")
    mean = Output("n")
    number = Output("robots", dtype="int32")
    memory = Local("robots", "neighbours", finite=False)

    def outputs(u, mean, number, memory):
        for q in range(u.shape[1]):
            mean[q] = 0.0
            for i in range(u.shape[0]):
                mean[q] += u[i, q] / u.shape[0]
        for i in range(u.shape[0]):
            number[i] = i + 1
            memory[i, 0] = u[i, 0]


class Numbers(Block):
    """Passes integers on, which are half a word."""

    k = Input("members", dtype="int32")
    y = Output("members", dtype="int32")

    def outputs(k, y):
        for i in range(k.size):
            y[i] = k[i]


class Spy(Measure):
    """A measuring block that may tap locals."""

    v = Input()
    energy = Output()

    def outputs(v, energy):
        energy[0] = 0.5 * v * v


class Picky(Block):
    """Stops the run when its input is too large."""

    u = Input("n")
    limit = Parameter(default=0.5)
    y = Output("n")

    def outputs(u, limit, y):
        for q in range(u.size):
            if u[q] > limit:
                raise ValueError("input too large")
            y[q] = u[q]


class Explosive(Block):
    """dx/dt = x^2, which leaves every bound at t = 1 / x(0)."""

    x = State(start=1.0)

    def derivatives(x, d_x):
        d_x[0] = x * x


class Table(Block, compiled=False):
    """Plain Python: looks its input up in a dictionary."""

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = {0: 1.0}.get(round(u), u)


class Clock(Block):
    """The time, and tables of what happened at 1.5 s."""

    t = Output(unit="s")
    log = State(2, 2, output=True, start=math.nan, finite=False, description="an event: rows [member, time]")
    ones = State(2, 2, output=True, start=1.0, description="no table of events")
    torn = State(2, 2, output=True, start=math.nan, finite=False, description="a row that is no event")

    def outputs(time, t):
        t[0] = time

    def update(time, next_log, next_ones, next_torn):
        next_ones[0, 0] = 1.0
        if time >= 1.5 and math.isnan(next_log[0, 0]):
            next_log[0, 0] = 7.0
            next_log[0, 1] = time
            next_torn[0, 0] = 7.0
            next_torn[0, 1] = -1.0


class Crashing(Block, compiled=False):
    """Reads where nothing is."""

    y = Output()

    def outputs(y):
        import ctypes

        y[0] = ctypes.string_at(0)[0]


class Stuck(Block, compiled=False):
    """Counts steps, and does not return from 1.5 s on."""

    x = State(output=True)

    def update(time, x, next_x):
        next_x[0] = x + 1.0
        if time >= 1.5:
            import sys

            print("stuck", file=sys.stderr, flush=True)
            while True:
                pass


class Riccati(Block):
    """dy/dt = y^2 cos(t), y(0) = 1/2: y = 1/(2 - sin t)."""

    y = State(output=True, start=0.5)

    def derivatives(time, y, d_y):
        d_y[0] = y * y * math.cos(time)


class VanDerPol(Block):
    """x'' = mu (1 - x^2) x' - x + u: stiff where mu is large."""

    u = Input(start=0.0)
    mu = Parameter(default=1000.0)
    x = State(output=True, start=2.0)
    v = State(output=True)

    def derivatives(u, mu, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = mu * (1.0 - x * x) * v - x + u


class Robertson(Block):
    """Three reactions whose rates differ by nine orders of magnitude."""

    y = State(3, output=True, start=[1.0, 0.0, 0.0])

    def derivatives(y, d_y):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        d_y[0] = back - slow
        d_y[1] = slow - back - fast
        d_y[2] = fast


class Follow(Block):
    """dx/dt = u - x."""

    u = Input()
    x = State(output=True)

    def derivatives(u, x, d_x):
        d_x[0] = u - x
