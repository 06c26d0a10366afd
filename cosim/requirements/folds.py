"""What a term makes of the elements of each sample: the largest, the smallest, their sum, their length.

One source, two engines, as in `extrema`. Of many elements numpy does it, which is slow along short axes only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.machine.memory import reals_at, words_at
from cosim.requirements.two_engines import Kernel

Array = np.ndarray[Any, Any]
# Words of a frame, behind those in which a kernel tells of its faults: how many samples, parts of each, and elements
# of those; where they begin; the bytes from one sample, and from one part, to the next; where the results go; what is
# made of them, one of KINDS; whether of their sizes.
FRAME_WORDS = 18
ROWS, PARTS, SIZE, VALUES, ROW_BYTES, PART_BYTES, RESULTS, KIND, SIZES = range(8, 17)
KINDS = LARGEST, SMALLEST, TOTAL, LENGTH = range(4)
FEW = 32
"""Elements up to which one after the other is faster than along an axis."""
SMALL = 1e-140
"""A length below it has lost digits in its squares, or beyond its inverse is close to no number."""


def fold(time: float, base: int, frame: int) -> int:  # noqa: ARG001
    """One number of each part of each sample. Returns 0."""
    f = words_at(frame, FRAME_WORDS)
    parts, size, kind, sizes = f[PARTS], f[SIZE], f[KIND], f[SIZES] != 0
    for row in range(f[ROWS]):
        results = reals_at(f[RESULTS] + 8 * row * parts, parts)
        for part in range(parts):
            values = reals_at(f[VALUES] + row * f[ROW_BYTES] + part * f[PART_BYTES], size)
            if kind == TOTAL:
                results[part] = total(values)
            elif kind == LENGTH:
                results[part] = math.sqrt(total_of_squares(values))
            else:
                results[part] = extreme(values, sizes, 1.0 if kind == LARGEST else -1.0)
    return 0


def extreme(values: Any, sizes: bool, sign: float) -> float:
    """The largest element, or size of one, with sign -1 the smallest; no number if one is none."""
    found, whole = -math.inf, True
    for k in range(values.size):
        value = sign * (abs(values[k]) if sizes else values[k])
        found = max(found, value)
        whole &= value == value  # noqa: PLR0124  # which no comparison with others tells
    return sign * float(found) if whole else math.nan


def total(values: Any) -> float:
    """The sum, one after the other."""
    found = values[0]
    for k in range(1, values.size):
        found += values[k]
    return float(found)


def total_of_squares(values: Any) -> float:
    """The same of the squares."""
    found = values[0] * values[0]
    for k in range(1, values.size):
        found += values[k] * values[k]
    return float(found)


def folded(kernel: Kernel, kind: int, samples: Array, left: int, sizes: bool = False) -> Array:
    """Samples (k, *parts, *shape) as one number of each part (k, *parts). left: how many axes there are of parts."""
    parts = samples.shape[1 : 1 + left]
    flat = samples.reshape(len(samples), math.prod(parts), math.prod(samples.shape[1 + left :]))
    if flat.shape[-1] > FEW:
        return _by_numpy(kind, np.abs(flat) if sizes else flat).reshape(len(samples), *parts)
    if flat.strides[-1] != flat.itemsize:
        flat = np.ascontiguousarray(flat)
    results = np.empty(flat.shape[:2])
    frame = np.zeros(FRAME_WORDS, np.int64)
    frame[ROWS : SIZES + 1] = (
        *flat.shape,
        flat.ctypes.data,
        *flat.strides[:2],
        results.ctypes.data,
        kind,
        sizes,
    )
    kernel(0.0, 0, frame.ctypes.data)
    return (_mended(results, flat) if kind == LENGTH else results).reshape(len(samples), *parts)


def _by_numpy(kind: int, flat: Array) -> Array:
    """The same of many elements (k, parts, n)."""
    if kind == LENGTH:
        return _mended(np.sqrt(np.add.reduce(np.square(flat), axis=-1)), flat)
    found: Array = {LARGEST: np.maximum, SMALLEST: np.minimum, TOTAL: np.add}[kind].reduce(flat, axis=-1)
    return found


def _mended(lengths: Array, flat: Array) -> Array:
    """Lengths (k, parts) of numbers of any size: where squares would leave their range, those of scaled numbers."""
    if lengths.size and not (lengths.min() > SMALL and lengths.max() < 1.0 / SMALL):
        odd = ~((lengths > SMALL) & (lengths < 1.0 / SMALL))
        few = flat[odd]
        largest_size = np.max(np.abs(few), axis=-1)
        scale = np.where((largest_size > 0.0) & np.isfinite(largest_size), largest_size, 1.0)
        lengths[odd] = np.sqrt(np.sum(np.square(few / scale[:, None]), axis=-1)) * scale
    return lengths
