"""Threads that work side by side, as many as there are processors."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def threads(count: int) -> Iterator[Executor]:
    """Threads of this process, as of `ending`."""
    with ending(ThreadPoolExecutor(count, "member")) as executor:
        yield executor


@contextmanager
def ending(executor: Any) -> Iterator[Any]:
    """An executor whose work is waited for; on the way out by an exception, what has not begun is cancelled."""
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=True, cancel_futures=True)
        raise
    executor.shutdown(wait=True)
