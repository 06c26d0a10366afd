"""Standard output and standard error that cannot stop the work: what they do not take is noted, and told at the end."""

from __future__ import annotations

import errno
import io
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

DESCRIPTORS = {"stdout": 1, "stderr": 2}
_lock = threading.Lock()
_inside: list[Any] = []  # for each who is inside `aside`, standard output as the first one found it


class _Sink(io.RawIOBase):
    """A file descriptor that takes everything; what went wrong first is kept, and after that nothing is written."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.error: OSError | None = None

    def write(self, data: Any) -> int:
        if self.error is None:
            try:
                return os.write(self._descriptor, data)
            except OSError as error:
                self.error = error
        return len(data)

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def isatty(self) -> bool:
        return self.error is None and os.isatty(self._descriptor)


class StandardOutput:
    """Whether standard output took what was printed."""

    def __init__(self, sink: _Sink | None) -> None:
        self._sink = sink

    def failure(self) -> str:
        """Why not, or nothing: a reader that has gone read all that it wanted."""
        if self._sink is None:
            return ""
        sys.stdout.flush()
        error = self._sink.error
        return "" if error is None or error.errno == errno.EPIPE else error.strerror or str(error)


@contextmanager
def forgiving() -> Iterator[StandardOutput]:
    """Inside, printing raises nothing. Streams that somebody else has put in their places are left alone."""
    own = {name: n for name, n in DESCRIPTORS.items() if getattr(sys, name) is getattr(sys, f"__{name}__")}
    before = {name: getattr(sys, name) for name in own}
    sinks = {name: _Sink(_descriptor(number)) for name, number in own.items()}
    for name, sink in sinks.items():
        stream = before[name]
        if stream is None:
            sink.error = OSError(errno.EBADF, os.strerror(errno.EBADF))
        else:
            stream.flush()
        encoding, lines = stream.encoding if stream else "utf-8", name == "stderr" or sink.isatty()
        # file names may be any bytes and an encoding may lack any character; what is written instead is fit for JSON
        text = io.TextIOWrapper(io.BufferedWriter(sink), encoding, "backslashreplace", line_buffering=lines)
        setattr(sys, name, text)
    try:
        yield StandardOutput(sinks.get("stdout"))
    finally:
        for name, stream in before.items():
            getattr(sys, name).flush()
            setattr(sys, name, stream)


@contextmanager
def aside() -> Iterator[None]:
    """Inside, what is printed goes to standard error: standard output may be one JSON object.

    There is one standard output for all threads: the last one that leaves puts it back.
    """
    with _lock:
        _inside.append(_inside[0] if _inside else sys.stdout)
        sys.stdout = sys.stderr
    try:
        yield
    finally:
        with _lock:
            before = _inside.pop()
            if not _inside:
                sys.stdout = before


def _descriptor(number: int) -> int:
    """The number, with something behind it: else the next file that is opened would get what is printed."""
    try:
        os.fstat(number)
    except OSError:
        while os.open(os.devnull, os.O_RDWR) < number:
            pass
        os.set_inheritable(number, True)
    return number
