"""Processes forked for what may crash or hang, and the watch over them.

A forked process has everything that this one has, at the same addresses, and shares with it what lies in
`cosim.machine.memory.shared`. It does what it is told by name through a pipe, and answers. It may die by a signal,
leave by exit(), or answer never: then `Ended` says which process, and how. Needs fork, which Windows lacks.
"""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import os
import signal
import sys
import threading
import time
import warnings
import weakref
from collections.abc import Callable, Hashable, Mapping
from functools import partial
from typing import Any, NoReturn

from cosim.machine import interruption
from cosim.machine.interruption import GRACE

AVAILABLE = hasattr(os, "fork")
GLANCE = 0.1
"""Seconds between two looks at whether a process still does something."""
_CUT_OFF = 113  # exit code of a process whose pipe is gone
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_SIGNALS = {"SIGSEGV": "segmentation fault", "SIGBUS": "bus error", "SIGABRT": "abort()", "SIGFPE": "arithmetic trap"}
_SIGNALS |= {"SIGILL": "illegal instruction", "SIGKILL": "somebody, or a lack of memory, killed the process"}
_connections: set[Any] = set()  # this process's ends, which no forked process may keep open

Commands = Mapping[str, Callable[..., Any]]


def never() -> bool:
    """That nobody wants anything."""
    return False


def fate(code: int) -> str:
    """How a process ended, in words; code: its exit code, or less than zero, the signal that ended it."""
    if code >= 0:
        return f"exit() with code {code}"
    name = signal.Signals(-code).name if -code in signal.valid_signals() else f"signal {-code}"
    return _SIGNALS.get(name, name)


def forked(work: Callable[[], object]) -> int:
    """The number of a new process, which works and ends: with code 0, or 1 where that raises something."""
    parent = os.getpid()
    mortal = threading.current_thread() is threading.main_thread()
    _flush()
    with warnings.catch_warnings():
        # Python 3.12 warns of other threads' locks; a forked process uses what is its own, or locked over the fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        code = 1
        try:
            _settle(parent, mortal)
            work()
            code = 0
        finally:
            os._exit(code)
    return child


class Ended(Exception):
    """A process is gone, or had to be killed; how: in words; hung: whether it was killed for its silence."""

    def __init__(self, name: str, how: str, hung: bool = False) -> None:
        super().__init__(f"process {name}: {how}")
        self.name = name
        self.how = how
        self.hung = hung


class Process:
    """A forked process that does what it is told, see `Crew`."""

    def __init__(self, name: str, commands: Commands) -> None:
        from multiprocessing.connection import Pipe

        self.name = name
        self.connection, there = Pipe()
        self.answers: list[tuple[bool, Any]] = []
        self.pid = forked(partial(_obey, self.connection, there, commands))
        there.close()
        _connections.add(self.connection)

    def listen(self) -> None:
        """Keep an answer that has come. Raises: Ended where the process is gone, or has closed the pipe."""
        try:
            if self.connection.poll():
                self.answers.append(self.connection.recv())
                return
        except (EOFError, OSError):
            raise Ended(self.name, self._fate(GRACE)) from None
        if self._left(0):
            raise Ended(self.name, self._fate(0))

    def end(self, grace: float) -> None:
        """Let it go, and kill it where it does not go within a time (s)."""
        _connections.discard(self.connection)
        self.connection.close()
        if not self._left(grace):
            os.kill(self.pid, signal.SIGKILL)
            self._left(GRACE)

    def _left(self, grace: float) -> bool:
        """Whether the process is gone, or goes within a time (s)."""
        limit = time.monotonic() + grace
        while self.pid:
            try:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
            except ChildProcessError:
                pid, status = self.pid, 0
            if pid:
                self.pid, self._status = 0, status
            elif time.monotonic() >= limit:
                return False
            else:
                time.sleep(0.001)
        return True

    def _fate(self, grace: float) -> str:
        if not self._left(grace) or self._status == _CUT_OFF << 8:
            return "it closed files that are not its own"
        return fate(os.waitstatus_to_exitcode(self._status))


class Patience:
    """How long silence is borne.

    activity: a value that changes as long as something happens, None where silence is nothing to worry about.
    limit: how long (s) it may stay the same.
    """

    def __init__(self, activity: Callable[[], Hashable], limit: float) -> None:
        self._activity = activity
        self.limit = limit
        self.renew()

    def renew(self) -> None:
        """Begin anew."""
        self._seen, self._waited, self._looked = self._activity(), 0.0, time.monotonic()

    def exhausted(self) -> bool:
        """Whether there has been silence for too long; to be asked at every GLANCE."""
        now, activity = time.monotonic(), self._activity()
        self._waited += min(now - self._looked, 2 * GLANCE)  # while this process was stopped, others were too
        self._looked = now
        if activity != self._seen or activity is None:
            self._seen, self._waited = activity, 0.0
        return self._waited > self.limit


class Crew:
    """The processes of one run. patience: with those who are waited for."""

    def __init__(self, patience: Patience) -> None:
        self._patience = patience
        self._processes: dict[str, Process] = {}
        self.kill = weakref.finalize(self, _end, self._processes, os.getpid(), 0.0)

    @property
    def at_work(self) -> bool:
        """Whether there are processes."""
        return bool(self._processes)

    def dismiss(self) -> None:
        """Let all processes go; none may be at work."""
        _end(self._processes, os.getpid(), GRACE)

    def hire(self, name: str, commands: Commands) -> None:
        """Fork a process that knows these commands."""
        self._processes[name] = Process(name, commands)

    def tell(self, name: str, command: str, *arguments: Any) -> None:
        """Have a process do something, and do not wait. Raises: Ended."""
        try:
            self._processes[name].connection.send((command, arguments))
        except OSError:
            self._processes[name].listen()

    def do(self, name: str, command: str, *arguments: Any, wanted: Callable[[], bool] = never) -> Any:
        """Have a process do something, and give back what it returns or raises; as of `answer`."""
        self.tell(name, command, *arguments)
        return self.answer(name, wanted)

    def answer(self, name: str, wanted: Callable[[], bool] = never) -> Any:
        """Wait for what a process returns or raises; wanted: whether somebody wants it to return soon.

        Raises: Ended, for whichever process ends; KeyboardInterrupt where what is wanted does not happen. Then all are
        ended.
        """
        try:
            done, value = self._awaited(self._processes[name], wanted)
        except BaseException:
            self.kill()
            raise
        if done:
            return value
        raise value

    def _awaited(self, process: Process, wanted: Callable[[], bool]) -> tuple[bool, Any]:
        from multiprocessing.connection import wait

        since = None
        self._patience.renew()
        while not process.answers:
            wait([p.connection for p in self._processes.values()], GLANCE)
            for each in self._processes.values():
                each.listen()
            if wanted() and not process.answers:
                since = since or time.monotonic()
                if time.monotonic() - since > GRACE:
                    raise KeyboardInterrupt
            if self._patience.exhausted() and not process.answers:
                raise Ended(process.name, f"no answer for {self._patience.limit:g} s", hung=True)
        return process.answers.pop(0)


def _end(processes: dict[str, Process], owner: int, grace: float) -> None:
    """End all processes, of which a forked copy of their owner has none."""
    if os.getpid() == owner:
        for process in processes.values():
            process.end(grace)
        processes.clear()


# ---- in the forked process ----


def _flush() -> None:
    """Leave nothing in buffers that both processes would write."""
    for stream in (sys.stdout, sys.stderr):
        if stream and not stream.closed:
            stream.flush()
    ctypes.CDLL(None).fflush(None)


def _settle(parent: int, mortal: bool) -> None:
    """Become a process of its own: what the parent has on screen and in its pipes is not for it.

    mortal: end with the parent, also in the middle of a call; Linux ends it with the parent's thread.
    """
    interruption.ignore()  # the parent decides
    faulthandler.disable()
    gc.freeze()
    for connection in list(_connections):
        connection.close()
    os.dup2(2, 1)  # standard output is the parent's alone: it may be JSON
    if mortal and sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)


def _obey(parents: Any, connection: Any, commands: Commands) -> NoReturn:
    """Do what comes by the connection, of which the parent has the other end."""
    parents.close()
    while True:
        try:
            name, arguments = connection.recv()
        except (EOFError, OSError):
            _flush()
            os._exit(0)
        answer: tuple[bool, Any]
        try:
            answer = True, commands[name](*arguments)
        except Exception as error:  # noqa: BLE001  # to be raised where it is waited for
            answer = False, error
        try:
            connection.send(answer)
        except OSError:
            os._exit(_CUT_OFF)
