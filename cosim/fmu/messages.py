"""An FMU's log messages, kept natively: its logger writes into a ring in memory, so that no message enters Python.

It writes them to a file too, where there is one. FMI 2's logger is variadic, which neither ctypes nor numba can define:
hence the few lines of LLVM.
"""

from __future__ import annotations

import ctypes
import sys
from functools import cache

import numpy as np

from cosim.compiling import emission
from cosim.machine import object_code

ENTRIES, ENTRY_BYTES, TEXT_BYTES = 16, 512, 504  # an entry is a status word and a text
NAME_BYTES, LINE_BYTES = 64, 4096
#: Where in the ring, in bytes: how many messages there have been; how many warnings; one more than the descriptor of
#: the file, 0 for none; the instance's name; the first warning's text; the entries.
COUNT_AT, WARNINGS_AT, FILE_AT, NAME_AT = 0, 8, 16, 24
FIRST_AT = NAME_AT + NAME_BYTES
ENTRIES_AT = FIRST_AT + TEXT_BYTES
RING_BYTES = ENTRIES_AT + ENTRIES * ENTRY_BYTES
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
CAN_WRITE = sys.platform != "win32"  # whose C library calls these functions otherwise

# Both loggers keep a message in an entry of the ring at %ring, which is the instance environment, with its status. What
# an FMU says without an environment is lost, and no text is an empty one.
_IR = """
declare void @llvm.va_start(ptr)
declare void @llvm.va_end(ptr)
declare i32 @vsnprintf(ptr, i64, ptr, ptr)
declare ptr @strncpy(ptr, ptr, i64)
@nothing = internal constant [1 x i8] zeroinitializer

define internal void @keep(ptr %ring, i32 %status, ptr %category, ptr %text) {{
  %count = atomicrmw add ptr %ring, i64 1 seq_cst
  %index = urem i64 %count, {entries}
  %place = mul i64 %index, {entry}
  %entries = getelementptr i8, ptr %ring, i64 {entries_at}
  %slot = getelementptr i8, ptr %entries, i64 %place
  %word = zext i32 %status to i64
  store i64 %word, ptr %slot
  %there = getelementptr i8, ptr %slot, i64 8
  %kept = call ptr @strncpy(ptr %there, ptr %text, i64 {last})
  call void @write_line(ptr %ring, i32 %status, ptr %category, ptr %text)
  %warns = icmp eq i32 %status, 1
  br i1 %warns, label %count_it, label %done
count_it:
  %warnings = getelementptr i8, ptr %ring, i64 {warnings_at}
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
  %text = alloca [{line} x i8]
  %lost = icmp eq ptr %ring, null
  br i1 %lost, label %done, label %heard
heard:
  %format = call ptr @safe(ptr %given_format)
  call void @llvm.va_start(ptr %list)
  {load}
  %n = call i32 @vsnprintf(ptr %text, i64 {line}, ptr %format, ptr {arguments})
  call void @llvm.va_end(ptr %list)
  call void @keep(ptr %ring, i32 %status, ptr %category, ptr %text)
  br label %done
done:
  ret void
}}

define void @log3(ptr %ring, i32 %status, ptr %category, ptr %given_message) {{
  %lost = icmp eq ptr %ring, null
  br i1 %lost, label %done, label %heard
heard:
  %message = call ptr @safe(ptr %given_message)
  call void @keep(ptr %ring, i32 %status, ptr %category, ptr %message)
  br label %done
done:
  ret void
}}
"""
# One line, at once, so that those of several processes do not mix; the end of one that is too long is cut off.
_WRITE = """
declare i32 @snprintf(ptr, i64, ptr, ...)
declare i64 @write(i32, ptr, i64)
@line = internal constant [16 x i8] c"%s [%s] %s: %s\\0A\\00"
@words = internal constant [{statuses} x [8 x i8]] [{words}]

define internal void @write_line(ptr %ring, i32 %status, ptr %category, ptr %text) {{
  %buffer = alloca [{line} x i8]
  %at = getelementptr i8, ptr %ring, i64 {file_at}
  %file = load i64, ptr %at
  %has = icmp sgt i64 %file, 0
  br i1 %has, label %write, label %done
write:
  %name = getelementptr i8, ptr %ring, i64 {name_at}
  %known = icmp ult i32 %status, {statuses}
  %index = select i1 %known, i32 %status, i32 3
  %word = getelementptr [{statuses} x [8 x i8]], ptr @words, i32 0, i32 %index
  %group = call ptr @safe(ptr %category)
  %n = call i32 (ptr, i64, ptr, ...)
    @snprintf(ptr %buffer, i64 {line}, ptr @line, ptr %name, ptr %group, ptr %word, ptr %text)
  %made = icmp sgt i32 %n, 0
  br i1 %made, label %put, label %done
put:
  %whole = icmp ult i32 %n, {line}
  %size = select i1 %whole, i32 %n, i32 {line_end}
  %long = zext i32 %size to i64
  %before = sub i64 %long, 1
  %end = getelementptr i8, ptr %buffer, i64 %before
  store i8 10, ptr %end
  %descriptor = sub i64 %file, 1
  %short = trunc i64 %descriptor to i32
  %written = call i64 @write(i32 %short, ptr %buffer, i64 %long)
  br label %done
done:
  ret void
}}
"""
_WRITE_NOTHING = """
define internal void @write_line(ptr %ring, i32 %status, ptr %category, ptr %text) {{
  ret void
}}
"""


@cache
def _library() -> object_code.Library:
    triple, cpu, features = object_code.host()
    by_pointer = "windows" in triple or ("darwin" in triple and "arm64" in triple)  # va_list is a plain pointer there
    words = ", ".join('[8 x i8] c"' + word + "\\00" * (8 - len(word)) + '"' for word in STATUS)
    ir = (_IR + (_WRITE if CAN_WRITE else _WRITE_NOTHING)).format(
        entries=ENTRIES,
        entries_at=ENTRIES_AT,
        warnings_at=WARNINGS_AT,
        first_at=FIRST_AT,
        file_at=FILE_AT,
        name_at=NAME_AT,
        entry=ENTRY_BYTES,
        line=LINE_BYTES,
        line_end=LINE_BYTES - 1,
        last=TEXT_BYTES - 1,
        statuses=len(STATUS),
        words=words,
        load="%given = load ptr, ptr %list" if by_pointer else "",
        arguments="%given" if by_pointer else "%list",
    )
    return object_code.Library(emission.emit(ir, triple, cpu, features, ("log2", "log3"), "logger"))


def logger(version: int) -> int:
    """The address of the logger call-back for an FMI version; its environment is the address of a ring."""
    return _library().address(f"log{version}")


class Messages:
    """The last messages of one instance, in zeroed bytes (RING_BYTES,)."""

    def __init__(self, ring: np.ndarray) -> None:
        self._ring = ring.view(np.int64)

    def write_to(self, descriptor: int, name: str) -> None:
        """Have every message written to a file, too, under the instance's name."""
        text = name.encode()[: NAME_BYTES - 1]
        ctypes.memmove(self.environment + NAME_AT, text, len(text))
        self._ring[FILE_AT // 8] = descriptor + 1

    @property
    def warnings(self) -> int:
        """How many of all messages were warnings."""
        return int(self._ring[WARNINGS_AT // 8])

    @property
    def first_warning(self) -> str:
        """The text of the first warning."""
        return _text(self.environment + FIRST_AT)

    @property
    def environment(self) -> int:
        """What the FMU hands back to its logger."""
        return self._ring.ctypes.data

    def state(self) -> np.ndarray:
        """All that was said, as it is kept."""
        count = min(int(self._ring[COUNT_AT // 8]), ENTRIES)
        return self._ring.view(np.uint8)[: ENTRIES_AT + count * ENTRY_BYTES].copy()

    def restore(self, state: np.ndarray) -> None:
        """Have this said, and nothing else; the file stays. Raises: ValueError where it does not fit."""
        ring = self._ring.view(np.uint8)
        file = ring[FILE_AT:FIRST_AT].copy()
        ring[:] = 0
        ring[: state.size] = state
        ring[FILE_AT:FIRST_AT] = file

    def last(self, most: int = 4) -> list[str]:
        """The newest messages that are worse than OK, or the newest at all, oldest first, each with its status."""
        count = int(self._ring[COUNT_AT // 8])
        found = []
        for k in range(max(0, count - ENTRIES), count):
            at = self.environment + ENTRIES_AT + (k % ENTRIES) * ENTRY_BYTES
            status = ctypes.c_int64.from_address(at).value
            found.append((status, _text(at + 8)))
        telling = [pair for pair in found if pair[0] > 0] or found
        return [f"{STATUS[s] if 0 <= s < len(STATUS) else s}: {text}" for s, text in telling[-most:]]


def _text(address: int) -> str:
    """A message in the ring, on one line, without what a terminal would obey."""
    raw = ctypes.string_at(address, TEXT_BYTES).partition(b"\0")[0].decode("utf-8", "replace")
    return " ".join("".join(c if c.isprintable() else " " for c in raw).split())
