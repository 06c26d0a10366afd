"""Ctrl-C, SIGTERM and SIGHUP: outside of a run they end the program, inside they wait for where nothing is lost.

A signal that this process was started to ignore (as nohup does with SIGHUP) stays ignored. Threads other than the main
one get no signals, and are left alone.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


GRACE = 2.0
"""Seconds that whatever is asked to end has for ending by itself."""


class Interrupted(KeyboardInterrupt):
    """A signal wants the program to end; number: which. run: what there is of a run that it ended, for a program."""

    run: Any = None

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Interruption:
    """Whether a signal has come, and which came first; where it is harmless, it breaks through if nobody heeds it."""

    def __init__(self) -> None:
        self.number = 0
        self._later: Callable[[], Any] | None = None  # where it may break through: has it do so after a while

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """As a signal's handler."""
        again, self.number = self.wanted, self.number or number
        if self._later and again:
            raise Interrupted(self.number)
        if self._later:
            self._later()

    @property
    def wanted(self) -> bool:
        """Whether a signal has come."""
        return self.number != 0

    def raise_if_wanted(self) -> None:
        """Raise: Interrupted, at the caller's convenience."""
        if self.wanted:
            raise Interrupted(self.number)

    @contextmanager
    def breakable(self) -> Iterator[None]:
        """For what may never end, and loses nothing.

        A signal that is not heeded within GRACE, or a second one at once, raises Interrupted. The first needs the main
        thread of a system with SIGALRM.
        """
        with alarm(self._break_through) as begin:
            self._later = partial(begin, GRACE, GRACE)
            try:
                if self.wanted:
                    self._later()
                yield
            finally:
                self._later = None

    def _break_through(self, number: int, frame: FrameType | None) -> None:
        if self._later:
            raise Interrupted(self.number)


@contextmanager
def deferred() -> Iterator[Interruption]:
    """Inside, signals only set a mark."""
    interruption = Interruption()
    with _handled(interruption):
        yield interruption


@contextmanager
def heard() -> Iterator[Interruption]:
    """Inside, all signals raise Interrupted, wherever the program is; what swallows it leaves the mark."""
    interruption = Interruption()

    def now(number: int, _frame: FrameType | None) -> None:
        interruption.number = number
        interruption.raise_if_wanted()

    with _handled(now):
        yield interruption


def ignore() -> None:
    """From here on no signal counts: the program is ending anyhow, and cleans up."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def alarm(handler: Callable[[int, FrameType | None], Any]) -> Iterator[Callable[[float, float], Any]]:
    """Inside, `handler` is called so many seconds after the given function, and again and again after so many more.

    That needs the main thread of a system with SIGALRM; elsewhere nothing is called.
    """
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield lambda first, again: None
        return
    before = signal.signal(signal.SIGALRM, handler)
    try:
        yield partial(signal.setitimer, signal.ITIMER_REAL)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], Any]) -> Iterator[None]:
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in SIGNALS}
    heeded = [number for number, found in before.items() if found not in (signal.SIG_IGN, None)]
    try:
        for number in heeded:
            signal.signal(number, handler)
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])
