"""Noise that every run repeats: white, band-limited, and a random walk. Its numbers are `cosim.random`'s."""

from __future__ import annotations

import math

from cosim import Block, CalculatedParameter, Dimension, Parameter, Seed, State, Stream, random


class WhiteNoise(Block):
    """Discrete white noise: independent normal numbers of given mean and standard deviation, held over a period.

    ::

        y[k] = mean + deviation v[k],   v[k] ~ N(0, 1)

    Sampled: give it a `period`. As an approximation of continuous white noise of the
    two-sided power spectral density S, take deviation = sqrt(S / period). The first number is there a period after the
    start, and `mean` before.
    """

    mean = Parameter(default=0.0, description="mean")
    deviation = Parameter(default=1.0, min=0.0, description="standard deviation")
    seed = Seed()
    stream = Stream()
    n = Dimension(default=1, description="how many signals")
    y = State("n", output=True, description="noise")

    def start(mean, seed, y, stream):
        random.begin(stream, seed)
        y[:] = mean

    def update(mean, deviation, next_stream, next_y):
        for q in range(next_y.size):
            next_y[q] = mean + deviation * random.normal(next_stream)


class UniformNoise(Block):
    """Independent numbers, uniform from `low` to `high`, held over a period.

    ::

        y[k] = low + (high - low) v[k],   v[k] ~ U(0, 1)

    Sampled: give it a `period`. The first number is there a period after the start, and the middle before.
    """

    low = Parameter(default=0.0, description="lower end")
    high = Parameter(default=1.0, description="upper end")
    seed = Seed()
    stream = Stream()
    n = Dimension(default=1, description="how many signals")
    y = State("n", output=True, description="noise")

    def start(low, high, seed, y, stream):
        random.begin(stream, seed)
        y[:] = 0.5 * (low + high)

    def update(low, high, next_stream, next_y):
        for q in range(next_y.size):
            next_y[q] = low + (high - low) * random.uniform(next_stream)


class BandLimitedNoise(Block):
    """Noise of a given bandwidth and standard deviation: white noise through a first-order lag, sampled exactly.

    ::

        y[k+1] = a y[k] + sqrt(1 - a²) deviation v[k],   a = exp(-2 π bandwidth period),   v[k] ~ N(0, 1)

    It is an Ornstein-Uhlenbeck process at its samples, whose spectral density falls to a half at `bandwidth`, whatever
    the period. It starts in its stationary distribution's mean, 0. Sampled: give it a `period`.
    """

    bandwidth = Parameter(unit="Hz", default=1.0, min=0.0, description="frequency at which the density is halved")
    deviation = Parameter(default=1.0, min=0.0, description="standard deviation")
    seed = Seed()
    kept = CalculatedParameter(description="how much of a sample is in the next one")
    fresh = CalculatedParameter(description="how much of a sample is new")
    stream = Stream()
    n = Dimension(default=1, description="how many signals")
    y = State("n", output=True, description="noise")

    def calculate(bandwidth, deviation, period, kept, fresh):
        kept[0] = math.exp(-2.0 * math.pi * bandwidth * period)
        fresh[0] = deviation * math.sqrt(1.0 - kept[0] * kept[0])

    def start(seed, stream):
        random.begin(stream, seed)

    def update(y, kept, fresh, next_stream, next_y):
        for q in range(y.size):
            next_y[q] = kept * y[q] + fresh * random.normal(next_stream)


class RandomWalk(Block):
    """A random walk: Brownian motion at its samples.

    ::

        y[k+1] = y[k] + intensity sqrt(period) v[k],   v[k] ~ N(0, 1)

    Its variance grows by intensity² a second, whatever the period. Sampled: give it a `period`.
    """

    intensity = Parameter(default=1.0, min=0.0, description="standard deviation after one second")
    seed = Seed()
    stream = Stream()
    n = Dimension(default=1, description="how many signals")
    y = State("n", output=True, description="position of the walk")

    def start(seed, stream):
        random.begin(stream, seed)

    def update(y, intensity, period, next_stream, next_y):
        for q in range(y.size):
            next_y[q] = y[q] + intensity * math.sqrt(period) * random.normal(next_stream)
