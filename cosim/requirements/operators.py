"""The temporal operators on whole courses, with the native code of `extrema`, or that source itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.requirements import extrema
from cosim.requirements.terms import Array
from cosim.requirements.two_engines import Kernel, kernel

EVEN = 1e-6
"""The part of a step by which steps may differ and are the same."""


class Operators:
    """Operators on courses (*shape, k) over the first k of all times in s. native: whether by compiled code."""

    def __init__(self, native: bool, times: Array) -> None:
        self._native = native
        self._times = np.ascontiguousarray(times, np.float64)
        self._address = self._times.ctypes.data
        steps = self._times[1:] - self._times[:-1]
        self._even = len(steps) > 0 and bool(np.max(steps) - np.min(steps) <= EVEN * steps[0])
        self._windows: dict[tuple[int, float, float, bool], tuple[int, int]] = {}  # the same of all that is compared

    def lowest(self, course: Array, start: float, stop: float) -> Array:
        """The lowest within [start, stop] (s) from each sample on; infinite where there is no sample."""
        times = self._times[: course.shape[-1]]
        if start == 0.0 and stop >= times[-1] - times[0]:
            return np.minimum.accumulate(course[..., ::-1], axis=-1)[..., ::-1]
        return self._call(extrema.lowest, course, course, start, stop)

    def before(self, course: Array, stop: float) -> Array:
        """The lowest within [0, stop) (s) from each sample on; infinite where there is no sample."""
        return self._call(extrema.lowest, course, course, 0.0, stop, without_end=True)

    def highest(self, course: Array, start: float, stop: float) -> Array:
        """As `lowest`, the highest."""
        return -self.lowest(-course, start, stop)

    def until(self, left: Array, right: Array) -> Array:
        """From each sample on: the highest, over later samples, of `right` there and the lowest `left` before it."""
        return self._call(extrema.until, left, right, 0.0, 0.0)

    def _call(
        self, function: Kernel, left: Array, right: Array, start: float, stop: float, without_end: bool = False
    ) -> Array:
        same = right is left
        left = np.ascontiguousarray(left, np.float64)
        right = left if same else np.ascontiguousarray(right, np.float64)
        size, behind = left.shape[-1], extrema.FRAME_WORDS + left.size
        words = np.empty(behind + size + 1)  # the frame, what comes out, and room to work in
        at, read = words.ctypes.data, left.ctypes.data  # each of which takes a while
        frame = words[: extrema.FRAME_WORDS]
        frame[:] = 0.0
        frame[extrema.START : extrema.STOP + 1] = start, stop
        frame.view(np.int64)[extrema.COLUMNS : extrema.START] = (
            left.size // size,
            size,
            self._address,
            read,
            read if right is left else right.ctypes.data,
            at + 8 * extrema.FRAME_WORDS,
            at + 8 * behind,
            without_end,
            *self._window(size, start, stop, without_end),
        )
        kernel(function, self._native)(0.0, 0, at)
        return words[extrema.FRAME_WORDS : behind].reshape(left.shape)

    def _window(self, *asked: Any) -> tuple[int, int]:
        """As of `_window_of`, which is asked once."""
        if asked not in self._windows:
            self._windows[asked] = self._window_of(*asked)
        return self._windows[asked]

    def _window_of(self, size: int, start: float, stop: float, without_end: bool) -> tuple[int, int]:
        """A window's first sample from now on, and how many it has, if that is the same from all samples on; else 0."""
        if not self._even or stop <= 0.0 or math.isinf(stop):
            return 0, 0
        first, end = self._bounds(0, size, start, stop, without_end)
        last = size - end  # the last sample from which on a window is whole
        if last < 0 or (first, end) != self._bounds(last, size, start, stop, without_end):
            return 0, 0  # they part, if they do, by a share of the time, which grows: so they part at the end
        return first, max(end - first, 0)

    def _bounds(self, at: int, size: int, start: float, stop: float, without_end: bool) -> tuple[int, int]:
        """The first sample of a window from a sample on, and the one behind its last, counted from that sample."""
        times, now = self._times[:size], self._times[at]
        near = -extrema.NEAR if without_end else extrema.NEAR
        first = int(times.searchsorted((now + start) * (1.0 - extrema.NEAR), "left"))
        return first - at, int(times.searchsorted((now + stop) * (1.0 + near), "right")) - at
