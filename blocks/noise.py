"""Noise that every run repeats: white, band-limited, and a random walk. Its numbers are `cosim.random`'s."""

from __future__ import annotations

import math

from cosim import Block, CalculatedParameter, Parameter, Seed, State, Stream, random


class WhiteNoise(Block):
    """Discrete white noise: independent normal numbers of given mean and standard deviation, held over a period.

    ::

        y[k] = mean + deviation v[k],   v[k] ~ N(0, 1)

    Sampled: give it a `period`. As an approximation of continuous white noise of the two-sided power spectral density
    S, take deviation = sqrt(S / period). The first number is there a period after the start, and `mean` before. It is a
    scalar, or a vector where a parameter is one or `dimensions: {n: 3}` says so; so are the others here.
    """

    mean = Parameter("n?", default=0.0, description="mean")
    deviation = Parameter("n?", default=1.0, min=0.0, description="standard deviation")
    seed = Seed()
    stream = Stream()
    y = State("n?", output=True, description="noise")

    def start(mean, seed, y, stream):
        random.begin(stream, seed)
        y[:] = mean

    def update(mean, deviation, next_stream, next_y):
        for q in range(next_y.size):
            next_y[q] = mean[q] + deviation[q] * random.normal(next_stream)


class UniformNoise(Block):
    """Independent numbers, uniform from `low` to `high`, held over a period.

    ::

        y[k] = low + (high - low) v[k],   v[k] ~ U(0, 1)

    Sampled: give it a `period`. The first number is there a period after the start, and the middle before.
    """

    low = Parameter("n?", default=0.0, description="lower end")
    high = Parameter("n?", default=1.0, description="upper end")
    seed = Seed()
    stream = Stream()
    y = State("n?", output=True, description="noise")

    def start(low, high, seed, y, stream):
        random.begin(stream, seed)
        y[:] = 0.5 * (low + high)

    def update(low, high, next_stream, next_y):
        for q in range(next_y.size):
            next_y[q] = low[q] + (high[q] - low[q]) * random.uniform(next_stream)


class BandLimitedNoise(Block):
    """Noise of a given bandwidth and standard deviation: white noise through a first-order lag, sampled exactly.

    ::

        y[k+1] = a y[k] + sqrt(1 - a²) deviation v[k],   a = exp(-2 π bandwidth period),   v[k] ~ N(0, 1)

    It is an Ornstein-Uhlenbeck process at its samples, whose spectral density falls to a half at `bandwidth`, whatever
    the period. It starts in its stationary distribution's mean, 0. Sampled: give it a `period`.
    """

    bandwidth = Parameter("n?", unit="Hz", default=1.0, min=0.0, description="frequency at which the density is halved")
    deviation = Parameter("n?", default=1.0, min=0.0, description="standard deviation")
    seed = Seed()
    kept = CalculatedParameter("n?", description="how much of a sample is in the next one")
    fresh = CalculatedParameter("n?", description="how much of a sample is new")
    stream = Stream()
    y = State("n?", output=True, description="noise")

    def calculate(bandwidth, deviation, period, kept, fresh):
        for q in range(kept.size):
            kept[q] = math.exp(-2.0 * math.pi * bandwidth[q] * period)
            fresh[q] = deviation[q] * math.sqrt(1.0 - kept[q] * kept[q])

    def start(seed, stream):
        random.begin(stream, seed)

    def update(y, kept, fresh, next_stream, next_y):
        for q in range(y.size):
            next_y[q] = kept[q] * y[q] + fresh[q] * random.normal(next_stream)


class RandomWalk(Block):
    """A random walk: Brownian motion at its samples.

    ::

        y[k+1] = y[k] + intensity sqrt(period) v[k],   v[k] ~ N(0, 1)

    Its variance grows by intensity² a second, whatever the period. Sampled: give it a `period`.
    """

    intensity = Parameter("n?", default=1.0, min=0.0, description="standard deviation after one second")
    seed = Seed()
    stream = Stream()
    y = State("n?", output=True, description="position of the walk")

    def start(seed, stream):
        random.begin(stream, seed)

    def update(y, intensity, period, next_stream, next_y):
        for q in range(y.size):
            next_y[q] = y[q] + intensity[q] * math.sqrt(period) * random.normal(next_stream)
