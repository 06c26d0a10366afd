"""What a wire brought so far: for an input that is read late, or between and beyond communication points.

A history is a ring of the newest samples. Its value at a time is that of the polynomial of its order through samples
from the first one at or after that time, or else from the newest, backwards: between samples it interpolates, beyond
them it extrapolates. Of order 0 it is the newest sample that is not later. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.machine.memory import reals_at, words_at

# In words: the input's memory, that of what comes in (both offsets), how many words that is, the room for samples, the
# order, the delay (s, a float64), how many samples there are, the place of the newest; then times (s), then samples.
HISTORY_WORDS = 8
TO, FRESH, WORDS, ROOM, ORDER, DELAY, FILLED, NEWEST = range(HISTORY_WORDS)
MOST_ORDER = 2
NEAR = 1e-9  # of the distance of two samples: as near as that, a time is that of a sample


def words(room: int, width: int) -> int:
    """How many words a history takes that has room for so many samples of so many words."""
    return HISTORY_WORDS + room * (1 + width)


def head(to: int, fresh: int, width: int, room: int, order: int, delay: float) -> np.ndarray:
    """The first words of a history without samples. delay: in s."""
    made = np.array([to, fresh, width, room, order, 0, 0, room - 1], np.int64)
    made.view(np.float64)[DELAY] = delay
    return made


def push(base: int, history: int, time: float) -> None:
    """Keep what comes in as the sample of a time (s); one of the same time is replaced."""
    h = words_at(base + history, HISTORY_WORDS)
    times = reals_at(base + history + HISTORY_WORDS * 8, h[ROOM])
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


def trace(base: int, history: int, time: float) -> None:
    """Give the input its value at a time (s); before the first sample, it stays what it is."""
    h = words_at(base + history, HISTORY_WORDS)
    times = reals_at(base + history + HISTORY_WORDS * 8, h[ROOM])
    wanted = time - reals_at(base + history, HISTORY_WORDS)[DELAY]
    age = 0
    while age < h[FILLED] and times[(h[NEWEST] - age) % h[ROOM]] > wanted + nearness(h, times, age):
        age += 1
    if age == h[FILLED]:
        return
    order = min(h[ORDER], h[FILLED] - max(age, 1))
    if order < 1 or abs(times[(h[NEWEST] - age) % h[ROOM]] - wanted) <= nearness(h, times, age):
        to, held = words_at(base + h[TO], h[WORDS]), words_at(sample(base, history, h, age), h[WORDS])
        for j in range(to.size):
            to[j] = held[j]
    else:
        join(base, history, h, times, wanted, max(age - 1, 0), order)


def nearness(h: Any, times: Any, age: int) -> float:
    """How near (s) to a sample a time is as good as that of the sample."""
    if h[FILLED] < 2:
        return NEAR
    older = age if age + 1 == h[FILLED] else age + 1
    distance: float = times[(h[NEWEST] - older + 1) % h[ROOM]] - times[(h[NEWEST] - older) % h[ROOM]]
    return NEAR * distance


def join(base: int, history: int, h: Any, times: Any, wanted: float, age: int, order: int) -> None:
    """The polynomial of an order through samples from an age on, at a time (s): Lagrange's form."""
    to = reals_at(base + h[TO], h[WORDS])
    for j in range(to.size):
        to[j] = 0.0
    for i in range(order + 1):
        own = times[(h[NEWEST] - age - i) % h[ROOM]]
        weight = 1.0
        for m in range(order + 1):
            if m != i:
                other = times[(h[NEWEST] - age - m) % h[ROOM]]
                weight *= (wanted - other) / (own - other)
        kept = reals_at(sample(base, history, h, age + i), h[WORDS])
        for j in range(to.size):
            to[j] += weight * kept[j]
