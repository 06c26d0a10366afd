"""Blocks whose solutions are known, and some that have no order."""

import math

from cosim import Block, Input, Measure, Output, Parameter, State


class Decay(Block):
    """dx/dt = k x + u."""

    k = Parameter(default=-1.0)
    u = Input(start=0.0)
    x = State(output=True, start=1.0)

    def derivatives(x, u, k, d_x):
        d_x[0] = k * x + u


class Wave(Block):
    """y = sin t."""

    y = Output()

    def outputs(time, y):
        y[0] = math.sin(time)


class Oscillator(Block):
    """dx/dt = v, dv/dt = -4 x: x = cos 2 t, v = -2 sin 2 t."""

    x = State(output=True, start=1.0)
    v = State(output=True)

    def derivatives(x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = -4.0 * x


class Mass(Block):
    """m d2x/dt2 = F - k x."""

    m = Parameter(default=1.0)
    k = Parameter(default=1.0)
    F = Input()
    x = State(output=True, start=0.0)
    v = State(output=True)

    def derivatives(x, v, F, m, k, d_x, d_v):
        d_x[0] = v
        d_v[0] = (-k * x + F) / m


class Spring(Block):
    """F = k (b - a) pulls what is at a, and -F what is at b."""

    k = Parameter(default=3.0)
    a = Input()
    b = Input()
    F = Output()
    back = Output()

    def outputs(a, b, k, F, back):
        F[0] = k * (b - a)
        back[0] = k * (a - b)


class Logistic(Block):
    """dx/dt = x (1 - x): x = 1 / (1 + (1/x0 - 1) exp(-t))."""

    x = State(output=True, start=0.1)

    def derivatives(x, d_x):
        d_x[0] = x * (1.0 - x)


class Riccati(Block):
    """dx/dt = 1 - x^2: x = tanh t."""

    x = State(output=True, start=0.0)

    def derivatives(x, d_x):
        d_x[0] = 1.0 - x * x


class Minus(Block):
    """y = -u."""

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = -u


class Half(Block):
    """y = a + b / 2; two of them that read each other are an algebraic loop."""

    a = Input(start=0.0)
    b = Input()
    y = Output()

    def outputs(a, b, y):
        y[0] = a + 0.5 * b


class Switched(Block):
    """y = 1 until t = T, then -1."""

    T = Parameter()
    y = Output()

    def outputs(time, T, y):
        y[0] = 1.0 if time < T else -1.0


class Relay(Block):
    """y = -sign(u): what closes a loop with it slides."""

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = -1.0 if u > 0.0 else 1.0


class Noise(Block):
    """Numbers from -1 to 1 of a congruential generator, a new one at every sample."""

    seed = State(dtype=int, start=12345)
    y = State(output=True)

    def update(seed, next_seed, next_y):
        next_seed[0] = (seed * 1103515245 + 12345) % 2147483648
        next_y[0] = next_seed[0] / 1073741824.0 - 1.0


class Scramble(Block):
    """Noise from -1 to 1 as a function of time."""

    seed = Parameter(default=0.0)
    y = Output()

    def outputs(time, seed, y):
        scrambled = math.sin(12.9898 * seed + 78233.0 * time) * 43758.5453
        y[0] = 2.0 * (scrambled - math.floor(scrambled)) - 1.0


class Delay(Measure):
    """Holds the input of the last sample, of which there may be so many."""

    most = Parameter(default=1000000, dtype=int)
    u = Input()
    held = State(output=True)
    count = State(output=True, dtype=int)

    def update(u, count, most, next_held, next_count):
        if count >= most:
            raise ValueError("too many samples")
        next_held[0] = u
        next_count[0] = count + 1


class Watch(Measure):
    """Whether the input has fallen below a level, and when, as rows [member, time]."""

    level = Parameter()
    u = Input()
    below = Output(dtype=bool)
    part = Output(2, finite=False, description="[NaN, u]")
    log = State(1, 2, output=True, start=math.nan, finite=False)

    def outputs(u, level, below, part):
        below[0] = u < level
        part[0] = math.nan
        part[1] = u

    def update(time, u, level, log, next_log):
        if u < level and math.isnan(log[0, 0]):
            next_log[0, 0] = 1.0
            next_log[0, 1] = time


class Strict(Block):
    """y = u, which must not be below zero."""

    u = Input()
    y = Output()

    def outputs(u, y):
        if u < 0.0:
            raise ValueError("below zero")
        y[0] = u


class Drag(Block):
    """dx/dt = -k x |x|: x = 1 / (1 + k t). With k h > 2, Euler's method leaves every bound."""

    k = Parameter()
    x = State(output=True, start=1.0)

    def derivatives(x, k, d_x):
        d_x[0] = -k * x * abs(x)


class Plain(Block, compiled=False):
    """y = sin t, of which the interpreter takes care."""

    y = Output()

    def outputs(time, y):
        y[0] = math.sin(time)
