"""The instances of one FMU block in one run: loaded, set up, linked to the loop's frames, and freed.

What happens once is called through ctypes, see `cosim.fmu.handles`; what happens at every step the loop does through
`cosim.fmu.adapter`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cosim.authoring.foreign import LoopWords
from cosim.errors import CosimError, TooManyInstances
from cosim.fmu import claims, event_mode, fields, messages, saved_states
from cosim.fmu.adapter_tables import AdapterTables
from cosim.fmu.binary import Binary
from cosim.fmu.handles import Handles, listed, returned
from cosim.fmu.initialization import Initialization
from cosim.fmu.trace import FmuTrace
from cosim.machine.memory import private, words_at

REASONS = {
    fields.NOT_FINITE: "gave a value that is not finite",
    fields.NO_PROGRESS: "returned early from a step without any progress",
    fields.ENDLESS: f"needed more than {fields.MOST_ITERATIONS} event iterations",
    fields.TOO_LARGE: "cannot take an integer of more than 32 bits",
    fields.CROWDED: f"has more than {fields.MOST_EVENTS} time events at one time",
}


class Instances:
    """Instances of an FMU block in one run; a `cosim.authoring.foreign.Part` of the engine's process.

    Making this calls nothing of the FMU, so that the process which does can be watched from here: see `trace`.

    fmu: a `cosim.fmu.imported.Fmu`. component, calls: its block in the network and its calls in the program. arena: of
    this run. loop: how it steps. wanted: what somebody looks at. zeros: gives the memory of the trace.
    members: which of the component's instances, from 0.
    """

    process = ""

    def __init__(
        self,
        fmu: Any,
        component: Any,
        calls: Sequence[Any],
        arena: np.ndarray,
        loop: LoopWords,
        wanted: set[str],
        zeros: Callable[[int], np.ndarray] = private,
        members: range | None = None,
    ) -> None:
        self.fmu = fmu
        self.component = component
        self.calls = calls
        self.arena = arena
        self.loop = loop
        self.wanted = wanted
        self.members = range(component.count) if members is None else members
        self.trace = FmuTrace(fmu, component, self.members, zeros)
        self._is_open = False
        messages.logger(fmu.version.number)  # loaded here, so that a process made later finds it

    def open(self) -> None:
        """Make the instances, up to Initialization Mode.

        Raises: FmuError, TooManyInstances, FmuFailed, WrongValue.
        """
        self._binary = Binary(self.fmu, self.trace, self.component.entry.type.position)
        self._claim()
        self._handles = Handles(self._binary, self.trace)
        self._is_open = True
        try:
            first = Initialization(self.fmu, self.component, self.members, self.trace, self._handles)
            for k in range(len(self.members)):
                first.instantiate(k)
            for k in range(len(self.members)):
                first.enter(k)
            self._tables = AdapterTables(self.fmu, self.component, self._handles.made, self.wanted, self._binary)
            self._tables.link(self.trace.link, self.loop)
            for call, frame in zip(self.calls, self.frames(), strict=True):
                link, plan = self.trace.link.ctypes.data, self._tables.plan(call)
                words_at(frame, fields.FIRST)[fields.LINK :] = link, plan
            self._tables.finish(self.trace.link)
        except BaseException:
            self.close(terminate=False)
            raise

    def frames(self) -> list[int]:
        """The addresses of the calls' frames."""
        return [self.arena.ctypes.data + call.frame for call in self.calls]

    @property
    def busy(self) -> bool:
        """Whether the loop waits for these instances, if it waits for the block."""
        return True

    def _claim(self) -> None:
        """Raises: TooManyInstances."""
        once = self.fmu.interface.canBeInstantiatedOnlyOncePerProcess
        if not claims.claim(self._binary.path, len(self.members), alone=once):
            message = f"block {self.component.name}: `{self.fmu.name}` can have one instance in a process, and has one"
            raise TooManyInstances(message, self.component.entry.type.position, "write `isolate: true`")

    def failure(self, time: float) -> CosimError:
        """What stopped the loop in one of the calls, as of the link."""
        link = self.trace.link
        k, status, failed = (int(link[w]) for w in (fields.INSTANCE, fields.STATUS, fields.FAILED))
        about = listed(self._tables.variables(int(link[fields.ROW])))
        if failed == fields.TERMINATED:
            return self.trace.termination(k)
        if failed in REASONS:
            return self.trace.failure(f"it {REASONS[failed]}" + (f": {about}" if about else ""), k, time)
        self._handles.lost[k] = status
        function = self.trace.name_of(failed) or "a function"
        return self.trace.failure(returned(function, about, status) + self._last_time(k, failed), k, time)

    def _last_time(self, k: int, failed: int) -> str:
        """How far a step got that was discarded, where the FMU has a function that tells."""
        link, lost = self.trace.link, self._handles.lost
        if failed != link[fields.DO_STEP] or lost[k] != fields.DISCARD or not link[fields.REAL_STATUS]:
            return ""
        function = self.fmu.version.optional[self.fmu.kind][fields.REAL_STATUS]
        last = ctypes.c_double()
        status = self._handles.ask(k, function, fields.LAST_TIME_STATUS, ctypes.addressof(last))
        return f", it got as far as t = {last.value - self.fmu.settings.start_time:g} s" if status == fields.OK else ""

    def save(self, time: float) -> dict[str, Any]:
        """All that the instances, and we of them, know at a communication point. Raises: FmuError, FmuFailed."""
        for name in self.fmu.version.saving:
            self._binary.address(name)  # what restores is missed now, or too late
        told, known = self.trace.state(), self._tables.state()
        saved = [saved_states.save(self.fmu, self._handles, self.trace, k, time) for k in range(len(self.members))]
        return {"trace": told, "tables": known, "instances": saved}

    def restore(self, state: Mapping[str, Any], time: float) -> None:
        """Have new instances, which are initialized, go on from there. Raises: FmuError, FmuFailed, ValueError."""
        for k, saved in enumerate(state["instances"]):
            if state["tables"]["records"][k, fields.MODE] != fields.EVENT:
                self._leave_event_mode(k, time)
            saved_states.restore(self.fmu, self._handles, self.trace, k, saved, time)
        self._tables.restore(state["tables"])
        self.trace.restore(state["trace"])

    def _leave_event_mode(self, k: int, time: float) -> None:
        """Bring a new instance out of the Event Mode in which initialization may end. Raises: FmuFailed."""
        record, link = self._tables.records[k], self.trace.link
        info = record.ctypes.data + 8 * fields.INFO
        if record[fields.MODE] == fields.EVENT:
            link[fields.INSTANCE] = k
            if event_mode.settle(link, record, info) or event_mode.leave_event_mode(link, record):
                raise self.failure(time)

    def close(self, terminate: bool) -> None:
        """Terminate (if they were initialized) and free all instances, as far as their state allows."""
        if self._is_open:
            self._is_open = False
            claims.give_back(self._binary.path, len(self.members))
            self._handles.free(terminate)


def parts(fmu: Any, *arguments: Any) -> list[Instances]:
    """All instances of a block, in the engine's process."""
    return [Instances(fmu, *arguments)]
