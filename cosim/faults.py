"""What is told of a call that failed: the exception, where and when it was raised, and for which instance."""

from __future__ import annotations

import ctypes
import re
import traceback
from dataclasses import dataclass
from pathlib import Path

_HERE = str(Path(__file__).parent)


@dataclass(frozen=True)
class Fault:
    """An exception as a text with its place; the time (s) that the call was given, and its instance, from 0."""

    text: str
    time: float
    instance: int
    cause: Exception | None = None


class _Record(ctypes.Structure):
    """The first words of a frame, see `cosim.adapters`."""

    _fields_ = (
        ("text", ctypes.c_char_p),
        ("first", ctypes.c_int64),
        ("second", ctypes.c_int64),
        ("instance", ctypes.c_int64),
        ("time", ctypes.c_double),
    )


def of_kernel(frame: int) -> Fault | None:
    """What a compiled kernel left in the frame at an address; None where it left nothing."""
    record = _Record.from_address(frame)
    if not record.text:
        return None
    numbers = iter((record.first, record.second))
    text = re.sub("%lld|%%", lambda m: "%" if m[0] == "%%" else str(next(numbers)), record.text.decode())
    return Fault(text, record.time, record.instance)


def of_python(error: Exception, time: float, instance: int) -> Fault:
    """What an interpreted function raised."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((_HERE, "<"))]
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return Fault(words + place, time, instance, error)
