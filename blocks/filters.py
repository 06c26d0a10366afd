"""Filters in continuous time: low-pass, high-pass, band-pass, notch."""

import math

import numpy as np

from cosim import Block, Input, Output, Parameter, State, rule


class LowPass(Block):
    """A Butterworth low-pass filter of second order, 3 dB down at its cut-off frequency.

    ::

        Y(s)            w^2
        ──── = ─────────────────────,   w = 2 pi cutoff
        U(s)   s^2 + sqrt(2) w s + w^2
    """

    u = Input("n?", description="signal")
    cutoff = Parameter("n?", unit="Hz", default=1.0, description="cut-off frequency")
    x = State("n?", output=True, description="filtered signal")
    v = State("n?", description="its derivative")

    positive = rule("cutoff > 0")(lambda cutoff: bool(np.all(cutoff > 0.0)))

    def derivatives(u, cutoff, x, v, d_x, d_v):
        for q in range(u.size):
            w = 2.0 * math.pi * cutoff[q]
            d_x[q] = v[q]
            d_v[q] = w * (w * (u[q] - x[q]) - math.sqrt(2.0) * v[q])


class HighPass(Block):
    """A Butterworth high-pass filter of second order, 3 dB down at its cut-off frequency.

    ::

        Y(s)            s^2
        ──── = ─────────────────────,   w = 2 pi cutoff
        U(s)   s^2 + sqrt(2) w s + w^2
    """

    u = Input("n?", description="signal")
    cutoff = Parameter("n?", unit="Hz", default=1.0, description="cut-off frequency")
    x = State("n?", description="low-passed signal")
    v = State("n?", description="its derivative")
    y = Output("n?", description="filtered signal")

    positive = rule("cutoff > 0")(lambda cutoff: bool(np.all(cutoff > 0.0)))

    def outputs(u, cutoff, x, v, y):
        for q in range(y.size):
            y[q] = u[q] - x[q] - math.sqrt(2.0) / (2.0 * math.pi * cutoff[q]) * v[q]

    def derivatives(u, cutoff, x, v, d_x, d_v):
        for q in range(u.size):
            w = 2.0 * math.pi * cutoff[q]
            d_x[q] = v[q]
            d_v[q] = w * (w * (u[q] - x[q]) - math.sqrt(2.0) * v[q])


class BandPass(Block):
    """A band-pass filter of second order, with gain 1 at its centre.

    ::

        Y(s)        (w / Q) s
        ──── = ───────────────────,   w = 2 pi centre,   Q = centre / bandwidth
        U(s)   s^2 + (w / Q) s + w^2
    """

    u = Input("n?", description="signal")
    centre = Parameter("n?", unit="Hz", default=1.0, description="centre frequency")
    Q = Parameter("n?", unit="1", default=1.0, description="quality: centre over bandwidth")
    x = State("n?", description="integral of the output")
    y = State("n?", output=True, description="filtered signal")

    positive = rule("centre, Q > 0")(lambda centre, Q: bool(np.all(centre > 0.0) and np.all(Q > 0.0)))

    def derivatives(u, centre, Q, x, y, d_x, d_y):
        for q in range(u.size):
            w = 2.0 * math.pi * centre[q]
            d_x[q] = w * y[q]
            d_y[q] = w * ((u[q] - y[q]) / Q[q] - x[q])


class Notch(Block):
    """A notch filter of second order: gain 0 at its centre, 1 far from it.

    ::

        Y(s)       s^2 + w^2
        ──── = ───────────────────,   w = 2 pi centre,   Q = centre / bandwidth
        U(s)   s^2 + (w / Q) s + w^2
    """

    u = Input("n?", description="signal")
    centre = Parameter("n?", unit="Hz", default=50.0, description="frequency that is taken out")
    Q = Parameter("n?", unit="1", default=1.0, description="quality: centre over bandwidth")
    x = State("n?", description="integral of the band, times 2 pi centre")
    z = State("n?", description="band that is taken out")
    y = Output("n?", description="filtered signal")

    positive = rule("centre, Q > 0")(lambda centre, Q: bool(np.all(centre > 0.0) and np.all(Q > 0.0)))

    def outputs(u, z, y):
        for q in range(y.size):
            y[q] = u[q] - z[q]

    def derivatives(u, centre, Q, x, z, d_x, d_z):
        for q in range(u.size):
            w = 2.0 * math.pi * centre[q]
            d_x[q] = w * z[q]
            d_z[q] = w * ((u[q] - z[q]) / Q[q] - x[q])
