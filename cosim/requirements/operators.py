"""The temporal operators on whole courses, with the native code of `extrema`, or that source itself."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from threading import Lock

import numpy as np

from cosim.requirements import extrema
from cosim.requirements.terms import Array

Kernel = Callable[[float, int, int], int]
_PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_int64, ctypes.c_int64)


class Operators:
    """Operators on courses (*shape, k) over times (k,) in s. native: whether by compiled code."""

    def __init__(self, native: bool) -> None:
        self._kernel: Callable[[str], Kernel] = _native if native else _interpreted

    def lowest(self, times: Array, course: Array, start: float, stop: float) -> Array:
        """The lowest within [start, stop] (s) from each sample on; infinite where there is no sample."""
        if start == 0.0 and stop >= times[-1] - times[0]:
            return np.minimum.accumulate(course[..., ::-1], axis=-1)[..., ::-1]
        return self._call("lowest", times, course, course, start, stop)

    def before(self, times: Array, course: Array, stop: float) -> Array:
        """The lowest within [0, stop) (s) from each sample on; infinite where there is no sample."""
        return self._call("lowest", times, course, course, 0.0, stop, without_end=True)

    def highest(self, times: Array, course: Array, start: float, stop: float) -> Array:
        """As `lowest`, the highest."""
        return -self.lowest(times, -course, start, stop)

    def until(self, times: Array, left: Array, right: Array) -> Array:
        """From each sample on: the highest, over later samples, of `right` there and the lowest `left` before it."""
        return self._call("until", times, left, right, 0.0, 0.0)

    def _call(
        self, name: str, times: Array, left: Array, right: Array, start: float, stop: float, without_end: bool = False
    ) -> Array:
        times, left, right = (np.ascontiguousarray(a, np.float64) for a in (times, left, right))
        result, queue = np.empty_like(left), np.empty(times.size + 1, np.int64)
        frame = np.zeros(extrema.FRAME_WORDS, np.int64)
        frame[extrema.COLUMNS : extrema.START] = (
            left.size // times.size,
            times.size,
            times.ctypes.data,
            left.ctypes.data,
            right.ctypes.data,
            result.ctypes.data,
            queue.ctypes.data,
            without_end,
        )
        frame.view(np.float64)[extrema.START : extrema.STOP + 1] = start, stop
        self._kernel(name)(0.0, 0, frame.ctypes.data)
        return result


def _interpreted(name: str) -> Kernel:
    kernel: Kernel = getattr(extrema, name)
    return kernel


def _native(name: str) -> Kernel:
    with _loading:  # runs of a study share a process
        return _loaded()[name]


_loading = Lock()


@cache
def _loaded() -> dict[str, Kernel]:
    from cosim.compiling import kernels

    library = kernels.raw_module("requirements", (extrema.lowest, extrema.until)).load()
    return {name: _PROTOTYPE(library.address(name)) for name in ("lowest", "until")}
