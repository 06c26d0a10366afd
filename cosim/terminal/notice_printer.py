"""Prints what `cosim.machine.notices` tells: warnings always, progress to who sits at a terminal."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from cosim.machine.notices import LOG

PREFIXES = {logging.ERROR: "error: ", logging.WARNING: "cosim: "}


class _Printing(logging.Handler):
    """To what standard error is when the word comes."""

    def emit(self, record: logging.LogRecord) -> None:
        if sys.stderr and (record.levelno > logging.INFO or sys.stderr.isatty()):
            with suppress(OSError):
                print(PREFIXES.get(record.levelno, "") + record.getMessage(), file=sys.stderr, flush=True)


@contextmanager
def printed() -> Iterator[None]:
    """Print notices until the block is left."""
    log, handler = logging.getLogger(LOG), _Printing()
    level, log.propagate = log.level, False
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
        log.propagate = True
