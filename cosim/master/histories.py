"""What a wire brought so far: for an input that is read late, or between and beyond communication points.

A history is a ring of the newest samples. Its value at a time is that of a polynomial: between two samples of that
through the later one and so many before it, beyond the newest through that and so many before it; of order 0 it is the
newest sample that is not later. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.machine.memory import reals_at, words_at

# In words: the input's memory, that of what comes in (both offsets), how many words that is, the room for samples, the
# orders beyond and between samples, the delay (s, a float64), how many samples there are, the place of the newest, the
# largest magnitude so far (a float64); then times (s), samples, and a value that nobody reads for long.
HISTORY_WORDS = 10
TO, FRESH, WORDS, ROOM, BEYOND, BETWEEN, DELAY, FILLED, NEWEST, LARGEST = range(HISTORY_WORDS)
NEAR = 1e-9  # of the distance of two samples: as near as that, a time is that of a sample


def words(room: int, width: int) -> int:
    """How many words a history takes that has room for so many samples of so many words."""
    return HISTORY_WORDS + room * (1 + width) + width


def head(to: int, fresh: int, width: int, room: int, orders: tuple[int, int], delay: float) -> np.ndarray:
    """The first words of a history without samples. orders: beyond and between samples; delay: in s."""
    made = np.array([to, fresh, width, room, *orders, 0, 0, room - 1, 0], np.int64)
    made.view(np.float64)[DELAY] = delay
    return made


def push(base: int, history: int, time: float) -> None:
    """Keep what comes in as the sample of a time (s); one of the same time is replaced, and later ones are dropped."""
    h = words_at(base + history, HISTORY_WORDS)
    times = reals_at(base + history + HISTORY_WORDS * 8, h[ROOM])
    while h[FILLED] > 0 and times[h[NEWEST]] > time:
        h[NEWEST] = (h[NEWEST] - 1) % h[ROOM]
        h[FILLED] -= 1
    if h[FILLED] == 0 or times[h[NEWEST]] != time:
        h[NEWEST] = (h[NEWEST] + 1) % h[ROOM]
        h[FILLED] = min(h[FILLED] + 1, h[ROOM])
    times[h[NEWEST]] = time
    fresh = words_at(base + h[FRESH], h[WORDS])
    kept = words_at(sample(base, history, h, 0), h[WORDS])
    for j in range(kept.size):
        kept[j] = fresh[j]


def sample(base: int, history: int, h: Any, age: int) -> int:
    """The address of a sample; age: how many are newer."""
    at = (h[NEWEST] - age) % h[ROOM]
    place: int = base + history + (HISTORY_WORDS + h[ROOM] + at * h[WORDS]) * 8
    return place


def aside(base: int, history: int) -> int:
    """The address of a value that nobody reads for long."""
    h = words_at(base + history, HISTORY_WORDS)
    place: int = base + history + (HISTORY_WORDS + h[ROOM] + h[ROOM] * h[WORDS]) * 8
    return place


def forget(base: int, history: int) -> None:
    """Begin anew, as what a wire brings has jumped."""
    words_at(base + history, HISTORY_WORDS)[FILLED] = 0


def trace(base: int, history: int, time: float, to: int) -> None:
    """The value at a time (s), to an address; before the first sample, what is there stays."""
    h = words_at(base + history, HISTORY_WORDS)
    times = reals_at(base + history + HISTORY_WORDS * 8, h[ROOM])
    wanted = time - reals_at(base + history, HISTORY_WORDS)[DELAY]
    age = 0
    while age < h[FILLED] and times[(h[NEWEST] - age) % h[ROOM]] > wanted + nearness(h, times, age):
        age += 1
    if age == h[FILLED]:
        return
    order = min(h[BEYOND] if age == 0 else h[BETWEEN], h[FILLED] - max(age, 1))
    if order < 1 or abs(times[(h[NEWEST] - age) % h[ROOM]] - wanted) <= nearness(h, times, age):
        value, held = words_at(to, h[WORDS]), words_at(sample(base, history, h, age), h[WORDS])
        for j in range(value.size):
            value[j] = held[j]
    else:
        join(base, history, h, times, wanted, max(age - 1, 0), order, to)


def nearness(h: Any, times: Any, age: int) -> float:
    """How near (s) to a sample a time is as good as that of the sample."""
    if h[FILLED] < 2:
        return NEAR
    older = age if age + 1 == h[FILLED] else age + 1
    distance: float = times[(h[NEWEST] - older + 1) % h[ROOM]] - times[(h[NEWEST] - older) % h[ROOM]]
    return NEAR * distance


def join(base: int, history: int, h: Any, times: Any, wanted: float, age: int, order: int, to: int) -> None:
    """The polynomial of an order through samples from an age on, at a time (s), to an address: Lagrange's form."""
    value = reals_at(to, h[WORDS])
    for j in range(value.size):
        value[j] = 0.0
    for i in range(order + 1):
        own = times[(h[NEWEST] - age - i) % h[ROOM]]
        weight = 1.0
        for m in range(order + 1):
            if m != i:
                other = times[(h[NEWEST] - age - m) % h[ROOM]]
                weight *= (wanted - other) / (own - other)
        kept = reals_at(sample(base, history, h, age + i), h[WORDS])
        for j in range(value.size):
            value[j] += weight * kept[j]


def misfit(base: int, history: int, time: float) -> float:
    """By how much of what a wire brings at a time (s) differs from what it was extrapolated to be.

    Relative to the largest magnitude so far; infinite where something is no number.
    """
    h = words_at(base + history, HISTORY_WORDS)
    there, to = reals_at(base + h[FRESH], h[WORDS]), aside(base, history)
    trace(base, history, time, to)
    wanted = reals_at(to, h[WORDS])
    error, largest = 0.0, reals_at(base + history, HISTORY_WORDS)[LARGEST]
    for j in range(there.size):
        if not abs(there[j] - wanted[j]) <= math.inf:
            return math.inf
        error, largest = max(error, abs(there[j] - wanted[j])), max(largest, abs(there[j]))
    return error / largest if error > 0.0 else 0.0


def order_of(base: int, history: int) -> int:
    """The order to which a wire is extrapolated now."""
    h = words_at(base + history, HISTORY_WORDS)
    order: int = min(h[BEYOND], h[FILLED] - 1)
    return order


def measure(base: int, history: int) -> None:
    """Note the largest magnitude so far."""
    h = words_at(base + history, HISTORY_WORDS)
    there, numbers = reals_at(base + h[FRESH], h[WORDS]), reals_at(base + history, HISTORY_WORDS)
    for j in range(there.size):
        numbers[LARGEST] = max(numbers[LARGEST], abs(there[j]))
