"""Small blocks that the tests of exported FMUs need."""

import math

from cosim import Block, CalculatedParameter, Input, Local, Output, Parameter, State


class Wave(Block):
    """y = sin(f t + k)."""

    f = Parameter(default=1.0, unit="rad/s")
    y = Output(2, unit="m")

    def outputs(time, f, y):
        for q in range(2):
            y[q] = math.sin(f * time + q)


class Robot(Block):
    """A mass that is pushed, with friction: its output is a state, so that every importer can read it at once."""

    u = Input(2, unit="m", description="push")
    x = State(2, output=True, unit="m", description="position")
    v = State(2, unit="m/s", description="velocity")
    mass = Parameter(unit="kg", default=2.0, description="mass of the body")
    friction = Parameter(2, default=(0.5, 0.25), unit=("1/s", "1/s"))
    inverse = CalculatedParameter(unit="1/kg")

    def calculate(mass, inverse):
        inverse[0] = 1.0 / mass

    def derivatives(time, u, x, v, friction, inverse, d_x, d_v):
        for q in range(2):
            d_x[q] = v[q]
            d_v[q] = inverse * (u[q] - math.sin(x[q])) - friction[q] * v[q] + 0.1 * math.cos(time)


class Filter(Block):
    """A lag with direct feedthrough; its state starts at the input."""

    u = Input("n", unit="m")
    T = Parameter(default=0.3, unit="s")
    z = State("n")
    y = Output("n", unit="m", description="lead")
    slow = Output("n", unit="m")
    gap = Local("n", description="work space")

    def start(u, z):
        for q in range(z.size):
            z[q] = u[q]

    def outputs(u, z, gap, y):
        for q in range(u.size):
            gap[q] = u[q] - z[q]
            y[q] = u[q] + 0.5 * gap[q]

    def outputs_slow(z, slow):
        for q in range(z.size):
            slow[q] = z[q]

    def derivatives(gap, T, d_z):
        for q in range(d_z.size):
            d_z[q] = gap[q] / T


class Rise(Block):
    """dx/dt = 1 - x, n = 10000 x as an integer."""

    x = State(output=True)
    n = Output(dtype=int)

    def outputs(x, n):
        n[0] = int(1e4 * x)

    def derivatives(x, d_x):
        d_x[0] = 1.0 - x


class Keep(Block):
    """m⁺ = n; and dx/dt = n / 10000, so that it is no sampled block alone."""

    n = Input(dtype=int)
    m = State(dtype=int, output=True)
    x = State(output=True)

    def derivatives(n, d_x):
        d_x[0] = 1e-4 * n

    def update(n, next_m):
        next_m[0] = n


class Counter(Block):
    """Sampled: counts, and holds what it saw."""

    u = Input(2, unit="m")
    count = State(dtype=int, output=True)
    seen = State(2, unit="m", description="the last sample")
    y = Output(2, unit="m")

    def outputs(u, seen, y):
        for q in range(2):
            y[q] = u[q] - seen[q]

    def update(u, next_count, next_seen):
        next_count[0] += 1
        for q in range(2):
            next_seen[q] = u[q]


class Mean(Block):
    """Sees the whole fleet."""

    x = Input("robots", 2, unit="m")
    mean = Output(2, unit="m")

    def outputs(x, mean):
        for q in range(2):
            total = 0.0
            for i in range(x.shape[0]):
                total += x[i, q]
            mean[q] = total / x.shape[0]


class Range(Block):
    """Says whether something is near, at once."""

    x = Input(2, unit="m")
    near = Output(dtype=bool)

    def outputs(x, near):
        near[0] = math.sqrt(x[0] * x[0] + x[1] * x[1]) < 2.0


class Types(Block):
    """Every data type passes through."""

    a = Input(dtype="int32", start=3)
    b = Input(2, dtype=bool, start=(True, False))
    c = Input(dtype="float32", start=0.5)
    d = Input(dtype="uint8", start=7)
    k = Parameter(dtype="int32", default=2)
    total = Output(dtype="int64")
    both = Output(dtype=bool)
    c_out = Output(dtype="float32")
    d_out = Output(dtype="uint8")

    def outputs(a, b, c, d, k, total, both, c_out, d_out):
        total[0] = k * a
        both[0] = b[0] and b[1]
        c_out[0] = c
        d_out[0] = d


class Far(Block):
    """Writes where its input says."""

    u = Input(start=0.0)
    y = Output(2)

    def outputs(u, y):
        y[0], y[1] = 1.0, 2.0
        y[int(u)] = 3.0


class Picky(Block):
    """Raises once its input is too large; explodes otherwise."""

    u = Input(start=0.0)
    x = State(output=True, start=1.0)
    rate = Parameter(default=0.0)

    def derivatives(u, x, rate, d_x):
        if u > 1.0:
            raise ValueError("the input is too large (# 1)")
        d_x[0] = rate * x * x


class Plain(Block, compiled=False):
    """Stays plain Python."""

    y = Output()

    def outputs(time, y):
        y[0] = time
