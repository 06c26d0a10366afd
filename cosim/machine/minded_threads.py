"""Threads that work side by side on native code, and one that minds them: whoever gives no sign of life is given up.

Each does its jobs itself, where `Worker` hands every call of native code to a thread of its own: of many short runs
that would be most of the time.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from cosim.machine.interruption import GRACE
from cosim.machine.supervision import GLANCE, Patience

T = TypeVar("T")
Job = tuple["Future[Any]", Callable[[], Any]]
_here = threading.local()


class Forsaken(BaseException):
    """Native code has returned to a thread that was given up: somebody else has told how its job ended."""


class MindedThread:
    """One of `MindedThreads`, and the native code that it is in, if it is in some."""

    def __init__(self, jobs: SimpleQueue[Job | None], number: int) -> None:
        self.given_up = False
        self._jobs = jobs
        self._lock = threading.Lock()
        self._future: Future[Any] = Future()
        self._called: tuple[Patience, Callable[[], Exception]] | None = None
        self.thread = threading.Thread(target=self._work, name=f"member_{number}", daemon=True)
        self.thread.start()

    def call(self, function: Callable[[], T], patience: Patience, silent: Callable[[], Exception]) -> T:
        """What native code returns. silent: the error that ends the job where patience is exhausted.

        Raises: what it raises; Forsaken.
        """
        patience.renew()
        around, self._called = self._called, (patience, silent)  # native code may have Python run another diagram
        try:
            return function()
        finally:
            with self._lock:
                self._called = around
            if self.given_up:
                raise Forsaken

    def mind(self, hurried: bool) -> bool:
        """Give it up where it gives no sign of life, and say whether it is.

        hurried: whether its result is no longer waited for, but that it ends; then nobody says that its job failed.
        """
        with self._lock:
            if self._called:
                patience, silent = self._called
                patience.limit = min(patience.limit, GRACE) if hurried else patience.limit
                if patience.exhausted():
                    self.given_up = True
                    self._future.set_exception(KeyboardInterrupt() if hurried else silent())
        return self.given_up

    def _work(self) -> None:
        _here.thread = self
        while job := self._jobs.get():
            self._future, function = job
            if not self._future.set_running_or_notify_cancel():
                continue
            try:
                result = function()
            except BaseException as error:  # noqa: BLE001  # to be raised where it is waited for
                if self.given_up:
                    return
                self._future.set_exception(error)
            else:
                self._future.set_result(result)


class MindedThreads(Executor):
    """An executor of so many threads; in the place of one that is given up comes another."""

    def __init__(self, count: int) -> None:
        self._jobs: SimpleQueue[Job | None] = SimpleQueue()
        self._threads = [MindedThread(self._jobs, number) for number in range(count)]
        self._hurried, self._over = False, threading.Event()
        threading.Thread(target=self._mind, name="minder", daemon=True).start()

    def submit(self, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """As of `Executor`."""
        future: Future[T] = Future()
        self._jobs.put((future, partial(function, *args, **kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """As of `Executor`; nobody waits for those that are given up."""
        self._hurried |= cancel_futures
        while cancel_futures:
            try:
                job = self._jobs.get_nowait()
            except Empty:
                break
            if job:
                job[0].cancel()
        for _ in self._threads:
            self._jobs.put(None)
        while wait and (busy := [one for one in self._threads if one.thread.is_alive() and not one.given_up]):
            busy[0].thread.join(GLANCE)
        self._over.set()

    def _mind(self) -> None:
        while not self._over.wait(GLANCE):
            for number, one in enumerate(self._threads):
                if not one.given_up and one.mind(self._hurried):
                    self._threads[number] = MindedThread(self._jobs, number)


def this_thread() -> MindedThread | None:
    """The thread that asks, where it is minded."""
    return getattr(_here, "thread", None)
