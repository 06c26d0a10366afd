"""What temporal operators make of a margin's samples: the lowest within a moving window, and `until`.

One source, two engines, as in `cosim.master.loop`. Both ways to the lowest take a time that grows with the samples
alone. At even times: from the lowest of a block's rest and of the next one's beginning, by van Herk, A fast algorithm
for local minimum and maximum filters on rectangular and octagonal kernels, Pattern Recognition Letters 13 (1992). At
any times: by a monotone queue, by Lemire, Streaming maximum-minimum filter using no more than three comparisons per
element, Nordic Journal of Computing 13 (2006).
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at

# Words of a frame, behind those in which a kernel tells of its faults: how many columns, and samples in each; the
# addresses of times (s) and of columns, of what comes out, and of as much again to work in; whether the window is
# without its end; its first sample from now on, and how many it has, 0 where that changes; its bounds (s, float64).
FRAME_WORDS = 24
COLUMNS, SIZE, TIMES, LEFT, RIGHT, RESULT, WORK, OPEN, FIRST, COUNT, START, STOP = range(8, 20)
NEAR = 1e-9  # of a time: as near as that, a sample lies on a window's bound


def lowest(time: float, base: int, frame: int) -> int:  # noqa: ARG001
    """The lowest of LEFT within [START, STOP], or [START, STOP), from each sample on, infinite where none is."""
    f, numbers = words_at(frame, FRAME_WORDS), reals_at(frame, FRAME_WORDS)
    size, start, stop = f[SIZE], numbers[START], numbers[STOP]
    for column in range(f[COLUMNS]):
        values, result = reals_at(f[LEFT] + column * size * 8, size), reals_at(f[RESULT] + column * size * 8, size)
        if f[COUNT] > 0:
            block_by_block(values, f[FIRST], f[COUNT], reals_at(f[WORK], size), result)
        else:
            near = -NEAR if f[OPEN] != 0 else NEAR
            slide(reals_at(f[TIMES], size), values, start, stop, near, words_at(f[WORK], size + 1), result)
    return 0


def block_by_block(values: Any, first: int, count: int, rests: Any, result: Any) -> None:
    """Of one column, the lowest of `count` samples from `first` samples later on. rests: room for as many as all."""
    size = values.size
    left = (size - 1) % count + 1  # samples of a block, the last of which may be shorter
    for begin in range((size - 1) // count * count, -1, -count):
        low = math.inf
        for i in range(begin + left - 1, begin - 1, -1):
            low = min(low, values[i])
            rests[i] = low
        left = count
    low, left, shift = math.inf, count, first + count - 1
    for i in range(size):
        if left == 0:
            low, left = math.inf, count
        low = min(low, values[i])
        left -= 1
        if i >= shift:
            result[i - shift] = min(low, rests[i - count + 1])
    for i in range(max(size - shift, 0), size):  # whose windows the samples end
        result[i] = math.inf
    low = math.inf
    for i in range(size - 1, max(first, size - count + 1) - 1, -1):
        low = min(low, values[i])
        result[i - first] = low


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
