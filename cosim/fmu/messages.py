"""An FMU's log messages, kept natively: its logger writes into a ring in memory, so that no message enters Python.

FMI 2's logger is variadic, which neither ctypes nor numba can define: hence the few lines of LLVM.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from cosim.compiling import compiler
from cosim.machine import object_code

ENTRIES, ENTRY_BYTES, TEXT_BYTES = 16, 512, 504  # an entry is a status word and a text
FIRST_BYTES = 16  # how many messages there have been, and how many warnings; the first of these follows, then the ring
RING_BYTES = FIRST_BYTES + TEXT_BYTES + ENTRIES * ENTRY_BYTES
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")

# Both loggers claim an entry of the ring at %ring, which is the instance environment, and write status and text there.
# The first warning's text is kept. What an FMU says without an environment is lost, and no text is an empty one.
_IR = """
declare void @llvm.va_start(ptr)
declare void @llvm.va_end(ptr)
declare i32 @vsnprintf(ptr, i64, ptr, ptr)
declare ptr @strncpy(ptr, ptr, i64)
@nothing = internal constant [1 x i8] zeroinitializer

define internal ptr @claim(ptr %ring, i32 %status) {{
  %count = atomicrmw add ptr %ring, i64 1 seq_cst
  %index = urem i64 %count, {entries}
  %place = mul i64 %index, {entry}
  %entries = getelementptr i8, ptr %ring, i64 {entries_at}
  %slot = getelementptr i8, ptr %entries, i64 %place
  %word = zext i32 %status to i64
  store i64 %word, ptr %slot
  %text = getelementptr i8, ptr %slot, i64 8
  ret ptr %text
}}

define internal void @keep(ptr %ring, i32 %status, ptr %text) {{
  %warns = icmp eq i32 %status, 1
  br i1 %warns, label %count, label %done
count:
  %warnings = getelementptr i8, ptr %ring, i64 8
  %before = atomicrmw add ptr %warnings, i64 1 seq_cst
  %is_first = icmp eq i64 %before, 0
  br i1 %is_first, label %copy, label %done
copy:
  %first = getelementptr i8, ptr %ring, i64 {first_at}
  %copied = call ptr @strncpy(ptr %first, ptr %text, i64 {last})
  br label %done
done:
  ret void
}}

define internal ptr @safe(ptr %text) {{
  %missing = icmp eq ptr %text, null
  %safe = select i1 %missing, ptr @nothing, ptr %text
  ret ptr %safe
}}

define void @log2(ptr %ring, ptr %name, i32 %status, ptr %category, ptr %given_format, ...) {{
  %list = alloca [32 x i8], align 16
  %lost = icmp eq ptr %ring, null
  br i1 %lost, label %done, label %heard
heard:
  %format = call ptr @safe(ptr %given_format)
  %text = call ptr @claim(ptr %ring, i32 %status)
  call void @llvm.va_start(ptr %list)
  {load}
  %n = call i32 @vsnprintf(ptr %text, i64 {size}, ptr %format, ptr {arguments})
  call void @llvm.va_end(ptr %list)
  call void @keep(ptr %ring, i32 %status, ptr %text)
  br label %done
done:
  ret void
}}

define void @log3(ptr %ring, i32 %status, ptr %category, ptr %given_message) {{
  %lost = icmp eq ptr %ring, null
  br i1 %lost, label %done, label %heard
heard:
  %message = call ptr @safe(ptr %given_message)
  %text = call ptr @claim(ptr %ring, i32 %status)
  %copied = call ptr @strncpy(ptr %text, ptr %message, i64 {last})
  call void @keep(ptr %ring, i32 %status, ptr %text)
  br label %done
done:
  ret void
}}
"""


@cache
def _library() -> object_code.Library:
    triple, cpu, features = object_code.host()
    by_pointer = "windows" in triple or ("darwin" in triple and "arm64" in triple)  # va_list is a plain pointer there
    ir = _IR.format(
        entries=ENTRIES,
        entries_at=FIRST_BYTES + TEXT_BYTES,
        first_at=FIRST_BYTES,
        entry=ENTRY_BYTES,
        size=TEXT_BYTES,
        last=TEXT_BYTES - 1,
        load="%given = load ptr, ptr %list" if by_pointer else "",
        arguments="%given" if by_pointer else "%list",
    )
    return object_code.Library(compiler.emit(ir, triple, cpu, features, ("log2", "log3"), "logger"))


def logger(version: int) -> int:
    """The address of the logger call-back for an FMI version; its environment is the address of a ring."""
    return _library().address(f"log{version}")


class Messages:
    """The last messages of one instance, in zeroed bytes (RING_BYTES,)."""

    def __init__(self, ring: np.ndarray) -> None:
        self._ring = ring.view(np.int64)

    @property
    def warnings(self) -> int:
        """How many of all messages were warnings."""
        return int(self._ring[1])

    @property
    def first_warning(self) -> str:
        """The text of the first warning."""
        return _text(self.environment + FIRST_BYTES)

    @property
    def environment(self) -> int:
        """What the FMU hands back to its logger."""
        return self._ring.ctypes.data

    def last(self, most: int = 4) -> list[str]:
        """The newest messages that are worse than OK, or the newest at all, oldest first, each with its status."""
        count = int(self._ring[0])
        found = []
        for k in range(max(0, count - ENTRIES), count):
            at = self.environment + FIRST_BYTES + TEXT_BYTES + (k % ENTRIES) * ENTRY_BYTES
            status = ctypes.c_int64.from_address(at).value
            found.append((status, _text(at + 8)))
        telling = [pair for pair in found if pair[0] > 0] or found
        return [f"{STATUS[s] if 0 <= s < len(STATUS) else s}: {text}" for s, text in telling[-most:]]


def _text(address: int) -> str:
    """A message in the ring, on one line, without what a terminal would obey."""
    raw = ctypes.string_at(address, TEXT_BYTES).partition(b"\0")[0].decode("utf-8", "replace")
    return " ".join("".join(c if c.isprintable() else " " for c in raw).split())
