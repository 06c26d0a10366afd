"""Guards around the import of other people's Python files: their prints, their exits, and a patience."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType
from typing import Any

from cosim.machine import interruption, notices, streams

#: Held where authors' files are imported and compiled code is loaded, which one thread of a process does at a time.
LOADING = threading.RLock()
#: For how long (s of wall-clock time) an import may take.
PATIENCE = 60.0
#: An import that goes on after its patience is asked again to end: how often, and after how long (s).
ASKED, AGAIN = 5, 1.0
_leave = os._exit


class Stuck(BaseException):
    """Raised where an import is when its patience is over; no `except Exception` holds it up."""


class Exited(SystemExit):
    """Raised where an import would end the process without a word."""


@contextmanager
def guarded(what: str) -> Iterator[None]:
    """Around an import: what it prints goes to standard error, and neither `os._exit` nor an endless loop ends it.

    The patience needs the main thread of a system with SIGALRM; elsewhere there is none. what: the file, in words.
    Raises: Stuck, Exited, and what the import raises.
    """
    with ExitStack() as stack:
        stack.enter_context(_printing_to_stderr())
        stack.enter_context(_not_exiting())
        stack.enter_context(_patient(what))
        yield


@contextmanager
def _printing_to_stderr() -> Iterator[None]:
    """Of Python's own output and of what is written to the file descriptor, as child processes do."""
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    try:
        kept = os.dup(1)
    except OSError:  # closed
        kept = None
    try:
        if kept is not None:
            with suppress(OSError):
                os.dup2(2, 1)
        with streams.aside():
            yield
    finally:
        with suppress(OSError, ValueError):
            if sys.__stdout__ is not None:
                sys.__stdout__.flush()
        if kept is not None:
            os.dup2(kept, 1)
            os.close(kept)


@contextmanager
def _not_exiting() -> Iterator[None]:
    plain, here = os._exit, os.getpid()

    def leave(status: int) -> Any:
        if os.getpid() != here:  # a child that the import forked
            plain(status)
        raise Exited(f"os._exit({status})")

    homes: list[Any] = [os, sys.modules[os.name]]
    for home in homes:
        home._exit = leave  # noqa: SLF001  # a public name
    try:
        yield
    finally:
        for home in homes:
            home._exit = plain  # noqa: SLF001


@contextmanager
def _patient(what: str) -> Iterator[None]:
    asked = 0

    def stop(_number: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked += 1
        if asked > ASKED:
            place = f" at {frame.f_code.co_filename}:{frame.f_lineno}" if frame else ""
            notices.fail(f"the import of {what} does not end{place}, whatever is done")
            _leave(2)
        raise Stuck(f"it does not come to an end within {PATIENCE:g} s")

    with interruption.alarm(stop) as begin:
        begin(PATIENCE, AGAIN)
        yield
