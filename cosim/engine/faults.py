"""What is told of a call that failed: the exception, where and when it was raised, and for which instance."""

from __future__ import annotations

import ast
import ctypes
import linecache
import re
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.compiling.frame import FaultRecord

_HERE = str(Path(__file__).parents[1])
_INDEX = re.compile(r"index (-?\d+) is out of bounds for axis (\d+) with size (\d+)")


@dataclass(frozen=True)
class Fault:
    """An exception as a text with its place; the time (s) that the call was given, and its instance, from 0."""

    text: str
    time: float
    instance: int


def left(frame: int) -> Fault | None:
    """What a call that failed left in its frame, at an address; None where it left nothing."""
    record = FaultRecord.from_address(frame)
    if not record.text:
        return None
    numbers = iter((record.first, record.second))
    text = record.text.decode(errors="replace")
    text = re.sub("%lld|%%", lambda m: "%" if m[0] == "%%" else str(next(numbers)), text)
    return Fault(text, record.time, record.instance)


def leave(frame: int, texts: np.ndarray, error: BaseException, time: float, instance: int) -> None:
    """Leave in a frame what an interpreted function raised, as a compiled one does; texts: bytes that stay."""
    text = _text(error).replace("%", "%%").encode(errors="backslashreplace")[: len(texts) - 1] + b"\0"
    texts[: len(text)] = np.frombuffer(text, np.uint8)
    record = FaultRecord.from_address(frame)
    ctypes.c_int64.from_address(frame).value = texts.ctypes.data
    record.instance, record.time = instance, time


def _text(error: BaseException) -> str:
    """An exception with its place, in the words of a compiled function."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((_HERE, "<"))]
    words = str(error)
    if frames and (found := _INDEX.fullmatch(words)):
        index, axis, size = found.groups()
        words = f"index {index} is out of bounds for axis {axis} of {_array(frames[-1])}, size {size}"
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return (f"{type(error).__name__}: {words}" if words else type(error).__name__) + place


def _array(frame: traceback.FrameSummary) -> str:
    """The name of the array that is indexed at a place of a source file."""
    line = linecache.getline(frame.filename, frame.lineno or 0).encode()
    try:
        found = ast.parse(line[frame.colno : frame.end_colno].decode(), mode="eval").body
    except SyntaxError:  # it goes over several lines
        return "an array"
    return (
        f"`{found.value.id}`" if isinstance(found, ast.Subscript) and isinstance(found.value, ast.Name) else "an array"
    )
