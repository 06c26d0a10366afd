"""What a wire brought so far: for an input that is read late, or between and beyond communication points.

A history is a ring of the newest samples. Its value at a time is that of a polynomial: between two samples of that
through the later one and so many before it, beyond the newest through that and so many before it; of order 0 it is the
newest sample that is not later.

What is read late may jump: then a sample begins a new piece, up to which the one before is held; of order 0, every
sample does. At a communication point or an event it is looked up from the right, which may be the begin of a piece. In
a step that is not accepted yet it is looked up from the left. Where steps end as pieces do, that is within the piece
that was found last, to the very end of the step, at which the next begins. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.machine.memory import reals_at, words_at

# In words: the input's memory, that of what comes in (both offsets), how many words that is, the room for samples, the
# orders beyond and between samples, the delay (s, a float64), how many samples there are, the place of the newest, the
# largest magnitude so far (a float64), whether steps end where pieces do, whether the next sample begins one, the time
# of the sample that was found last from the right (s, a float64); then times (s), whether samples begin a piece,
# samples, and a value that nobody reads for long.
HISTORY_WORDS = 13
TO, FRESH, WORDS, ROOM, BEYOND, BETWEEN, DELAY, FILLED, NEWEST, LARGEST, ENDED, BEGINS, FOUND = range(HISTORY_WORDS)
NEAR = 1e-9  # of the distance of two samples: as near as that, a time is that of a sample
ROUNDING = 2.0**-50  # of a time: the same


def words(room: int, width: int) -> int:
    """How many words a history takes that has room for so many samples of so many words."""
    return HISTORY_WORDS + room * (2 + width) + width


def head(
    to: int, fresh: int, width: int, room: int, orders: tuple[int, int], delay: float, pieces: tuple[bool, bool]
) -> np.ndarray:
    """The first words of a history without samples.

    orders: beyond and between samples; delay: in s; pieces: whether steps end where pieces do, and whether the first
    sample begins one, rather than that it goes on from what is there.
    """
    made = np.array([to, fresh, width, room, *orders, 0, 0, room - 1, 0, *pieces, 0], np.int64)
    numbers = made.view(np.float64)
    numbers[DELAY], numbers[FOUND] = delay, -math.inf
    return made


def push(base: int, history: int, time: float) -> None:
    """Keep what comes in as the sample of a time (s); one of the same time is replaced, and later ones are dropped.

    Aside is kept what there is before the first.
    """
    h = words_at(base + history, HISTORY_WORDS)
    times, begins = times_of(base, history, h), begins_of(base, history, h)
    while h[FILLED] > 0 and times[h[NEWEST]] > time:
        h[NEWEST] = (h[NEWEST] - 1) % h[ROOM]
        h[FILLED] -= 1
    if h[FILLED] == 0:
        take(h[WORDS], aside(base, history), base + h[TO])
    if h[FILLED] == 0 or times[h[NEWEST]] != time:
        h[NEWEST] = (h[NEWEST] + 1) % h[ROOM]
        h[FILLED] = min(h[FILLED] + 1, h[ROOM])
        begins[h[NEWEST]] = 0
    times[h[NEWEST]] = time
    begins[h[NEWEST]] = max(begins[h[NEWEST]], h[BEGINS])
    h[BEGINS] = 0
    take(h[WORDS], sample(base, history, h, 0), base + h[FRESH])


def take(n: int, to: int, source: int) -> None:
    """Copy n words from an address to another."""
    value, there = words_at(to, n), words_at(source, n)
    for j in range(n):
        value[j] = there[j]


def times_of(base: int, history: int, h: Any) -> Any:
    """The times of samples (s), by their place in the ring."""
    return reals_at(base + history + HISTORY_WORDS * 8, h[ROOM])


def begins_of(base: int, history: int, h: Any) -> Any:
    """Whether samples begin a piece, by their place in the ring."""
    return words_at(base + history + (HISTORY_WORDS + h[ROOM]) * 8, h[ROOM])


def sample(base: int, history: int, h: Any, age: int) -> int:
    """The address of a sample; age: how many are newer."""
    at = (h[NEWEST] - age) % h[ROOM]
    place: int = base + history + (HISTORY_WORDS + 2 * h[ROOM] + at * h[WORDS]) * 8
    return place


def aside(base: int, history: int) -> int:
    """The address of a value that nobody reads for long."""
    h = words_at(base + history, HISTORY_WORDS)
    place: int = base + history + (HISTORY_WORDS + 2 * h[ROOM] + h[ROOM] * h[WORDS]) * 8
    return place


def forget(base: int, history: int) -> None:
    """Begin anew, as what a wire brings jumps. What is read late is still to come: there a new piece begins."""
    h = words_at(base + history, HISTORY_WORDS)
    if reals_at(base + history, HISTORY_WORDS)[DELAY] > 0.0:
        h[BEGINS] = 1
    else:
        h[FILLED] = 0


def trace(base: int, history: int, time: float, to: int, left: int) -> None:
    """The value at a time (s), to an address; left: not 0 where it is looked up from the left.

    Before the first sample of what is read late it is that, or what there was, where that begins a piece.
    """
    h, numbers = words_at(base + history, HISTORY_WORDS), reals_at(base + history, HISTORY_WORDS)
    if h[FILLED] == 0 or (left != 0 and h[BETWEEN] == 0 and h[ENDED] != 0):
        return
    times, wanted = times_of(base, history, h), time - numbers[DELAY]
    if left != 0:
        age = from_left(base, history, h, times, wanted)
    else:
        age = age_at(h, times, wanted, 1.0)
        numbers[FOUND] = times[(h[NEWEST] - age) % h[ROOM]] if age < h[FILLED] else -math.inf
    ends = age > 0 and begins_of(base, history, h)[(h[NEWEST] - age + 1) % h[ROOM]] != 0  # the next begins a piece
    order = 0 if ends else min(h[BEYOND] if age == 0 else h[BETWEEN], h[FILLED] - max(age, 1))
    if age == h[FILLED]:
        if numbers[DELAY] > 0.0:
            take(h[WORDS], to, aside(base, history) if ends else sample(base, history, h, age - 1))
    elif order < 1 or abs(times[(h[NEWEST] - age) % h[ROOM]] - wanted) <= nearness(h, times, age):
        take(h[WORDS], to, sample(base, history, h, age))
    else:
        join(base, history, h, times, wanted, max(age - 1, 0), order, to)


def age_at(h: Any, times: Any, wanted: float, side: float) -> int:
    """The age of the newest sample that is not later than a time (s), of side -1 that is earlier; or of all samples."""
    age: int = 0
    beyond = h[FILLED]
    while age < beyond:
        middle = (age + beyond) // 2
        if times[(h[NEWEST] - middle) % h[ROOM]] > wanted + side * nearness(h, times, middle):
            age = middle + 1
        else:
            beyond = middle
    return age


def from_left(base: int, history: int, h: Any, times: Any, wanted: float) -> int:
    """The age of the sample to look from at a time (s) in a step: none before that which was found at its begin.

    Where steps end as pieces do, no piece begins after that.
    """
    begins, found = begins_of(base, history, h), reals_at(base + history, HISTORY_WORDS)[FOUND]
    age = age_at(h, times, wanted, 1.0 if h[ENDED] != 0 else -1.0)
    later = age
    while h[ENDED] != 0 and later < h[FILLED] and times[(h[NEWEST] - later) % h[ROOM]] > found:
        later += 1
        if begins[(h[NEWEST] - later + 1) % h[ROOM]] != 0:
            age = later
    while age > 0 and times[(h[NEWEST] - age + 1) % h[ROOM]] <= found:
        age -= 1
    return age


def nearness(h: Any, times: Any, age: int) -> float:
    """How near (s) to a sample a time is as good as that of the sample."""
    if h[FILLED] < 2:
        return NEAR
    older = age if age + 1 == h[FILLED] else age + 1
    newer = times[(h[NEWEST] - older + 1) % h[ROOM]]
    near: float = NEAR * (newer - times[(h[NEWEST] - older) % h[ROOM]]) + ROUNDING * abs(newer)
    return near


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

    Relative to the largest magnitude so far; infinite where something is no number. Of what is read late as of `bend`.
    Where the sample of that time is kept already, as a block that takes its turn later has read it, from those before.
    """
    h = words_at(base + history, HISTORY_WORDS)
    there, to = reals_at(base + h[FRESH], h[WORDS]), aside(base, history)
    if reals_at(base + history, HISTORY_WORDS)[DELAY] > 0.0:
        return bend(base, history, h, time)
    newest, kept = h[NEWEST], h[FILLED]
    if kept > 1 and times_of(base, history, h)[newest] == time:
        h[NEWEST], h[FILLED] = (newest - 1) % h[ROOM], kept - 1
    trace(base, history, time, to, 1)
    h[NEWEST], h[FILLED] = newest, kept
    wanted = reals_at(to, h[WORDS])
    error, largest = 0.0, reals_at(base + history, HISTORY_WORDS)[LARGEST]
    for j in range(there.size):
        if not abs(there[j] - wanted[j]) <= math.inf:
            return math.inf
        error, largest = max(error, abs(there[j] - wanted[j])), max(largest, abs(there[j]))
    return error / largest if error > 0.0 else 0.0


def bend(base: int, history: int, h: Any, time: float) -> float:
    """By how much a curve through what comes in at a time (s) and two samples misses the line from the newest.

    With one sample alone, by how much the line rises; the first line after a jump is not judged.
    """
    times, largest, error = times_of(base, history, h), reals_at(base + history, HISTORY_WORDS)[LARGEST], 0.0
    there, one = reals_at(base + h[FRESH], h[WORDS]), reals_at(sample(base, history, h, 0), h[WORDS])
    before = reals_at(sample(base, history, h, min(1, h[FILLED] - 1)), h[WORDS])
    size = time - times[h[NEWEST]]
    earlier = times[h[NEWEST]] - times[(h[NEWEST] - 1) % h[ROOM]]
    for j in range(there.size if h[FILLED] == 1 or begins_of(base, history, h)[h[NEWEST]] == 0 else 0):
        missed = there[j] - one[j]
        if h[FILLED] > 1:
            missed = 0.25 * (missed - (one[j] - before[j]) * size / earlier) * size / (size + earlier)
        if not abs(missed) <= math.inf:
            return math.inf
        error, largest = max(error, abs(missed)), max(largest, abs(there[j]))
    return error / largest if error > 0.0 else 0.0


def order_of(base: int, history: int) -> int:
    """The order to which a wire is extrapolated now; or between two samples, of what is read late."""
    h, late = words_at(base + history, HISTORY_WORDS), reals_at(base + history, HISTORY_WORDS)[DELAY] > 0.0
    order: int = min(h[BETWEEN] if late else h[BEYOND], h[FILLED] - 1)
    return order


def measure(base: int, history: int) -> None:
    """Note the largest magnitude so far."""
    h = words_at(base + history, HISTORY_WORDS)
    there, numbers = reals_at(base + h[FRESH], h[WORDS]), reals_at(base + history, HISTORY_WORDS)
    for j in range(there.size):
        numbers[LARGEST] = max(numbers[LARGEST], abs(there[j]))
