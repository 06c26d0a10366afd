"""A thread for native code that may never return, so that this one goes on hearing signals and the clock."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, TypeVar

from cosim.machine.interruption import GRACE
from cosim.machine.supervision import GLANCE, Patience

T = TypeVar("T")


class Abandoned(Exception):
    """What the thread was doing gave no sign of life, and goes on until this process ends."""


class Worker:
    """A thread that does one thing at a time. keep: what native code touches, which an abandoned thread still needs."""

    def __init__(self, *keep: Any) -> None:
        self._keep = keep
        self._jobs: SimpleQueue[Callable[[], None] | None] | None = None
        self.abandoned = False

    def _hand(self, job: Callable[[], None]) -> None:
        """Give a job to the thread, which begins with its first one and, closed, with the next one."""
        if self._jobs is None:
            self._jobs = SimpleQueue()
            threading.Thread(target=_work, args=(self._jobs,), name="loop", daemon=True).start()
        self._jobs.put(job)

    def do(
        self, function: Callable[[], T], patience: Patience, stop: Callable[[], None], wanted: Callable[[], bool]
    ) -> T:
        """What a function returns or raises. stop: asks it to return soon; wanted: whether somebody wants that.

        Raises: Abandoned where patience is exhausted; KeyboardInterrupt where it was asked to return and does not.
        """
        done = threading.Event()
        returned: list[T] = []
        raised: list[BaseException] = []

        def job() -> None:
            try:
                returned.append(function())
            except BaseException as error:  # noqa: BLE001  # to be raised where it is waited for
                raised.append(error)
            done.set()

        self._hand(job)
        try:
            self._wait(done, patience, stop, wanted)
        except BaseException:
            stop()
            if not done.wait(GRACE):
                self._abandon()
            raise
        if raised:
            raise raised[0]
        return returned[0]

    def _wait(
        self, done: threading.Event, patience: Patience, stop: Callable[[], None], wanted: Callable[[], bool]
    ) -> None:
        asked = 0.0
        while not done.wait(GLANCE):
            if wanted():
                stop()
                asked += GLANCE
            if asked > GRACE:
                raise KeyboardInterrupt
            if patience.exhausted():
                raise Abandoned

    def _abandon(self) -> None:
        """Leave the thread alone, with the memory that it uses."""
        self.abandoned = True
        for thing in (self, *self._keep):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))

    def close(self) -> None:
        """Let the thread end once it has nothing to do."""
        if self._jobs is not None:
            self._jobs.put(None)
            self._jobs = None


def _work(jobs: SimpleQueue[Callable[[], None] | None]) -> None:
    while job := jobs.get():
        job()
