"""PID controllers, in continuous time and sampled."""

import math

import numpy as np

from cosim import Block, CalculatedParameter, Input, Output, Parameter, State, rule
from cosim.blocks.nonlinear import clamp


def tracking_time(T_t: float, k_p: float, k_i: float, k_d: float) -> float:
    """The time constant with which the integral follows what is limited (s), sqrt(T_i T_d) or T_i unless given."""
    if T_t > 0.0:
        return T_t
    if k_i * k_d > 0.0:
        return math.sqrt(k_d / k_i)
    return k_p / k_i if k_p * k_i > 0.0 else 1.0


class PID(Block):
    """A PID controller with filtered derivative, set-point weights, limits, and back-calculation against windup.

    ::

        v = k_p (b r - y) + i + d + feed_forward,   u = min(max(v, lower), upper)
        di/dt = k_i (r - y) + (u - v) / T_t
        D(s) = k_d s / (T_f s + 1) (c R(s) - Y(s))

    The derivative begins at zero. Åström and Hägglund, Advanced PID Control (2006), sections 3.3 and 3.5.
    """

    r = Input("n?", description="set point")
    y = Input("n?", description="measurement")
    feed_forward = Input("n?", start=0.0, description="added to the output")
    k_p = Parameter("n?", default=1.0, description="proportional gain")
    k_i = Parameter("n?", default=0.0, description="integral gain, k_p / T_i")
    k_d = Parameter("n?", default=0.0, description="derivative gain, k_p T_d")
    T_f = Parameter("n?", unit="s", default=0.01, description="time constant of the derivative's filter")
    b = Parameter("n?", unit="1", default=1.0, description="weight of the set point in the proportional part")
    c = Parameter("n?", unit="1", default=0.0, description="weight of the set point in the derivative")
    lower = Parameter("n?", default=-np.inf, description="lower limit of the output")
    upper = Parameter("n?", default=np.inf, description="upper limit of the output")
    T_t = Parameter("n?", unit="s", default=0.0, description="time constant of anti-windup; 0: sqrt(T_i T_d), or T_i")
    T_track = CalculatedParameter("n?", unit="s", description="time constant of anti-windup")
    i = State("n?", description="integral part")
    x = State("n?", description="what is differentiated, smoothed")
    v = Output("n?", description="output before it is limited")
    u = Output("n?", description="output")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(lower < upper)))
    positive = rule("T_f > 0")(lambda T_f: bool(np.all(T_f > 0.0)))
    tracking = rule("T_t >= 0")(lambda T_t: bool(np.all(T_t >= 0.0)))

    def calculate(T_t, k_p, k_i, k_d, T_track):
        for q in range(T_track.size):
            T_track[q] = tracking_time(T_t[q], k_p[q], k_i[q], k_d[q])

    def start(r, y, c, x):
        for q in range(x.size):
            x[q] = c[q] * r[q] - y[q]

    def outputs(r, y, feed_forward, k_p, k_d, T_f, b, c, lower, upper, i, x, v, u):
        for q in range(u.size):
            slope = (c[q] * r[q] - y[q] - x[q]) / T_f[q]
            v[q] = k_p[q] * (b[q] * r[q] - y[q]) + i[q] + k_d[q] * slope + feed_forward[q]
            u[q] = clamp(v[q], lower[q], upper[q])

    def derivatives(r, y, k_i, T_f, c, T_track, x, v, u, d_i, d_x):
        for q in range(u.size):
            d_i[q] = k_i[q] * (r[q] - y[q]) + (u[q] - v[q]) / T_track[q]
            d_x[q] = (c[q] * r[q] - y[q] - x[q]) / T_f[q]


class DiscretePID(Block):
    """A sampled PID controller: `PID` with forward differences for the integral, backward ones for the derivative.

    ::

        v[k] = k_p (b r[k] - y[k]) + i[k] + d[k] + feed_forward[k],   u[k] = min(max(v[k], lower), upper)
        d[k] = T_f / (T_f + T) d[k-1] + k_d / (T_f + T) (e_d[k] - e_d[k-1]),   e_d = c r - y,   T the period
        i[k+1] = i[k] + k_i T (r[k] - y[k]) + min(T / T_t, 1) (u[k] - v[k])

    Åström and Wittenmark, Computer-Controlled Systems (1997), section 8.5.
    """

    r = Input("n?", description="set point")
    y = Input("n?", description="measurement")
    feed_forward = Input("n?", start=0.0, description="added to the output")
    k_p = Parameter("n?", default=1.0, description="proportional gain")
    k_i = Parameter("n?", default=0.0, description="integral gain, k_p / T_i")
    k_d = Parameter("n?", default=0.0, description="derivative gain, k_p T_d")
    T_f = Parameter("n?", unit="s", default=0.0, description="time constant of the derivative's filter")
    b = Parameter("n?", unit="1", default=1.0, description="weight of the set point in the proportional part")
    c = Parameter("n?", unit="1", default=0.0, description="weight of the set point in the derivative")
    lower = Parameter("n?", default=-np.inf, description="lower limit of the output")
    upper = Parameter("n?", default=np.inf, description="upper limit of the output")
    T_t = Parameter("n?", unit="s", default=0.0, description="time constant of anti-windup; 0: sqrt(T_i T_d), or T_i")
    T_track = CalculatedParameter("n?", unit="s", description="time constant of anti-windup")
    i = State("n?", description="integral part")
    d_last = State("n?", description="derivative part of the last sample")
    e_last = State("n?", description="what was differentiated at the last sample")
    d = Output("n?", description="derivative part")
    v = Output("n?", description="output before it is limited")
    u = Output("n?", description="output")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(lower < upper)))
    positive = rule("T_f, T_t >= 0")(lambda T_f, T_t: bool(np.all(T_f >= 0.0) and np.all(T_t >= 0.0)))

    def calculate(T_t, k_p, k_i, k_d, T_track):
        for q in range(T_track.size):
            T_track[q] = tracking_time(T_t[q], k_p[q], k_i[q], k_d[q])

    def start(r, y, c, e_last):
        for q in range(e_last.size):
            e_last[q] = c[q] * r[q] - y[q]

    def outputs(r, y, feed_forward, k_p, k_d, T_f, b, c, lower, upper, period, i, d_last, e_last, d, v, u):
        for q in range(u.size):
            change = c[q] * r[q] - y[q] - e_last[q]
            d[q] = (T_f[q] * d_last[q] + k_d[q] * change) / (T_f[q] + period)
            v[q] = k_p[q] * (b[q] * r[q] - y[q]) + i[q] + d[q] + feed_forward[q]
            u[q] = clamp(v[q], lower[q], upper[q])

    def update(r, y, k_i, c, period, T_track, i, d, v, u, next_i, next_d_last, next_e_last):
        for q in range(u.size):
            back = min(period / T_track[q], 1.0) * (u[q] - v[q])
            next_i[q] = i[q] + k_i[q] * period * (r[q] - y[q]) + back
            next_d_last[q] = d[q]
            next_e_last[q] = c[q] * r[q] - y[q]
