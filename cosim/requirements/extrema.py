"""What temporal operators make of a margin's samples: the lowest within a moving window, and `until`.

One source, two engines, as in `cosim.master.loop`.

The lowest is found by a monotone queue, in a time that grows with the samples alone: Lemire, Streaming maximum-minimum
filter using no more than three comparisons per element, Nordic Journal of Computing 13 (2006).
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at

# Words of a frame, behind those in which a kernel tells of its faults: how many columns, and samples in each; the
# addresses of times (s) and of columns, of what comes out, and of a queue; whether the window is without its end; its
# bounds (s, float64).
FRAME_WORDS = 24
COLUMNS, SIZE, TIMES, LEFT, RIGHT, RESULT, QUEUE, OPEN, START, STOP = range(8, 18)
NEAR = 1e-9  # of a time: as near as that, a sample lies on a window's bound


def lowest(time: float, base: int, frame: int) -> int:  # noqa: ARG001
    """The lowest of LEFT within [START, STOP], or [START, STOP), from each sample on, infinite where none is."""
    f, numbers = words_at(frame, FRAME_WORDS), reals_at(frame, FRAME_WORDS)
    size, start, stop = f[SIZE], numbers[START], numbers[STOP]
    times, queue = reals_at(f[TIMES], size), words_at(f[QUEUE], size + 1)
    for column in range(f[COLUMNS]):
        values, result = reals_at(f[LEFT] + column * size * 8, size), reals_at(f[RESULT] + column * size * 8, size)
        slide(times, values, start, stop, -NEAR if f[OPEN] != 0 else NEAR, queue, result)
    return 0


def slide(times: Any, values: Any, start: float, stop: float, near: float, queue: Any, result: Any) -> None:
    """As of `lowest`, of one column. The queue has the numbers of samples that may yet be the lowest, rising."""
    size, head, tail, new = times.size, 0, 0, 0
    for i in range(size):
        last, first = times[i] + stop, times[i] + start
        last += near * last
        first -= NEAR * first
        while new < size and times[new] <= last:
            while tail > head and values[queue[tail - 1]] > values[new]:
                tail -= 1
            queue[tail] = new
            tail += 1
            new += 1
        while head < tail and times[queue[head]] < first:
            head += 1
        result[i] = values[queue[head]] if head < tail else math.inf


def until(time: float, base: int, frame: int) -> int:  # noqa: ARG001
    """From each sample on: the highest, over later samples, of RIGHT there and the lowest LEFT before. Returns 0."""
    f = words_at(frame, FRAME_WORDS)
    size = f[SIZE]
    for column in range(f[COLUMNS]):
        left, right = reals_at(f[LEFT] + column * size * 8, size), reals_at(f[RIGHT] + column * size * 8, size)
        result, best = reals_at(f[RESULT] + column * size * 8, size), -math.inf
        for i in range(size - 1, -1, -1):
            best = max(right[i], min(left[i], best))
            result[i] = best
    return 0
