"""The blocks of random diagrams, see `tests/oracle.py`, which says of each what it computes in words of its own."""

import math

from cosim import Block, Input, Output, Parameter, State


class Wave(Block):
    """y = A sin(f t): depends on nothing but the time."""

    f = Parameter(default=1.0)
    A = Parameter(default=1.0)
    y = Output(2)

    def outputs(time, f, A, y):
        for q in range(y.size):
            y[q] = A * math.sin(f * time)


class Sum(Block):
    """y = a u + b w: feedthrough of two inputs."""

    u = Input(2)
    w = Input(2)
    a = Parameter(default=1.0)
    b = Parameter(default=1.0)
    y = Output(2)

    def outputs(u, w, a, b, y):
        for q in range(y.size):
            y[q] = a * u[q] + b * w[q]


class Drift(Block):
    """y = u + a t: feedthrough of an input and of the time."""

    u = Input(2)
    a = Parameter(default=1.0)
    y = Output(2)

    def outputs(u, time, a, y):
        for q in range(y.size):
            y[q] = u[q] + a * time


class Integral(Block):
    """dx/dt = u."""

    u = Input(2)
    x = State(2, output=True)

    def derivatives(u, d_x):
        for q in range(u.size):
            d_x[q] = u[q]


class Leak(Block):
    """dx/dt = a u - b x, y = x + a u: a state beside an output with feedthrough."""

    u = Input(2)
    a = Parameter(default=1.0)
    b = Parameter(default=1.0)
    x = State(2, output=True)
    y = Output(2)

    def outputs(x, u, a, y):
        for q in range(x.size):
            y[q] = x[q] + a * u[q]

    def derivatives(x, u, a, b, d_x):
        for q in range(x.size):
            d_x[q] = a * u[q] - b * x[q]


class Chain(Block):
    """p = a x + u, y = p / 2 + x, dx/dt = a t - y: its derivatives read an output that reads an output."""

    u = Input(2)
    a = Parameter(default=1.0)
    x = State(2, output=True)
    p = Output(2)
    y = Output(2)

    def outputs_first(x, u, a, p):
        for q in range(x.size):
            p[q] = a * x[q] + u[q]

    def outputs_second(x, p, y):
        for q in range(x.size):
            y[q] = 0.5 * p[q] + x[q]

    def derivatives(time, a, y, d_x):
        for q in range(y.size):
            d_x[q] = a * time - y[q]


class Pair(Block):
    """f = 2 x, h = x + a u, dx/dt = a - x: what is behind one output may be before the other."""

    u = Input(2)
    a = Parameter(default=1.0)
    x = State(2, output=True)
    f = Output(2)
    h = Output(2)

    def outputs_f(x, f):
        for q in range(x.size):
            f[q] = 2.0 * x[q]

    def outputs_h(x, u, a, h):
        for q in range(x.size):
            h[q] = x[q] + a * u[q]

    def derivatives(x, a, d_x):
        for q in range(x.size):
            d_x[q] = a - x[q]


class Hold(Block):
    """z⁺ = u: a unit delay of its period."""

    u = Input(2)
    z = State(2, output=True)

    def update(u, next_z):
        for q in range(u.size):
            next_z[q] = u[q]


class Sampled(Block):
    """z⁺ = z / 2 + u, y = z + a u + t / 8: sampled, with feedthrough at its samples."""

    u = Input(2)
    a = Parameter(default=1.0)
    z = State(2)
    y = Output(2)

    def outputs(time, z, u, a, y):
        for q in range(z.size):
            y[q] = z[q] + a * u[q] + 0.125 * time

    def update(z, u, next_z):
        for q in range(z.size):
            next_z[q] = 0.5 * z[q] + u[q]


class Mixed(Block):
    """dx/dt = z - a x, z⁺ = u / 2: continuous and sampled."""

    u = Input(2)
    a = Parameter(default=1.0)
    x = State(2, output=True)
    z = State(2)

    def derivatives(x, z, a, d_x):
        for q in range(x.size):
            d_x[q] = z[q] - a * x[q]

    def update(u, next_z):
        for q in range(u.size):
            next_z[q] = 0.5 * u[q]


class Mean(Block):
    """The mean over a fleet."""

    u = Input("robots", 2)
    y = Output(2)

    def outputs(u, y):
        for q in range(y.size):
            y[q] = 0.0
            for i in range(u.shape[0]):
                y[q] += u[i, q] / u.shape[0]
