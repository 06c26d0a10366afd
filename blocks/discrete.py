"""Sampled dynamics: delays, holds, difference equations, counters."""

import numpy as np

from cosim import Block, CalculatedParameter, Dimension, Indicator, Input, Output, Parameter, State, rule
from cosim.blocks.continuous import is_proper, is_strictly_proper, output_form
from cosim.blocks.sources import time_to


class UnitDelay(Block):
    """A delay by one sample.

    ::

        y[k] = u[k-1]
    """

    u = Input("n?", description="signal")
    y = State("n?", output=True, description="signal one period ago; at first, its start value")

    def update(u, next_y):
        for q in range(u.size):
            next_y[q] = u[q]


class Delay(Block):
    """A delay by several samples.

    ::

        y[k] = u[k - samples]
    """

    u = Input("n?", description="signal")
    samples = Parameter(dtype=np.int32, unit="1", default=1, description="how many samples, depth at most")
    depth = Dimension(default=64, description="the most samples")
    past = State("depth", "n?", description="the last samples, in a ring")
    head = State(dtype=np.int32, start=0, description="where the newest goes")
    y = Output("n?", description="delayed signal; before there is one, the start value of past")

    inside = rule("1 <= samples <= depth")(lambda samples, depth: 1 <= samples <= depth)

    def outputs(samples, past, head, y):
        for q in range(y.size):
            y[q] = past[(head - samples) % past.shape[0], q]

    def update(u, past, head, next_past, next_head):
        for q in range(u.size):
            next_past[head, q] = u[q]
        next_head[0] = (head + 1) % past.shape[0]


class ZeroOrderHold(Block):
    """A signal as it was at the last sample; with a `period`.

    ::

        y(t) = u(t_k)   for t_k <= t < t_k+1
    """

    u = Input("n?", description="signal")
    y = Output("n?", description="held signal")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = u[q]


class FirstOrderHold(Block):
    """A line through the last two samples, which goes on until the next one. It takes its samples by events.

    ::

        y(t) = u(t_k) + (u(t_k) - u(t_k-1)) (t - t_k) / T   for t_k <= t < t_k+1,   t_k = k T

    As its output goes on between samples, T is a parameter, and there is no `period`.
    """

    u = Input("n?", description="signal")
    T = Parameter(unit="s", default=0.1, description="time between samples")
    last = State("n?", description="last sample")
    slope = State("n?", description="slope of the line")
    count = State(dtype=np.int64, start=0, unit="1", description="how many samples there have been after the first")
    due = Indicator(crossing="falling", unit="s", description="time to the next sample")
    y = Output("n?", description="the line")

    positive = rule("T > 0")(lambda T: T > 0.0)

    def start(u, last):
        for q in range(u.size):
            last[q] = u[q]

    def outputs(time, T, last, slope, count, y):
        for q in range(y.size):
            y[q] = last[q] + slope[q] * (time - count * T)

    def indicators(time, T, count, due):
        due[0] = time_to((count + 1) * T, time)

    def event(u, T, due, last, count, next_last, next_slope, next_count):
        if due < 0:
            next_count[0] = count + 1
            for q in range(u.size):
                next_slope[q] = (u[q] - last[q]) / T
                next_last[q] = u[q]


class DiscreteIntegrator(Block):
    """A sampled integral, by forward differences.

    ::

        y[k+1] = y[k] + k T u[k],   T the period
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain")
    y = State("n?", output=True, description="integral")

    def update(u, k, period, y, next_y):
        for q in range(u.size):
            next_y[q] = y[q] + k[q] * period * u[q]


class DiscreteDerivative(Block):
    """A difference quotient.

    ::

        y[k] = (u[k] - u[k-1]) / T,   T the period
    """

    u = Input("n?", description="signal")
    last = State("n?", description="last sample")
    y = Output("n?", description="quotient")

    def start(u, last):
        for q in range(u.size):
            last[q] = u[q]

    def outputs(u, last, period, y):
        for q in range(y.size):
            y[q] = (u[q] - last[q]) / period

    def update(u, next_last):
        for q in range(u.size):
            next_last[q] = u[q]


class DiscreteTransferFunction(Block):
    """A transfer function of z with fewer zeros than poles; else take `DiscreteTransferFunctionFeedthrough`.

    ::

        Y(z)   b_0 z^m + … + b_m
        ──── = ─────────────────,   m < n
        U(z)   a_0 z^n + … + a_n

    Coefficients stand from the highest power of z to the constant one. In transposed direct form II, as that of
    `scipy.signal.lfilter`. A vector is filtered element by element.
    """

    order = Dimension(of="coefficients", less=1, description="number of poles")

    u = Input("n?", description="signal")
    numerator = Parameter("zeros", default=(1.0,), description="b_0, …, b_m")
    denominator = Parameter("coefficients", default=(1.0, 0.0), description="a_0, …, a_n")
    num = CalculatedParameter("coefficients", description="b over a_0, as long as the denominator")
    den = CalculatedParameter("coefficients", description="a over a_0")
    x = State("n?", "order", description="states")
    y = Output("n?", description="output")

    proper = rule("fewer coefficients in the numerator than in the denominator, whose first is not 0")(
        is_strictly_proper
    )

    def calculate(numerator, denominator, num, den):
        output_form(numerator, denominator, num, den)

    def outputs(x, y):
        for q in range(y.size):
            y[q] = x[q, 0]

    def update(u, num, den, x, y, next_x):
        last = num.size - 2
        for q in range(u.size):
            for k in range(last):
                next_x[q, k] = x[q, k + 1] + num[k + 1] * u[q] - den[k + 1] * y[q]
            next_x[q, last] = num[last + 1] * u[q] - den[last + 1] * y[q]


class DiscreteTransferFunctionFeedthrough(DiscreteTransferFunction):
    """A transfer function of z with as many zeros as poles, or fewer, whose output follows its input at once.

    ::

        Y(z)   b_0 z^m + … + b_m
        ──── = ─────────────────,   m <= n
        U(z)   a_0 z^n + … + a_n
    """

    proper = rule("no more coefficients in the numerator than in the denominator, whose first is not 0")(is_proper)

    def outputs(u, num, x, y):
        for q in range(y.size):
            y[q] = num[0] * u[q] + x[q, 0]


class FIR(Block):
    """A filter of finite impulse response.

    ::

        y[k] = b_0 u[k] + b_1 u[k-1] + …
    """

    past = Dimension(of="taps", less=1, description="how many samples it remembers")

    u = Input("n?", description="signal")
    b = Parameter("taps", default=(0.5, 0.5), description="coefficients, two at least")
    x = State("n?", "past", description="last samples, the newest first")
    y = Output("n?", description="output")

    def outputs(u, b, x, y):
        for q in range(y.size):
            y[q] = b[0] * u[q]
            for k in range(1, b.size):
                y[q] += b[k] * x[q, k - 1]

    def update(u, b, x, next_x):
        for q in range(u.size):
            next_x[q, 0] = u[q]
            for k in range(1, b.size - 1):
                next_x[q, k] = x[q, k - 1]


class MovingAverage(Block):
    """The mean of the last samples; of those that there are, at first.

    ::

        y[k] = (u[k] + … + u[k - samples + 1]) / samples
    """

    samples = Dimension(default=10, description="how many samples, two at least")
    before = Dimension(of="samples", less=1, description="how many it remembers")

    u = Input("n?", description="signal")
    x = State("n?", "before", description="last samples, the newest first")
    count = State(dtype=np.int32, start=0, description="how many of them there are")
    y = Output("n?", description="mean")

    def outputs(u, x, count, y):
        for q in range(y.size):
            total = u[q]
            for k in range(count):
                total += x[q, k]
            y[q] = total / (count + 1)

    def update(u, x, count, next_x, next_count):
        for q in range(u.size):
            next_x[q, 0] = u[q]
            for k in range(1, x.shape[1]):
                next_x[q, k] = x[q, k - 1]
        next_count[0] = min(count + 1, x.shape[1])


class DiscreteStateSpace(Block):
    """A sampled linear system, whose outputs are of its states alone; else take `DiscreteStateSpaceFeedthrough`.

    ::

        x[k+1] = A x[k] + B u[k],   y[k] = C x[k]

    Inputs and outputs may be one number each: B has one column then, C one row.
    """

    u = Input("m?", description="inputs")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    C = Parameter("p", "n", description="output matrix")
    x = State("n", description="states")
    y = Output("p?", description="outputs")

    def outputs(C, x, y):
        for i in range(y.size):
            y[i] = 0.0
            for j in range(x.size):
                y[i] += C[i, j] * x[j]

    def update(u, A, B, x, next_x):
        for i in range(x.size):
            total = 0.0
            for j in range(x.size):
                total += A[i, j] * x[j]
            for j in range(u.size):
                total += B[i, j] * u[j]
            next_x[i] = total


class DiscreteStateSpaceFeedthrough(DiscreteStateSpace):
    """A sampled linear system, whose outputs follow its inputs at once.

    ::

        x[k+1] = A x[k] + B u[k],   y[k] = C x[k] + D u[k]
    """

    D = Parameter("p", "m", default=0.0, description="feedthrough")

    def outputs(u, C, D, x, y):
        for i in range(y.size):
            y[i] = 0.0
            for j in range(x.size):
                y[i] += C[i, j] * x[j]
            for j in range(u.size):
                y[i] += D[i, j] * u[j]


class SampleAndHold(Block):
    """A signal as it was when another one last rose through zero.

    ::

        y = u(t_k),   t_k the last time at which trigger rose through 0
    """

    u = Input("n?", description="signal")
    trigger = Input(description="samples where it rises through zero")
    y = State("n?", output=True, description="held signal")
    rises = Indicator(crossing="rising", description="the trigger")

    def indicators(trigger, rises):
        rises[0] = trigger

    def event(u, rises, next_y):
        for q in range(u.size):
            if rises > 0:
                next_y[q] = u[q]


class Counter(Block):
    """How often a signal has risen through zero.

    ::

        count = number of times at which u rose through 0
    """

    u = Input("n?", description="signal")
    count = State("n?", output=True, dtype=np.int32, start=0, unit="1", description="count")
    rises = Indicator("n?", crossing="rising", description="the signal")

    def indicators(u, rises):
        for q in range(u.size):
            rises[q] = u[q]

    def event(rises, count, next_count):
        for q in range(rises.size):
            if rises[q] > 0:
                next_count[q] = count[q] + 1
