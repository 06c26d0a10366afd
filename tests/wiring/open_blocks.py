"""Blocks with an open dimension, for tests."""

from cosim import Block, Input, Output, Parameter, State


class Value(Block):
    """y = value."""

    value = Parameter("n?", default=1.0)
    y = Output("n?")

    def outputs(value, y):
        for q in range(y.size):
            y[q] = value[q]


class Scale(Block):
    """y = k u."""

    u = Input("n?", description="signal")
    k = Parameter("n?", default=2.0)
    y = Output("n?")

    def outputs(u, k, y):
        for q in range(y.size):
            y[q] = k[q] * u[q]


class Follow(Block):
    """dx/dt = u - x, cascaded."""

    u = Input("n?")
    x = State("n?", "order", output=True)
    T = Parameter("order", default=(1.0, 2.0))

    def derivatives(u, x, T, d_x):
        for q in range(u.size):
            d_x[q, 0] = (u[q] - x[q, 0]) / T[0]
            for k in range(1, T.size):
                d_x[q, k] = (x[q, k - 1] - x[q, k]) / T[k]


class Plus(Block):
    """y = u + v; v may be left out."""

    u = Input("n?")
    v = Input("n?", start=0.0)
    y = Output("n?")

    def outputs(u, v, y):
        for q in range(y.size):
            y[q] = u[q] + v[q]


class Mix(Block):
    """y = D u."""

    u = Input("m?")
    D = Parameter("p", "m")
    y = Output("p?")

    def outputs(u, D, y):
        for i in range(y.size):
            y[i] = 0.0
            for j in range(u.size):
                y[i] += D[i, j] * u[j]
