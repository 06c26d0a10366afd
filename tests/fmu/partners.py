"""Native blocks that the tests wire to FMUs, among them the native twin of `machine.c`."""

import math

from cosim import Block, Input, Output, Parameter, State


class Source(Block):
    """u = A sin(3 t), n counts fifths of a second, on is true in every other one."""

    A = Parameter(default=1.0)
    u = Output(unit="m")
    n = Output(dtype=int)
    on = Output(dtype=bool)

    def outputs_u(time, A, u):
        u[0] = A * math.sin(3.0 * time)

    def outputs_rest(time, n, on):
        n[0] = int(time / 0.2 + 1e-6)
        on[0] = n[0] % 2 == 1


class Clock(Block):
    """y = t."""

    y = Output()

    def outputs(time, y):
        y[0] = time


class Double(Block):
    """y = 2 u."""

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = 2.0 * u


class Sum(Block):
    """dx/dt = u."""

    u = Input()
    x = State(output=True)

    def derivatives(u, d_x):
        d_x[0] = u


class Lag(Block):
    """The lag of `machine.c`: T dx/dt = u - x, y = 2 u + x."""

    u = Input(unit="m")
    x = State(output=True, unit="m")
    T = Parameter(default=1.0, unit="s")
    y = Output(unit="m")

    def outputs(u, x, y):
        y[0] = 2.0 * u + x

    def derivatives(u, x, T, d_x):
        d_x[0] = (u - x) / T


class Follower(Block):
    """Integrates what it is given, one for each member of a fleet."""

    u = Input("members", unit="m")
    x = State("members", output=True, unit="m")

    def derivatives(u, d_x):
        for k in range(u.size):
            d_x[k] = u[k]


class Grid(Block):
    """An array, a single and a byte that change."""

    array = Output(2, 3)
    short = Output(dtype="float32")
    byte = Output(dtype="int8")

    def outputs(time, array, short, byte):
        for i in range(2):
            for j in range(3):
                array[i, j] = time + 10.0 * i + j
        short[0] = time
        byte[0] = int(time * 10.0)


class Sensitive(Block):
    """Its bits depend on how is rounded, and on whether there are subnormal numbers, into which the second shrinks."""

    x = State(2, output=True, start=[0.1, 1e-300])

    def derivatives(time, x, d_x):
        d_x[0] = math.sin(time) - x[0] / 3.0
        d_x[1] = -50.0 * x[1]
