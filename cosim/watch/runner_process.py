"""The process in which diagrams run: orders come through standard input, answers go through standard output.

Nothing that an author's code does, nor a crash of it, reaches the page's process. What blocks print goes to standard
error. It ends with its standard input.
"""

from __future__ import annotations

import logging
import os
import pickle
import sys
import threading
from functools import partial
from queue import SimpleQueue
from typing import IO, Any

from cosim.machine import interruption
from cosim.machine.notices import LOG
from cosim.watch.orders import Advance, Answer, GivenUp, GiveUp, Order
from cosim.watch.rerun import Unwanted, Workplace
from cosim.wiring import library


class _Asked:
    """What comes through a stream, read by a thread of its own."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.orders: SimpleQueue[Order] = SimpleQueue()
        self.unwanted = 0

    def listen(self) -> None:
        """Until the stream ends, and the process with it."""
        while True:
            try:
                order = pickle.load(self._stream)  # noqa: S301  # of the process that started this one
            except EOFError:
                os._exit(0)
            if isinstance(order, GiveUp):
                self.unwanted = order.number
            else:
                self.orders.put(order)

    def see_wanted(self, order: Order) -> None:
        """Raises: Unwanted."""
        if self.unwanted == order.number:
            raise Unwanted


class _Notices(logging.Handler):
    """Words on the way, such as of what is compiled, go to the page."""

    def __init__(self, tell: Any) -> None:
        super().__init__()
        self.number = 0
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self._tell(Advance(self.number, record.getMessage()))


def main() -> None:
    """Do what is asked for, until nobody asks any more."""
    interruption.ignore()  # whoever started it decides
    with os.fdopen(os.dup(0), "rb") as stream, os.fdopen(os.dup(1), "wb") as answered:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(2, 1)
        sys.stdout = sys.stderr
        asked = _Asked(stream)
        threading.Thread(target=asked.listen, daemon=True).start()
        library.all_blocks()  # which takes a moment that nobody waits for yet
        tell = partial(_send, answered)
        tell(Advance(0, "ready"))
        _serve(asked, tell)


def _send(stream: IO[bytes], answer: Answer) -> None:
    pickle.dump(answer, stream)
    stream.flush()


def _serve(asked: _Asked, tell: Any) -> None:
    notices = _Notices(tell)
    log = logging.getLogger(LOG)
    log.setLevel(logging.INFO)
    log.addHandler(notices)
    workplace = Workplace(tell)
    while True:
        order = asked.orders.get()
        notices.number = order.number
        try:
            workplace.do(order, partial(asked.see_wanted, order))
        except Unwanted:
            tell(GivenUp(order.number))


if __name__ == "__main__":
    main()
