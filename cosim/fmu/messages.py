"""An FMU's log messages, kept natively: its logger writes into a ring in memory, so that no message enters Python.

FMI 2's logger is variadic, which neither ctypes nor numba can define: hence the few lines of LLVM.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from cosim import compiler, native

ENTRIES, ENTRY_BYTES, TEXT_BYTES = 16, 512, 504  # an entry is a status word and a text
RING_BYTES = 8 + ENTRIES * ENTRY_BYTES
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")

# Both loggers claim an entry of the ring at %ring, which is the instance environment, and write status and text there.
_IR = """
declare void @llvm.va_start(ptr)
declare void @llvm.va_end(ptr)
declare i32 @vsnprintf(ptr, i64, ptr, ptr)
declare ptr @strncpy(ptr, ptr, i64)

define internal ptr @claim(ptr %ring, i32 %status) {{
  %count = atomicrmw add ptr %ring, i64 1 seq_cst
  %index = urem i64 %count, {entries}
  %place = mul i64 %index, {entry}
  %first = getelementptr i8, ptr %ring, i64 8
  %slot = getelementptr i8, ptr %first, i64 %place
  %word = zext i32 %status to i64
  store i64 %word, ptr %slot
  %text = getelementptr i8, ptr %slot, i64 8
  ret ptr %text
}}

define void @log2(ptr %ring, ptr %name, i32 %status, ptr %category, ptr %format, ...) {{
  %list = alloca [32 x i8], align 16
  %text = call ptr @claim(ptr %ring, i32 %status)
  call void @llvm.va_start(ptr %list)
  {load}
  %n = call i32 @vsnprintf(ptr %text, i64 {size}, ptr %format, ptr {arguments})
  call void @llvm.va_end(ptr %list)
  ret void
}}

define void @log3(ptr %ring, i32 %status, ptr %category, ptr %message) {{
  %text = call ptr @claim(ptr %ring, i32 %status)
  %copied = call ptr @strncpy(ptr %text, ptr %message, i64 {last})
  ret void
}}
"""


@cache
def _library() -> native.Library:
    triple, cpu, features = native.host()
    by_pointer = "windows" in triple or ("darwin" in triple and "arm64" in triple)  # va_list is a plain pointer there
    ir = _IR.format(
        entries=ENTRIES,
        entry=ENTRY_BYTES,
        size=TEXT_BYTES,
        last=TEXT_BYTES - 1,
        load="%given = load ptr, ptr %list" if by_pointer else "",
        arguments="%given" if by_pointer else "%list",
    )
    return native.Library(compiler.emit(ir, triple, cpu, features, ("log2", "log3"), "logger"))


def logger(version: int) -> int:
    """The address of the logger call-back for an FMI version; its environment is the address of a ring."""
    return _library().address(f"log{version}")


class Messages:
    """The last messages of one instance, in zeroed bytes (RING_BYTES,)."""

    def __init__(self, ring: np.ndarray) -> None:
        self._ring = ring.view(np.int64)

    @property
    def environment(self) -> int:
        """What the FMU hands back to its logger."""
        return self._ring.ctypes.data

    def last(self, most: int = 4) -> list[str]:
        """The newest messages that are worse than OK, or the newest at all, oldest first, each with its status."""
        count = int(self._ring[0])
        found = []
        for k in range(max(0, count - ENTRIES), count):
            at = self.environment + 8 + (k % ENTRIES) * ENTRY_BYTES
            status = ctypes.c_int64.from_address(at).value
            text = ctypes.string_at(at + 8).decode("utf-8", "replace").strip()
            found.append((status, text))
        telling = [pair for pair in found if pair[0] > 0] or found
        return [f"{STATUS[s] if 0 <= s < len(STATUS) else s}: {text}" for s, text in telling[-most:]]
