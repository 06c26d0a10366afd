"""Has orders done one after the other, the newest that is wanted next, in a process that may die."""

from __future__ import annotations

import pickle
import subprocess
import sys
import threading
import time as clock
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from cosim.machine.interruption import GRACE
from cosim.machine.supervision import fate
from cosim.watch.orders import Answer, Died, Figures, GivenUp, GiveUp, Mistaken, Order

LONG = 0.5
"""Seconds after which an order is given up for one that is not urgent: sooner, its figures are worth waiting for."""
MOST_COMPILED = 100
"""Kernels, after which a new process takes the place of the one that compiled them: it gives no code back."""
_WORDS = [sys.executable, "-P", "-m", "cosim.watch.runner_process"]


class Runner:
    """tell: is told every answer, by a thread of this runner's."""

    def __init__(self, tell: Callable[[Answer], None]) -> None:
        self._tell = tell
        self._changed = threading.Condition()
        self._next: Order | None = None
        self._doing: Order | None = None
        self._since = 0.0
        self._given_up = 0
        self._closed = False
        self._compiled = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def submit(self, order: Order, urgent: bool) -> None:
        """Have an order done next, in the place of any that waits.

        The one that is being done is given up for an urgent one at once, else if it takes long.
        """
        with self._changed:
            self._next = order
            self._changed.notify_all()
            doing = self._doing
            if doing is None:
                return
            wait = 0.0 if urgent else max(0.0, self._since + LONG - clock.monotonic())
        threading.Timer(wait, self._give_up, [doing]).start()

    def _give_up(self, order: Order) -> None:
        """Ask the process to let an order be; where it does not, end it."""
        with self._changed:
            if self._doing is not order or self._given_up == order.number:
                return
            self._given_up = order.number
            self._send(GiveUp(order.number))
        threading.Timer(GRACE, self._kill, [order]).start()

    def _kill(self, order: Order) -> None:
        with self._changed:
            if self._doing is order and self._process:
                self._process.kill()

    def close(self) -> None:
        """End it all."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            if self._process:
                self._process.kill()
        self._thread.join(GRACE)

    # ---- the thread ----

    def _work(self) -> None:
        while True:
            with self._changed:
                self._doing = None
                if self._compiled > MOST_COMPILED:
                    self._end()
                started = self._process is None
                process = self._process = self._process or _started()
            if started:  # nothing is wanted of it, nor given up, before it can listen
                self._begin(process)
            with self._changed:
                self._changed.wait_for(lambda: self._next or self._closed)
                if self._closed:
                    self._end()
                    return
                assert self._next
                order, self._next, self._doing, self._since = self._next, None, self._next, clock.monotonic()
            self._do(order, process)

    def _begin(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for its first word; one that cannot begin is seen to be gone where it has something to do."""
        assert process.stdout
        with suppress(EOFError, OSError, pickle.UnpicklingError):
            pickle.load(process.stdout)  # noqa: S301  # of our own process

    def _do(self, order: Order, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout
        self._send(order)
        while True:
            try:
                answer: Answer = pickle.load(process.stdout)  # noqa: S301  # of our own process
            except (EOFError, OSError, pickle.UnpicklingError):
                self._lost(order)
                return
            self._tell(answer)
            if isinstance(answer, Figures):
                self._compiled += answer.view["compiled"]
            if isinstance(answer, Mistaken | Figures | GivenUp):
                return

    def _end(self) -> int:
        """End the process; its exit code, as of `fate`."""
        process, self._process, self._compiled = self._process, None, 0
        assert process
        assert process.stdin
        assert process.stdout
        process.kill()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                pipe.close()
        return process.wait()

    def _lost(self, order: Order) -> None:
        with self._changed:
            how = fate(self._end())
            given_up, closed = self._given_up == order.number, self._closed
        if not closed:
            self._tell(GivenUp(order.number) if given_up else Died(order.number, how))

    def _send(self, order: Any) -> None:
        with self._changed, suppress(OSError):  # what the process is gone for is seen where its answers are read
            if self._process and self._process.stdin:
                pickle.dump(order, self._process.stdin)
                self._process.stdin.flush()


def _started() -> subprocess.Popen[bytes]:
    return subprocess.Popen(_WORDS, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603  # ours
