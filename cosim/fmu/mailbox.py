"""Calls from one process to another through a few words of shared memory.

Both processes have the arena at the same address, so a call is only its number and the time, an answer only a status.
Each side writes its own cache lines. Who waits first spins, then yields its processor, then sleeps until it is woken;
how long it spins follows from whether that helped, because where the other side has no processor, spinning takes it
one.
Like `cosim.master.loop`, this is one source for both engines.
"""

from __future__ import annotations

import platform
import sys
from typing import Any

import numpy as np

from cosim.fmu import c_library
from cosim.fmu.fields import LINK, PLAN
from cosim.machine.memory import call, invoke, load, pause, reals_at, shared, store, words_at
from cosim.machine.parallel import processors

OK, WARNING = 0, 1

# A mailbox. The caller writes the first line, the server the second; a flag says that the other side must wake it.
MAILBOX_WORDS = 80
REQUEST, NUMBER, TIME, CALLER_SPINS = (
    0,
    1,
    2,
    3,
)  # how many calls there have been; the last one's number (or STOP) and time (s)
ANSWER, STATUS, SERVER_SPINS = 16, 17, 18  # how many calls have been answered, and the last one's status
CALLER_SLEEPS, SERVER_SLEEPS = 32, 48
CALLS = 64  # the address of the server's table of calls: (function, frame) each
SPINS, YIELDS, YIELD, SLEEP, WAKE_ARGUMENT = 65, 66, 67, 68, 69  # how to wait: see `new`
TIMEOUT = 70  # two words: a timespec
STOP = -1

# What `remote` finds behind its frame's third word: servers, which of them failed last, and their mailboxes' addresses.
SERVERS, FAILED, BOXES = 0, 1, 2
FRAME_WORDS = PLAN + 1  # of a frame, as of `cosim.fmu.fields`; PLAN is the number of the call here

_SLEEP_SECONDS = 0.1
_SPINNING, _LEAST = 300, 8  # pauses of some 40 ns
_YIELDING = 100
_FUTEX = {"x86_64": 202, "aarch64": 98}
_FUTEX_WAIT, _FUTEX_WAKE = 0, 1
_NAPS = 10  # sleeps after which a server looks whether somebody still needs it


def remote(time: float, base: int, frame: int) -> int:
    """Have the servers of a block do a call, all at once. Returns the worst status."""
    f = words_at(frame, FRAME_WORDS)
    n = words_at(f[LINK], BOXES)[SERVERS]
    link = words_at(f[LINK], BOXES + n)
    for k in range(n):
        post(link[BOXES + k], f[PLAN], time)
    worst = OK
    for k in range(n):
        c = words_at(link[BOXES + k], MAILBOX_WORDS)
        while not changes(link[BOXES + k], ANSWER, CALLER_SLEEPS, CALLER_SPINS, c[REQUEST] - 1):
            pass
        if c[STATUS] > worst:
            worst = c[STATUS]
            link[FAILED] = k
    return worst


def serve(time: float, base: int, box: int) -> int:
    """Do what is asked for, until STOP. Returns OK then, and WARNING if nobody has asked for a while."""
    c = words_at(box, MAILBOX_WORDS)
    answered = c[ANSWER]
    while True:
        if not changes(box, REQUEST, SERVER_SLEEPS, SERVER_SPINS, answered):
            return WARNING
        number = c[NUMBER]
        if number != STOP:
            row = words_at(c[CALLS] + number * 16, 2)
            c[STATUS] = call(row[0], reals_at(box, MAILBOX_WORDS)[TIME], base, row[1])
        answered += 1
        store(box + 8 * ANSWER, answered)
        if load(box + 8 * CALLER_SLEEPS) != 0:
            wake(c, box + 8 * ANSWER)
        if number == STOP:
            return OK


def post(box: int, number: int, time: float) -> int:
    """Ask for a call."""
    c = words_at(box, MAILBOX_WORDS)
    c[NUMBER] = number
    reals_at(box, MAILBOX_WORDS)[TIME] = time
    store(box + 8 * REQUEST, c[REQUEST] + 1)
    if load(box + 8 * SERVER_SLEEPS) != 0:
        wake(c, box + 8 * REQUEST)
    return OK


def changes(box: int, word: int, sleeps: int, spins: int, old: int) -> bool:
    """Wait until a word is no longer what it was. Returns whether it has changed within a second or so of sleep."""
    c = words_at(box, MAILBOX_WORDS)
    at = box + 8 * word
    n = c[spins]
    for _ in range(n):
        if load(at) != old:
            if n < c[SPINS]:
                c[spins] = n + 1 + n // 8
            return True
        pause()
    if n > _LEAST:
        c[spins] = n // 2
    for _ in range(c[YIELDS]):
        if load(at) != old:
            return True
        invoke(c[YIELD], ())
    for _ in range(_NAPS):
        store(box + 8 * sleeps, 1)
        if load(at) == old:
            sleep(c, box, at, old)
        store(box + 8 * sleeps, 0)
        if load(at) != old:
            return True
    return False


def sleep(c: Any, box: int, at: int, old: int) -> int:
    """Sleep until woken, at most for a while: on a futex where there is one."""
    if c[WAKE_ARGUMENT] != 0:
        return invoke(c[SLEEP], (c[WAKE_ARGUMENT], at, _FUTEX_WAIT, old, box + 8 * TIMEOUT, 0, 0))
    return invoke(c[SLEEP], (50,))


def wake(c: Any, at: int) -> int:
    """Wake who sleeps on a word."""
    if c[WAKE_ARGUMENT] != 0:
        return invoke(c[SLEEP], (c[WAKE_ARGUMENT], at, _FUTEX_WAKE, 1, 0, 0, 0))
    return OK


def new() -> np.ndarray:
    """A mailbox in shared memory (MAILBOX_WORDS,), ready to be posted to."""
    box = shared(8 * MAILBOX_WORDS).view(np.int64)
    number = _FUTEX.get(platform.machine(), 0) if sys.platform == "linux" else 0
    box[SPINS] = box[CALLER_SPINS] = box[SERVER_SPINS] = _SPINNING if processors() > 1 else 0
    box[YIELDS] = _YIELDING
    box[YIELD] = c_library.address("sched_yield")
    box[SLEEP] = c_library.address("syscall" if number else "usleep")
    box[WAKE_ARGUMENT] = number
    box[TIMEOUT : TIMEOUT + 2] = 0, int(_SLEEP_SECONDS * 1e9)
    return box
