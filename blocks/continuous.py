"""Dynamics in continuous time: integrator, derivative, transfer functions, state space, lead-lag."""

import math

import numpy as np
from numpy.typing import NDArray

from cosim import Block, CalculatedParameter, Dimension, Indicator, Input, Output, Parameter, State, rule
from cosim.blocks.nonlinear import clamp, distance


class Integrator(Block):
    """The integral of a signal.

    ::

        dx/dt = k u
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain")
    x = State("n?", output=True, description="integral")

    def derivatives(u, k, d_x):
        for q in range(u.size):
            d_x[q] = k[q] * u[q]


class LimitedIntegrator(Block):
    """An integral that stays between two limits, and goes back to a value where another signal rises through zero.

    ::

        dx/dt = k u,   0 where x is at a limit and k u leads beyond it
        x = x_reset    where `reset` rises through zero

    Reaching a limit, leaving it and the reset are events.
    """

    u = Input("n?", description="signal")
    reset = Input(start=-1.0, description="where it rises through zero, x begins anew")
    x_reset = Input("n?", start=0.0, description="where x begins anew")
    k = Parameter("n?", default=1.0, description="gain")
    lower = Parameter("n?", default=-np.inf, description="lower limit")
    upper = Parameter("n?", default=np.inf, description="upper limit")
    x_start = Parameter("n?", default=0.0, description="where it begins, within the limits")
    x = State("n?", output=True, description="integral")
    side = State("n?", dtype=np.int32, start=0, description="-1 at the lower limit, 1 at the upper one, 0 between")
    below_upper = Indicator("n?", crossing="falling", description="distance from the upper limit, while between")
    above_lower = Indicator("n?", crossing="falling", description="distance from the lower limit, while between")
    leaves = Indicator("n?", crossing="rising", description="how u leads away from the limit where x is")
    resets = Indicator(crossing="rising", description="the signal that resets")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(lower < upper)))

    def start(x_start, lower, upper, x, side):
        for q in range(x.size):
            x[q] = clamp(x_start[q], lower[q], upper[q])
            side[q] = 1 if x_start[q] >= upper[q] else (-1 if x_start[q] <= lower[q] else 0)

    def derivatives(u, k, side, d_x):
        for q in range(u.size):
            d_x[q] = k[q] * u[q] if side[q] == 0 or side[q] * k[q] * u[q] < 0.0 else 0.0

    def indicators(u, reset, k, lower, upper, x, side, below_upper, above_lower, leaves, resets):
        for q in range(u.size):
            below_upper[q] = -distance(x[q], upper[q]) if side[q] == 0 else 1.0
            above_lower[q] = distance(x[q], lower[q]) if side[q] == 0 else 1.0
            leaves[q] = -side[q] * k[q] * u[q] if side[q] != 0 else -1.0
        resets[0] = reset

    def event(x_reset, lower, upper, below_upper, above_lower, leaves, resets, next_x, next_side):
        for q in range(x_reset.size):
            if resets > 0:
                next_x[q] = min(max(x_reset[q], lower[q]), upper[q])
                next_side[q] = 1 if x_reset[q] >= upper[q] else (-1 if x_reset[q] <= lower[q] else 0)
            elif below_upper[q] < 0:
                next_x[q] = upper[q]
                next_side[q] = 1
            elif above_lower[q] < 0:
                next_x[q] = lower[q]
                next_side[q] = -1
            elif leaves[q] > 0:
                next_side[q] = 0


class Derivative(Block):
    """The derivative of a signal, smoothed by a first-order lag.

    ::

        Y(s) = s / (T s + 1) U(s),   as  dx/dt = (u - x) / T,   y = (u - x) / T

    It begins as that of a constant, unless x has another start value.
    """

    u = Input("n?", description="signal")
    T = Parameter("n?", unit="s", default=0.01, description="time constant of the filter")
    x = State("n?", description="smoothed signal")
    y = Output("n?", description="derivative")

    positive = rule("T > 0")(lambda T: bool(np.all(T > 0.0)))

    def start(u, x):
        for q in range(x.size):
            x[q] = u[q]

    def outputs(u, T, x, y):
        for q in range(y.size):
            y[q] = (u[q] - x[q]) / T[q]

    def derivatives(u, T, x, d_x):
        for q in range(u.size):
            d_x[q] = (u[q] - x[q]) / T[q]


class FirstOrder(Block):
    """A first-order lag.

    ::

        T dx/dt = k u - x
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain")
    T = Parameter("n?", unit="s", default=1.0, description="time constant")
    x = State("n?", output=True, description="output")

    positive = rule("T > 0")(lambda T: bool(np.all(T > 0.0)))

    def derivatives(u, k, T, x, d_x):
        for q in range(u.size):
            d_x[q] = (k[q] * u[q] - x[q]) / T[q]


class SecondOrder(Block):
    """A second-order lag.

    ::

        d2x/dt2 + 2 zeta omega dx/dt + omega^2 x = k omega^2 u
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain")
    omega = Parameter("n?", unit="rad/s", default=1.0, description="natural frequency")
    zeta = Parameter("n?", unit="1", default=0.7, description="damping ratio")
    x = State("n?", output=True, description="output")
    v = State("n?", output=True, description="its derivative")

    positive = rule("omega > 0")(lambda omega: bool(np.all(omega > 0.0)))

    def derivatives(u, k, omega, zeta, x, v, d_x, d_v):
        for q in range(u.size):
            d_x[q] = v[q]
            d_v[q] = omega[q] * (omega[q] * (k[q] * u[q] - x[q]) - 2.0 * zeta[q] * v[q])


def output_form(numerator: NDArray, denominator: NDArray, num: NDArray, den: NDArray) -> None:
    """Coefficients over the leading one of the denominator, padded to its length with zeros in front."""
    lead = denominator[0]
    for k in range(denominator.size):
        behind = k - denominator.size + numerator.size
        num[k] = numerator[behind] / lead if behind >= 0 else 0.0
        den[k] = denominator[k] / lead


def is_proper(numerator: NDArray, denominator: NDArray) -> bool:
    """Whether a transfer function has no more zeros than poles, one pole at least, and a leading coefficient."""
    return 1 <= len(numerator) <= len(denominator) and len(denominator) > 1 and denominator[0] != 0.0


def is_strictly_proper(numerator: NDArray, denominator: NDArray) -> bool:
    """Whether a transfer function has fewer zeros than poles, and a leading coefficient."""
    return 1 <= len(numerator) < len(denominator) and denominator[0] != 0.0


class TransferFunction(Block):
    """A transfer function with fewer zeros than poles; else take `TransferFunctionFeedthrough`.

    ::

        Y(s)   b_0 s^m + … + b_m
        ──── = ─────────────────,   m < n
        U(s)   a_0 s^n + … + a_n

    Coefficients stand from the highest power of s to the constant one, as in `scipy.signal`. In controllable form:
    dx_1/dt = (a_0 u - a_1 x_1 - … - a_n x_n) / a_0, dx_{k+1}/dt = x_k. A vector is filtered element by element.
    """

    order = Dimension(of="coefficients", less=1, description="number of poles")

    u = Input("n?", description="signal")
    numerator = Parameter("zeros", default=(1.0,), description="b_0, …, b_m")
    denominator = Parameter("coefficients", default=(1.0, 1.0), description="a_0, …, a_n")
    num = CalculatedParameter("coefficients", description="b over a_0, as long as the denominator")
    den = CalculatedParameter("coefficients", description="a over a_0")
    x = State("n?", "order", description="states")
    y = Output("n?", description="output")

    proper = rule("fewer coefficients in the numerator than in the denominator, whose first is not 0")(
        is_strictly_proper
    )

    def calculate(numerator, denominator, num, den):
        output_form(numerator, denominator, num, den)

    def outputs(num, x, y):
        for q in range(y.size):
            y[q] = 0.0
            for k in range(1, num.size):
                y[q] += num[k] * x[q, k - 1]

    def derivatives(u, den, x, d_x):
        for q in range(u.size):
            d_x[q, 0] = u[q]
            for k in range(1, den.size):
                d_x[q, 0] -= den[k] * x[q, k - 1]
            for k in range(1, den.size - 1):
                d_x[q, k] = x[q, k - 1]


class TransferFunctionFeedthrough(TransferFunction):
    """A transfer function with as many zeros as poles, or fewer, whose output follows its input at once.

    ::

        Y(s)   b_0 s^m + … + b_m
        ──── = ─────────────────,   m <= n
        U(s)   a_0 s^n + … + a_n
    """

    proper = rule("no more coefficients in the numerator than in the denominator, whose first is not 0")(is_proper)

    def outputs(u, num, den, x, y):
        for q in range(y.size):
            y[q] = num[0] * u[q]
            for k in range(1, num.size):
                y[q] += (num[k] - num[0] * den[k]) * x[q, k - 1]


def fill(given: NDArray, value: float, filled: NDArray) -> None:
    """What is given, and a value for the rest."""
    for k in range(filled.size):
        filled[k] = given[k] if k < given.size else value


class ZeroPoleGain(Block):
    """A transfer function with fewer zeros than poles, all of them real; complex ones stand in `TransferFunction`.

    ::

        Y(s)     (s - z_1) … (s - z_m)
        ──── = k ─────────────────────,   m < n
        U(s)     (s - p_1) … (s - p_n)

    as a chain of first-order parts, of which the last have no zero.
    """

    u = Input("n?", description="signal")
    zeros = Parameter("m?", unit="1/s", default=math.inf, description="zeros; .inf for none")
    poles = Parameter("order", unit="1/s", default=(-1.0,), description="poles")
    k = Parameter(default=1.0, description="gain")
    all_zeros = CalculatedParameter("order", unit="1/s", finite=False, description="a zero for each pole; inf: none")
    x = State("n?", "order", description="states")
    y = Output("n?", description="output")

    proper = rule("fewer zeros than poles")(lambda zeros, poles: np.sum(np.isfinite(zeros)) < len(poles))

    def calculate(zeros, all_zeros):
        fill(zeros, math.inf, all_zeros)

    def outputs(x, y):
        for q in range(y.size):
            y[q] = x[q, x.shape[1] - 1]

    def derivatives(u, all_zeros, poles, k, x, d_x):
        for q in range(u.size):
            before = k * u[q]
            for j in range(poles.size):
                d_x[q, j] = poles[j] * x[q, j] + before
                before = x[q, j] if math.isinf(all_zeros[j]) else before + (poles[j] - all_zeros[j]) * x[q, j]


class StateSpace(Block):
    """A linear system in state space, whose outputs are of its states alone; else take `StateSpaceFeedthrough`.

    ::

        dx/dt = A x + B u,   y = C x

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

    def derivatives(u, A, B, x, d_x):
        for i in range(x.size):
            d_x[i] = 0.0
            for j in range(x.size):
                d_x[i] += A[i, j] * x[j]
            for j in range(u.size):
                d_x[i] += B[i, j] * u[j]


class StateSpaceFeedthrough(StateSpace):
    """A linear system in state space, whose outputs follow its inputs at once.

    ::

        dx/dt = A x + B u,   y = C x + D u
    """

    D = Parameter("p", "m", default=0.0, description="feedthrough")

    def outputs(u, C, D, x, y):
        for i in range(y.size):
            y[i] = 0.0
            for j in range(x.size):
                y[i] += C[i, j] * x[j]
            for j in range(u.size):
                y[i] += D[i, j] * u[j]


class LeadLag(Block):
    """A lead (T_1 > T_2) or lag (T_1 < T_2) compensator.

    ::

        Y(s)     T_1 s + 1
        ──── = k ─────────
        U(s)     T_2 s + 1
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain at low frequencies")
    T_1 = Parameter("n?", unit="s", default=1.0, description="time constant of the zero")
    T_2 = Parameter("n?", unit="s", default=0.1, description="time constant of the pole")
    x = State("n?", description="lagging part")
    y = Output("n?", description="output")

    positive = rule("T_2 > 0")(lambda T_2: bool(np.all(T_2 > 0.0)))

    def outputs(u, k, T_1, T_2, x, y):
        for q in range(y.size):
            y[q] = k[q] * (x[q] + T_1[q] / T_2[q] * (u[q] - x[q]))

    def derivatives(u, T_2, x, d_x):
        for q in range(u.size):
            d_x[q] = (u[q] - x[q]) / T_2[q]


class TransportDelay(Block):
    """A delay by a Padé approximation of second order. A wire with `delay: 0.02` is an exact one.

    ::

        Y(s)   T^2 s^2 - 6 T s + 12
        ──── = ────────────────────  ≈  e^(-T s)
        U(s)   T^2 s^2 + 6 T s + 12
    """

    u = Input("n?", description="signal")
    T = Parameter("n?", unit="s", default=0.1, description="delay")
    x = State("n?", 2, description="states")
    y = Output("n?", description="delayed signal")

    positive = rule("T > 0, and finite")(lambda T: bool(np.all((T > 0.0) & np.isfinite(T))))

    def outputs(u, T, x, y):
        for q in range(y.size):
            y[q] = u[q] - 12.0 / T[q] * x[q, 0]

    def derivatives(u, T, x, d_x):
        for q in range(u.size):
            d_x[q, 0] = u[q] - 6.0 / T[q] * x[q, 0] - 12.0 / (T[q] * T[q]) * x[q, 1]
            d_x[q, 1] = x[q, 0]
