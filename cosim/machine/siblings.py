"""Tasks shared out among this process and others that are forked from it, done for what they leave on the disk."""

from __future__ import annotations

import logging
import os
import signal
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

from cosim.machine import notices, supervision

Tasks = Sequence[Callable[[], object]]

_TASK = struct.Struct("<i")
_DONE = struct.Struct("<id")  # so short that a pipe takes it whole


def shared_out(tasks: Tasks, processes: int, locks: Sequence[Any] = ()) -> dict[int, float]:
    """Have tasks done, the first ones first, each by whichever of so many processes is free, of which this is one.

    What a task raises is lost, as is what it returns. locks: held while processes are forked, which else might have
    them locked for ever by a thread that they do not have.

    Returns: of the tasks that were done, by number, the wall-clock time that each took (s). A process that dies leaves
    the task that it was at undone, and that is told.
    """
    queue, fill = os.pipe()
    done, tell = os.pipe()
    os.write(fill, b"".join(map(_TASK.pack, range(len(tasks)))))
    os.close(fill)
    children = list[int]()
    try:
        with ExitStack() as held, suppress(OSError):  # as where there may be no more processes
            for lock in locks:
                held.enter_context(lock)
            for _ in range(processes - 1):
                children.append(supervision.forked(partial(_work_silently, queue, tell, tasks)))
        _work(queue, tell, tasks)
        while children:
            _say(_waited(children.pop()))
    finally:
        for child in children:
            os.kill(child, signal.SIGKILL)
            _waited(child)
        for end in (queue, tell):
            os.close(end)
    with os.fdopen(done, "rb") as told:
        return dict(_DONE.iter_unpack(told.read()))


def _work(queue: int, tell: int, tasks: Tasks) -> None:
    """Take a task from the queue for as long as there is one."""
    while taken := os.read(queue, _TASK.size):
        (number,) = _TASK.unpack(taken)
        began = time.perf_counter()
        with suppress(Exception):
            tasks[number]()
            os.write(tell, _DONE.pack(number, time.perf_counter() - began))


def _work_silently(queue: int, tell: int, tasks: Tasks) -> None:
    """The same in a forked process, whose words would get among this one's."""
    logging.disable()
    _work(queue, tell, tasks)


def _waited(child: int) -> int:
    """The exit code of a child, or less than zero, the signal that ended it."""
    try:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    except ChildProcessError:  # whoever started this process has the system forget its children
        return 0


def _say(code: int) -> None:
    if code:
        notices.warn(f"a process beside this one has ended ({supervision.fate(code)}); what it was at is done here")
