"""Where the loop and the foreign blocks of one run live: in this process, or in forked ones that it survives.

=====================  =========================================================================
this process           all of it, where nothing is foreign, or where there is no fork; compiled, the loop has a
                       thread of its own there
the engine's process   the loop, and foreign blocks that are called by address
servers                isolated foreign blocks, which the loop calls through shared memory
=====================  =========================================================================

All memory of a run that has forked processes is shared, so that after a crash it tells what was being done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from cosim.authoring.foreign import Part
from cosim.engine.program import Program
from cosim.engine.writer import Call
from cosim.errors import BlockFailed, CosimError
from cosim.machine.supervision import Crew, Ended, Patience, never
from cosim.machine.worker import Abandoned, worker_of_this_thread
from cosim.master import tables

ENGINE = "engine"

#: The instances of each foreign block.
Parts = Mapping[str, Sequence[Part]]
#: What the loop can be told to do; each returns a status.
LoopCommands = Mapping[str, Callable[[], int]]


class Here:
    """All in this process. keep: what compiled code touches; None where all is interpreted, in the caller's thread."""

    def __init__(
        self, parts: Parts, loop: LoopCommands, watch: Watch, patience: float, keep: Sequence[Any] | None
    ) -> None:
        """patience: how long (s) a compiled function may take."""
        self._parts = parts
        self._loop = loop
        self._watch = watch
        self._patience = Patience(watch.activity, patience)
        self._keep = keep
        self._abandoned = False
        self._opened: list[Part] = []

    def open(self) -> None:
        """Make all instances of foreign blocks. Raises: CosimError."""
        for part in _all(self._parts):
            part.open()
            self._opened.append(part)

    def run(self, command: str, wanted: Callable[[], bool] = never) -> int:
        """Have the loop do something; wanted: whether somebody wants it to return soon. Returns the status.

        Raises: BlockFailed for a function that does not return; KeyboardInterrupt for one that is wanted to.
        """
        if self._keep is None:
            return self._loop[command]()
        self._patience.renew()
        worker = worker_of_this_thread()
        try:
            return worker.do(self._loop[command], self._patience, self._watch.stop, wanted, self._keep)
        except Abandoned:
            how = f"no sign of life for {self._patience.limit:g} s"
            raise self._watch.silent(how) from None
        finally:
            self._abandoned |= worker.abandoned

    def failure(self, component: str, time: float) -> CosimError:
        """Why a call of a foreign block failed at a time (s)."""
        return _failed(self._parts[component]).failure(time)

    def save(self, time: float) -> list[Any]:
        """All that the instances of foreign blocks know at a communication point (s). Raises: CosimError."""
        return [part.save(time) for part in _all(self._parts)]

    def restore(self, states: Sequence[Any], time: float) -> None:
        """Have them go on from there. Raises: CosimError, KeyError or ValueError where it does not fit."""
        for part, state in zip(_all(self._parts), states, strict=True):
            part.restore(state, time)

    def close(self, terminate: bool) -> None:
        """End all instances; terminate: they were initialized."""
        if self._abandoned:
            return  # whatever is called may still be in use
        while self._opened:
            self._opened.pop().close(terminate)


class Forked:
    """The loop in a process of its own, and each isolated part in another; the same methods as `Here`.

    All raise the error that says whose call was under way when a process died or fell silent.
    """

    def __init__(self, parts: Parts, loop: LoopCommands, watch: Watch, patience: float) -> None:
        """patience: how long (s) a foreign call may take."""
        self._parts = parts
        self._index = {id(part): k for k, part in enumerate(_all(parts))}
        self._watch = watch
        self._serving: list[Part] = []
        self._crew = Crew(Patience(watch.activity, patience))
        known = list(_all(parts))

        def ask(k: int, method: str, *arguments: Any) -> Any:
            return getattr(known[k], method)(*arguments)

        for part in known:
            if part.process:
                self._crew.hire(part.process, {"part": ask})
        self._crew.hire(ENGINE, {"part": ask, **loop})

    def open(self) -> None:
        """As of `Here`."""
        for part in _all(self._parts):
            self._ask(part, "open")
            self._serve(part)

    def run(self, command: str, wanted: Callable[[], bool] = never) -> int:
        """As of `Here`."""

        def stopping() -> bool:
            if wanted():
                self._watch.stop()
                return True
            return False

        with self._watch.blaming():
            status: int = self._crew.do(ENGINE, command, wanted=stopping)
        return status

    def failure(self, component: str, time: float) -> CosimError:
        """As of `Here`."""
        error: CosimError = self._ask(_failed(self._parts[component]), "failure", time)
        return error

    def save(self, time: float) -> list[Any]:
        """As of `Here`."""
        states = []
        for part in _all(self._parts):
            states.append(self._ask(part, "save", time))
            self._serve(part)
        return states

    def restore(self, states: Sequence[Any], time: float) -> None:
        """As of `Here`."""
        for part, state in zip(_all(self._parts), states, strict=True):
            self._ask(part, "restore", state, time)
            self._serve(part)

    def close(self, terminate: bool) -> None:
        """As of `Here`, if the processes still live."""
        if self._crew.at_work:
            for part in _all(self._parts):
                self._ask(part, "close", terminate)
            self._crew.dismiss()

    def _serve(self, part: Part) -> None:
        """Have a part that has a process of its own do what the loop asks for."""
        if part.process:
            self._crew.tell(part.process, "part", self._index[id(part)], "serve")
            self._serving.append(part)

    def _ask(self, part: Part, method: str, *arguments: Any) -> Any:
        """Have a part do something in its process, which then serves no longer."""
        with self._watch.blaming(part):
            if part in self._serving:
                self._serving.remove(part)
                part.stop()
                self._crew.answer(part.process)
            return self._crew.do(part.process or ENGINE, "part", self._index[id(part)], method, *arguments)


class Watch:
    """Tells from shared memory what a run is doing, and whose fault its end is."""

    def __init__(self, program: Program, control: np.ndarray, parts: Parts) -> None:
        self._program = program
        self._control = control
        self._parts = parts
        self._asked: Part | None = None  # the part that is opened, asked or closed; else the loop is at work

    def activity(self) -> tuple[int | None, ...] | None:
        """What changes as long as something is done; None where silence is nothing to worry about.

        That is while plain Python is at work, where somebody may debug, and while a part does something of ours.
        """
        calls = [part.trace.activity for part in _all(self._parts)]
        if self._asked is not None and all(call is None for call in calls):
            return None
        component = self._program.network.components[self._call().component] if self._program.calls else None
        if self._asked is None and component and not (component.declaration.compiled or component.declaration.foreign):
            return None
        done = (int(self._control[word]) for word in (tables.TICK, tables.ALIVE, tables.AT))
        return *done, *calls

    def stop(self) -> None:
        """Ask the loop to return before its next step."""
        self._control[tables.STOP] = 1

    @contextmanager
    def blaming(self, part: Part | None = None) -> Iterator[None]:
        """Inside, a part, else the loop, is at work. Raises: CosimError that names who ended a process."""
        self._asked = part
        try:
            yield
        except Ended as end:
            raise self._error(end) from None
        finally:
            self._asked = None

    def _error(self, end: Ended) -> CosimError:
        time = self._program.time(int(self._control[tables.TICK]))
        part = next((p for p in _all(self._parts) if p.process == end.name), self._asked)
        call = self._call()
        if part is None and call.component in self._parts:
            candidates = self._parts[call.component]
            if end.hung:
                part = next((p for p in candidates if p.busy), None)
            else:
                part = next((p for p in candidates if not p.process), None)
        if part is not None:
            return part.trace.ended(end.how, end.hung, time)
        if end.hung:
            return self.silent(end.how)
        component = self._program.network.components[call.component]
        message = f"block {component.name}: {end.how} in {call.function.name}() at t = {time:g} s"
        inside = sorted({p for p, parts in self._parts.items() if not all(part.process for part in parts)})
        fix = f"to see whether {', '.join(inside)} did it, write `isolate: true` there" if inside else ""
        return BlockFailed(message, component.entry.position, fix)

    def silent(self, how: str) -> CosimError:
        """The error for a native function that does not return."""
        time = self._program.time(int(self._control[tables.TICK]))
        call = self._call()
        place = self._program.network.components[call.component].entry.position
        message = f"block {call.component}: {how} in {call.function.name}() at t = {time:g} s"
        fix = "look for a loop that never ends; `run.patience` (s) says how long a call may take"
        return BlockFailed(message, place, fix)

    def _call(self) -> Call:
        """The call that is being done, or was last; where something else is done, the next one."""
        rows, at = self._program.rows, int(self._control[tables.AT])
        rows = rows[at:] if 0 <= at < len(rows) else rows
        calls = rows[rows[:, tables.KIND] == tables.CALL, tables.A]
        return self._program.calls[int(calls[0]) if len(calls) else 0]


def _all(parts: Parts) -> Iterator[Part]:
    return (part for several in parts.values() for part in several)


def _failed(parts: Sequence[Part]) -> Part:
    return next((part for part in parts if part.trace.failed), parts[0])
