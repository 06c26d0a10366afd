"""Random numbers that every run repeats: drawn from a stream, which is a discrete state of the block.

    class Noise(Block):
        y = State(output=True, start=0.0)
        seed = Seed()
        stream = Stream()

        def start(seed, stream):
            random.begin(stream, seed)

        def update(next_stream, next_y):
            next_y[0] = random.normal(next_stream)

A stream is two whole numbers, a key and how many numbers have been drawn, and each number is a function of these:
Philox 4x32-10 (Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy as 1, 2, 3, SC 2011). So a step that is
repeated, a run that is resumed, and an exported FMU draw the same numbers, and so do both engines.
"""

from __future__ import annotations

import math
from typing import Any

_LOW = 0xFFFFFFFF


def begin(stream: Any, seed: int) -> None:
    """Begin a stream, in `start`. seed: any whole number; each has numbers of its own."""
    stream[0] = seed
    stream[1] = 0


def uniform(stream: Any) -> float:
    """The next number of a stream, ``next_<stream>`` in `update`: uniform, above 0 and below 1, of 52 random bits."""
    x0, x1, _, _ = philox(stream[1] & _LOW, (stream[1] >> 32) & _LOW, 0, 0, stream[0] & _LOW, (stream[0] >> 32) & _LOW)
    stream[1] += 1
    return _fraction(x0, x1)


def normal(stream: Any) -> float:
    """The next number of a stream, ``next_<stream>`` in `update`: normal, of mean 0 and variance 1.

    By Box and Muller's transform of two uniform numbers.
    """
    x0, x1, x2, x3 = philox(
        stream[1] & _LOW, (stream[1] >> 32) & _LOW, 0, 0, stream[0] & _LOW, (stream[0] >> 32) & _LOW
    )
    stream[1] += 1
    return math.sqrt(-2.0 * math.log(_fraction(x0, x1))) * math.cos(2.0 * math.pi * _fraction(x2, x3))


def _fraction(high: int, low: int) -> float:
    """A number above 0 and below 1, of the first 32 bits of one word and 20 of another."""
    return ((high << 20) + (low >> 12) + 0.5) / 4503599627370496.0


def philox(c0: int, c1: int, c2: int, c3: int, k0: int, k1: int) -> tuple[int, int, int, int]:
    """Four words of 32 random bits, by a counter of four and a key of two."""
    for _ in range(10):
        a = 0xD2511F53 * c0
        b = 0xCD9E8D57 * c2
        c0, c1, c2, c3 = ((b >> 32) & _LOW) ^ c1 ^ k0, b & _LOW, ((a >> 32) & _LOW) ^ c3 ^ k1, a & _LOW
        k0 = (k0 + 0x9E3779B9) & _LOW
        k1 = (k1 + 0xBB67AE85) & _LOW
    return c0, c1, c2, c3
