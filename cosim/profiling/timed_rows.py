"""A program whose calls and copies are timed as the loop does them: the same rows, the same bits, other addresses.

Around each call the clock is read, by a few lines of machine code that are made for it; a copy becomes such a call, and
around each integration stand two more. What reading the clock takes itself is measured along the run in the same way,
by calls of nothing and by integrations of nothing but few or many of those, and taken off: by their medians, as the
system's pauses hit few of them.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.compiling import emission
from cosim.engine.program import Program
from cosim.errors import UsageError
from cosim.machine import memory, object_code
from cosim.master import tables

SLOT_WORDS = 5
#: Of what is timed: nanoseconds, how often, calls inside it; where it began, and what calls had taken then.
SPENT, COUNT, INSIDE, BEGAN, BEFORE = range(SLOT_WORDS)
#: So many of the last calls of nothing are kept each by itself, a power of two.
KEPT = 4096
FEW, MANY = 1, 9


@dataclass(frozen=True)
class Timed:
    """What a row took along a run: seconds in all, without those of calls inside it, and how often it was done."""

    seconds: float
    count: int


class TimedRows:
    """The rows, phases and functions of a program for one run, and what they took. Raises: UsageError without a clock.

    Slots: one for each row of the program, for each bank's integration, for all calls together, for a call of nothing,
    and for integrations around few and many of those.
    """

    def __init__(self, program: Program) -> None:
        if not hasattr(time, "CLOCK_MONOTONIC"):
            raise UsageError("this system has no clock that compiled code can read", fix="run it under Linux or macOS")
        self._program = program
        rows, banks = len(program.rows), len(program.banks)
        self._all, self._nothing, self._few, self._many = (rows + banks + k for k in range(4))
        self._slots = memory.shared(8 * SLOT_WORDS * (rows + banks + 4)).view(np.int64).reshape(-1, SLOT_WORDS)
        self._kept = memory.shared(3 * 8 * KEPT).view(np.int64).reshape(3, KEPT)  # of nothing, around few, and many
        self._code: object_code.Library

    def walked(self, addresses: Sequence[int]) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """The rows and phases in place of the program's, and the functions that they call; addresses: of its calls."""
        rows, phases, texts = self._program.rows.copy(), self._program.phase_words(), list[str]()

        def call(text: str, slot: int, what: str = _NOTHING, more: str = "") -> list[int]:
            texts.append(text.format(n=len(texts), slot=self._slot(slot), what=what, more=more))
            return [tables.CALL, len(texts) - 1]

        for at, (kind, a, b, c, *_) in enumerate(self._program.rows.tolist()):
            if kind == tables.CALL:
                rows[at, : tables.B] = call(_TIMED, at, _CALL.format(addresses[a]))
            elif kind == tables.COPY:
                rows[at, : tables.B] = call(_TIMED, at, _COPY.format(a, b, 8 * c))
        update, advance = rows[slice(*phases[tables.UPDATE])].tolist(), list[list[int]]()
        keep = [_KEEP.format(kept=kept.ctypes.data, most=KEPT - 1) for kept in self._kept]
        for slot, calls, kept in ((self._few, FEW, keep[1]), (self._many, MANY, keep[2])):
            nothing = [call(_TIMED, self._nothing, more=keep[0]) for _ in range(calls)]
            update += [call(_BEGIN, slot), *nothing, call(_END, slot, more=kept)]
        for row in rows[slice(*phases[tables.ADVANCE])].tolist():
            slot = len(rows) + row[tables.A]
            integrates = row[tables.KIND] == tables.INTEGRATE
            advance += [call(_BEGIN, slot), row, call(_END, slot)] if integrates else [row]
        for phase, moved in ((tables.UPDATE, update), (tables.ADVANCE, advance)):
            phases[phase] = len(rows), len(rows) + len(moved)
            padded = [[*row, *[0] * (tables.ROW_WORDS - len(row))] for row in moved]
            rows = np.concatenate([rows, np.array(padded, np.int64).reshape(-1, tables.ROW_WORDS)])
        return rows, phases, self._made(texts)

    def _made(self, texts: Sequence[str]) -> list[int]:
        """The addresses of functions, given their texts."""
        clock = ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value
        head = _HEAD.format(clock=clock, kind=time.CLOCK_MONOTONIC, all=self._slot(self._all))
        names = [f"timed_{n}" for n in range(len(texts))]
        self._code = object_code.Library(emission.emit(head + "".join(texts), *object_code.host(), names, "clocks"))
        return [self._code.address(name) for name in names]

    def begin(self) -> None:
        """What was done so far does not count."""
        self._slots[:] = 0

    def took(self, row: int) -> Timed:
        """What a call or a copy took, by its row in the program."""
        inside, _ = self._overhead()
        spent, count = self._slots[row, :INSIDE].tolist()
        return Timed((spent - inside * count) / 1e9, count)

    def integration(self, bank: int) -> Timed:
        """What the integrator of a bank took, without the derivatives that it asked for."""
        inside, outside = self._overhead()
        spent, count, calls = self._slots[len(self._program.rows) + bank, :BEGAN].tolist()
        return Timed((spent - inside * count - outside * calls) / 1e9, count)

    def _overhead(self) -> tuple[float, float]:
        """How long a call of nothing seems (ns), and how much longer it takes than it seems."""
        counts = self._slots[[self._nothing, self._few, self._many], COUNT]
        if not counts.all():
            return 0.0, 0.0
        inside, few, many = (float(np.median(kept[:count])) for kept, count in zip(self._kept, counts, strict=True))
        return inside, (many - few) / (MANY - FEW)

    def _slot(self, number: int) -> int:
        return int(self._slots[number].ctypes.data)


_HEAD = """
define private i64 @now() alwaysinline {{
  %at = alloca [2 x i64]
  %ok = call i32 inttoptr (i64 {clock} to ptr)(i32 {kind}, ptr %at)
  %seconds = load i64, ptr %at
  %second = getelementptr i64, ptr %at, i64 1
  %rest = load i64, ptr %second
  %scaled = mul i64 %seconds, 1000000000
  %sum = add i64 %scaled, %rest
  ret i64 %sum
}}
define private void @add(ptr %slot, i64 %word, i64 %more) alwaysinline {{
  %place = getelementptr i64, ptr %slot, i64 %word
  %before = load i64, ptr %place
  %sum = add i64 %before, %more
  store i64 %sum, ptr %place
  ret void
}}
define private i64 @get(ptr %slot, i64 %word) alwaysinline {{
  %place = getelementptr i64, ptr %slot, i64 %word
  %value = load i64, ptr %place
  ret i64 %value
}}
define private ptr @every() alwaysinline {{
  ret ptr inttoptr (i64 {all} to ptr)
}}
declare void @llvm.memmove.p0.p0.i64(ptr, ptr, i64, i1)
"""
_TIMED = """
define i32 @timed_{n}(double %time, ptr %base, ptr %frame) {{
  %slot = inttoptr i64 {slot} to ptr
  %all = call ptr @every()
  %begin = call i64 @now()
  {what}
  %end = call i64 @now()
  %spent = sub i64 %end, %begin
  call void @add(ptr %slot, i64 0, i64 %spent)
  call void @add(ptr %slot, i64 1, i64 1)
  call void @add(ptr %all, i64 0, i64 %spent)
  call void @add(ptr %all, i64 1, i64 1)
  {more}
  ret i32 %status
}}
"""
_CALL = "%status = call i32 inttoptr (i64 {} to ptr)(double %time, ptr %base, ptr %frame)"
_COPY = """%to = getelementptr i8, ptr %base, i64 {}
  %source = getelementptr i8, ptr %base, i64 {}
  call void @llvm.memmove.p0.p0.i64(ptr align 8 %to, ptr align 8 %source, i64 {}, i1 false)
  %status = add i32 0, 0"""
_KEEP = """%number = call i64 @get(ptr %slot, i64 1)
  %masked = and i64 %number, {most}
  %place = getelementptr i64, ptr inttoptr (i64 {kept} to ptr), i64 %masked
  store i64 %spent, ptr %place"""
_NOTHING = "%status = add i32 0, 0"
_BEGIN = """
define i32 @timed_{n}(double %time, ptr %base, ptr %frame) {{
  %slot = inttoptr i64 {slot} to ptr
  %all = call ptr @every()
  %spent = call i64 @get(ptr %all, i64 0)
  %calls = call i64 @get(ptr %all, i64 1)
  %earlier = sub i64 0, %calls
  call void @add(ptr %slot, i64 2, i64 %earlier)
  %before = getelementptr i64, ptr %slot, i64 4
  store i64 %spent, ptr %before
  %began = getelementptr i64, ptr %slot, i64 3
  %now = call i64 @now()
  store i64 %now, ptr %began
  ret i32 0
}}
"""
_END = """
define i32 @timed_{n}(double %time, ptr %base, ptr %frame) {{
  %now = call i64 @now()
  %slot = inttoptr i64 {slot} to ptr
  %all = call ptr @every()
  %began = call i64 @get(ptr %slot, i64 3)
  %before = call i64 @get(ptr %slot, i64 4)
  %taken = call i64 @get(ptr %all, i64 0)
  %calls = call i64 @get(ptr %all, i64 1)
  %whole = sub i64 %now, %began
  %within = sub i64 %taken, %before
  %spent = sub i64 %whole, %within
  call void @add(ptr %slot, i64 0, i64 %spent)
  call void @add(ptr %slot, i64 1, i64 1)
  call void @add(ptr %slot, i64 2, i64 %calls)
  {more}
  ret i32 0
}}
"""
