"""A frame: what one call of a kernel gets besides the base, in words of 64 bits. Whoever walks one asks here.

``[fault…, instances, sizes of run-time dimensions…, words of a foreign block's own…, (offset, stride) per argument…]``,
and, as arguments, what the function needs memory for and what does not lie on the stack:
offsets are bytes from the base, strides bytes between two instances (0: all instances share the value).
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from dataclasses import dataclass

from cosim.authoring.declaration import Declaration, Function
from cosim.authoring.lowering.block_functions import lowered
from cosim.authoring.lowering.work import Temporary


class FaultRecord(ctypes.Structure):
    """What a call that fails leaves in the first words of its frame.

    A text with two numbers for it, the instance, from 0, and the time (s).
    """

    _fields_ = (
        ("text", ctypes.c_char_p),
        ("first", ctypes.c_int64),
        ("second", ctypes.c_int64),
        ("instance", ctypes.c_int64),
        ("time", ctypes.c_double),
    )


#: The number of each of the record's words.
TEXT, FIRST_NUMBER, SECOND_NUMBER, INSTANCE, TIME = range(5)
INSTANCES = ctypes.sizeof(FaultRecord) // 8
SIZES = INSTANCES + 1  # of run-time dimensions, from here on


@dataclass(frozen=True)
class Frame:
    """Where the words of one function's frame are.

    dimensions: the word of each size; slots: of each argument's offset, which its stride follows; `time` has none;
    work: the same of memory that the function needs besides.
    """

    dimensions: Mapping[str, int]
    slots: Mapping[str, int]
    work: Mapping[str, int]
    size: int

    def words(self, instances: int, sizes: Mapping[str, int], places: Mapping[str, tuple[int, int]]) -> list[int]:
        """The words at first. sizes: of all dimensions; places: offset and stride of each argument."""
        words = [0] * self.size
        words[INSTANCES] = instances
        for name, word in self.dimensions.items():
            words[word] = sizes[name]
        for name, slot in (*self.slots.items(), *self.work.items()):
            words[slot : slot + 2] = places[name]
        return words


#: So many elements at most lie on the stack, where their number is part of the code.
ON_STACK = 256


def in_arena(declaration: Declaration, function: Function, constants: Mapping[str, int]) -> list[Temporary]:
    """What a function needs memory for that its frame has to tell: all but little of a size that the code knows."""
    return [t for t in lowered(declaration, function).temporaries if not _fits(t, constants)]


def _fits(temporary: Temporary, constants: Mapping[str, int]) -> bool:
    shape = temporary.kind.shape
    if not all(size.dimensions() <= {*constants} for size in shape):
        return False
    return math.prod(size.of(constants) for size in shape) <= ON_STACK


def frame_of(declaration: Declaration, function: Function, constants: Mapping[str, int]) -> Frame:
    """The frame of a function of a block, whose dimensions are partly constants of its code."""
    names = [name for name in declaration.dimension_names() if name not in {*constants}]
    dimensions = {name: SIZES + k for k, name in enumerate(names)}
    own = declaration.foreign.frame_words if declaration.foreign else 0
    first = SIZES + len(dimensions) + own
    arguments = [name for name in function.arguments if name != "time"]
    slots = {name: first + 2 * k for k, name in enumerate(arguments)}
    first += 2 * len(arguments)
    work = {t.name: first + 2 * k for k, t in enumerate(in_arena(declaration, function, constants))}
    return Frame(dimensions, slots, work, first + 2 * len(work))
