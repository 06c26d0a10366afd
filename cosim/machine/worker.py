"""A thread for native code that may never return, so that this one goes on hearing signals and the clock."""

from __future__ import annotations

import ctypes
import os
import threading
import weakref
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any, TypeVar

from cosim.machine.interruption import GRACE
from cosim.machine.supervision import GLANCE, Patience

T = TypeVar("T")


class Abandoned(Exception):
    """What the thread was doing gave no sign of life, and goes on until this process ends."""


class Worker:
    """A thread that does one thing at a time. It ends with this object, once it has nothing to do."""

    def __init__(self) -> None:
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self.abandoned, self.process = False, os.getpid()
        threading.Thread(target=_work, args=(self._jobs,), name="loop", daemon=True).start()
        weakref.finalize(self, self._jobs.put, None)

    def do(
        self,
        function: Callable[[], T],
        patience: Patience,
        stop: Callable[[], None],
        wanted: Callable[[], bool],
        keep: Sequence[Any] = (),
    ) -> T:
        """What a function returns or raises. stop: asks it to return soon; wanted: whether somebody wants that.

        keep: what native code touches, which an abandoned thread still needs.
        Raises: Abandoned where patience is exhausted; KeyboardInterrupt where it was asked to return and does not.
        """
        done = threading.Lock()  # which takes a fraction of the time of an event
        done.acquire()
        returned: list[T] = []
        raised: list[BaseException] = []

        def job() -> None:
            try:
                returned.append(function())
            except BaseException as error:  # noqa: BLE001  # to be raised where it is waited for
                raised.append(error)
            done.release()

        self._jobs.put(job)
        try:
            _wait(done, patience, stop, wanted)
        except BaseException:
            stop()
            if not done.acquire(timeout=GRACE):
                self._abandon(keep)
            raise
        if raised:
            raise raised[0]
        return returned[0]

    def _abandon(self, keep: Sequence[Any]) -> None:
        """Leave the thread alone, with the memory that it uses."""
        self.abandoned = True
        for thing in keep:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))


_own = threading.local()


def worker_of_this_thread() -> Worker:
    """The one that works for the thread that asks, for as long as that lives: to begin a thread takes a while."""
    worker: Worker | None = getattr(_own, "worker", None)
    if worker is None or worker.abandoned or worker.process != os.getpid():  # a forked process has no such thread
        worker = _own.worker = Worker()
    return worker


def _wait(done: threading.Lock, patience: Patience, stop: Callable[[], None], wanted: Callable[[], bool]) -> None:
    asked = 0.0
    while not done.acquire(timeout=GLANCE):
        if wanted():
            stop()
            asked += GLANCE
        if asked > GRACE:
            raise KeyboardInterrupt
        if patience.exhausted():
            raise Abandoned


def _work(jobs: SimpleQueue[Callable[[], None] | None]) -> None:
    while job := jobs.get():
        job()
        job = None  # which has what it worked on
