"""The instances of one FMU block in one run: loaded, set up, linked to the loop's frames, and freed.

What happens once is called from here through ctypes; what happens at every step the loop does through
`cosim.fmu.adapter`, whose tables are filled here.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cosim.authoring.foreign import Loop
from cosim.authoring.variables import Parameter
from cosim.errors import CosimError, TooManyInstances, WrongValue
from cosim.fmu import fields, messages
from cosim.fmu.binary import Library
from cosim.fmu.ports import Port
from cosim.fmu.trace import Trace
from cosim.machine.memory import invoke, own, private, words_at

REASONS = {
    fields.NOT_FINITE: "gave a value that is not finite",
    fields.NO_PROGRESS: "returned early from a step without any progress",
    fields.ENDLESS: f"needed more than {fields.MOST_ITERATIONS} event iterations",
    fields.TOO_LARGE: "cannot take an integer of more than 32 bits",
    fields.CROWDED: f"has more than {fields.MOST_EVENTS} time events in one step",
}
# The words of the link that are addresses, and the functions' names in FMI 2 and FMI 3.
_CALLED = {
    fields.EXIT_INITIALIZATION: ("ExitInitializationMode", "ExitInitializationMode"),
    fields.SET_TIME: ("SetTime", "SetTime"),
    fields.SET_STATES: ("SetContinuousStates", "SetContinuousStates"),
    fields.GET_STATES: ("GetContinuousStates", "GetContinuousStates"),
    fields.GET_DERIVATIVES: ("GetDerivatives", "GetContinuousStateDerivatives"),
    fields.GET_INDICATORS: ("GetEventIndicators", "GetEventIndicators"),
    fields.ENTER_EVENT_MODE: ("EnterEventMode", "EnterEventMode"),
    fields.UPDATE_DISCRETE_STATES: ("NewDiscreteStates", "UpdateDiscreteStates"),
    fields.DO_STEP: ("DoStep", "DoStep"),
}
_running: Counter[str] = Counter()
_lock = threading.Lock()


class _Callbacks2(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(n, ctypes.c_void_p) for n in ("logger", "allocate", "free", "step_finished", "environment")]


class Instances:
    """Instances of an FMU block in one run; a `cosim.authoring.foreign.Part` of the engine's process.

    Making this calls nothing of the FMU, so that the process which does can be watched from here: see `trace`.

    fmu: a `cosim.fmu.importer.Fmu`. component, calls: its block in the network and its rows in the table. arena: of
    this run. loop: how it steps. wanted: the locals that somebody looks at. zeros: gives the memory of the trace.
    members: which of the component's instances, from 0.
    """

    process = ""

    def __init__(
        self,
        fmu: Any,
        component: Any,
        calls: Sequence[Any],
        arena: np.ndarray,
        loop: Loop,
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
        self.trace = Trace(fmu, component, self.members, zeros)
        self.link = self.trace.link
        self.handles: list[int] = []
        self.lost: dict[int, int] = {}  # instances that failed, with their status
        self._claimed = 0
        self._keep: list[Any] = []
        self._rows: dict[int, str] = {}
        self._shadows: dict[str, np.ndarray] = {}
        messages.logger(fmu.version)  # loaded here, so that a process made later finds it

    def open(self) -> None:
        """Make the instances, up to Initialization Mode.

        Raises: FmuError, TooManyInstances, FmuFailed, WrongValue.
        """
        self.library = Library(self.fmu, self.trace, self.component.entry.type.position)
        self._alone = own()
        self.link[fields.ALONE] = self._alone.ctypes.data
        self.link[fields.LEAVE] = _c_function("_exit")
        self._claim()
        try:
            for k in range(len(self.members)):
                self._instantiate(k)
            for k in range(len(self.members)):
                self._set_up(k)
            self._link()
            for call, frame in zip(self.calls, self.frames(), strict=True):
                words_at(frame, fields.FIRST)[fields.LINK :] = self.link.ctypes.data, self._plan(call)
        except BaseException:
            self.close(terminate=False)
            raise

    def frames(self) -> list[int]:
        """The addresses of the calls' frames."""
        return [self.arena.ctypes.data + call.frame for call in self.calls]

    # ---- setting up ----

    def _claim(self) -> None:
        """Count what runs in this process, where an FMU cares."""
        path = str(self.library.path)
        with _lock:
            if self.fmu.interface.canBeInstantiatedOnlyOncePerProcess and _running[path]:
                message = (
                    f"block {self.component.name}: `{self.fmu.name}` can have one instance in a process, and has one"
                )
                raise TooManyInstances(message, self.component.entry.type.position, "write `isolate: true`")
            self._claimed = len(self.members)
            _running[path] += self._claimed

    def _instantiate(self, k: int) -> None:
        fmu, interface = self.fmu, self.fmu.interface
        name = f"{self.component.name}_{self.members[k] + 1}" if self.component.fleet else self.component.name
        resources = fmu.folder / "resources"
        resources.mkdir(exist_ok=True)
        logging, categories = _categories(fmu.description)
        token = (fmu.description.guid or "").encode()
        environment, log = self.trace.messages[k].environment, messages.logger(fmu.version)
        pointer, text, flag = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_bool
        if fmu.version == 2:
            calloc, free = _c_function("calloc"), _c_function("free")
            callbacks = _Callbacks2(log, calloc, free, None, environment)
            self._keep.append(callbacks)
            kind = int(fmu.kind != fields.MODEL_EXCHANGE)
            make = ctypes.CFUNCTYPE(pointer, text, ctypes.c_int, text, text, pointer, ctypes.c_int, ctypes.c_int)
            where = resources.resolve().as_uri().encode()
            arguments: tuple[Any, ...] = (name.encode(), kind, token, where, ctypes.addressof(callbacks), 0, logging)
            function = "Instantiate"
        else:
            where = (str(resources.resolve()) + os.sep).encode()
            first = (name.encode(), token, where, False, bool(logging))
            if fmu.kind == fields.MODEL_EXCHANGE:
                make = ctypes.CFUNCTYPE(pointer, text, text, text, flag, flag, pointer, pointer)
                function, arguments = "InstantiateModelExchange", (*first, environment, log)
            else:
                size = ctypes.c_size_t
                kinds = (text, text, text, flag, flag, flag, flag, pointer, size, pointer, pointer, pointer)
                make = ctypes.CFUNCTYPE(pointer, *kinds)
                eventful = fmu.kind == fields.EVENT_CO_SIMULATION
                early = eventful and bool(interface.mightReturnEarlyFromDoStep)
                function = "InstantiateCoSimulation"
                arguments = (*first, eventful, early, None, 0, environment, log, None)
        address = self.library.address(function)
        with self.trace.calling(k, address):
            handle = make(address)(*arguments)
        if not handle:
            raise self.trace.failure(f"{self.library.prefix}Instantiate() gave no instance", k, 0.0)
        self.handles.append(handle)
        if categories:
            names = (ctypes.c_char_p * len(categories))(*[c.encode() for c in categories])
            self._do(k, "SetDebugLogging", 1, len(categories), ctypes.addressof(names))

    def _set_up(self, k: int) -> None:
        """Parameters and start values, then Initialization Mode."""
        if self.fmu.version == 2:
            self._do(k, "SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        for name, port in self.fmu.ports.items():
            if name in self.component.values and self._is_given(name, port):
                values = self.component.values[name]
                self._set(k, name, port, values[self.members[k] if len(values) > 1 else 0])
        if self.fmu.version == 2:
            self._do(k, "EnterInitializationMode")
        else:
            self._do(k, "EnterInitializationMode", 0, 0.0, 0.0, 0, 0.0)

    def _is_given(self, name: str, port: Port) -> bool:
        """Whether a value has to be set, because it is not the FMU's own. Raises: WrongValue."""
        if port.causality == "input":
            return False  # set with the other inputs
        variable = self.component.declaration.variables[name]
        if isinstance(variable, Parameter):
            own = port.start()
            return (
                name in self.component.given
                or own is None
                or bool(np.any(self.component.values[name] != np.array(own)))
            )
        if name in self.component.given and not port.can_start:
            message = f"block {self.component.name}: `{self.fmu.name}` calculates `{name}`, which has no start value"
            raise WrongValue(message, self.component.entry.start[name].position, "remove this start value")
        return name in self.component.given

    def _set(self, k: int, name: str, port: Port, value: np.ndarray) -> None:
        references = np.array(port.references, np.uint32)
        if port.is_string:
            data: Any = (ctypes.c_char_p * 1)(str(value).encode())
            address = ctypes.addressof(data)
        else:
            narrow = port.code in (fields.INTEGER32, fields.BOOLEAN32)
            data = np.ascontiguousarray(value, np.int32 if narrow else port.dtype)
            address = data.ctypes.data
        size = (port.size,) if self.fmu.version == 3 else ()
        self._do(k, f"Set{port.accessor}", references.ctypes.data, len(references), address, *size, about=name)

    def _do(self, k: int, name: str, *arguments: int | float, about: str = "") -> None:
        """Call a function of instance k. Raises: FmuFailed."""
        status = self._invoke(k, name, *arguments)
        if status == fields.WARNING:
            self.link[fields.WARNINGS] += 1
            self.link[fields.WARNED] = self.link[fields.WARNED] or k + 1
        elif status != fields.OK:
            self.lost[k] = status
            on = f" for `{about}`" if about else ""
            raise self.trace.failure(f"{self.library.prefix}{name}(){on} returned {_status(status)}", k, 0.0)

    def _invoke(self, k: int, name: str, *arguments: int | float) -> int:
        """Call a function of instance k. Returns its status."""
        address = self.library.address(name)
        with self.trace.calling(k, address):
            return invoke(address, (self.handles[k], *arguments))

    # ---- linking ----

    def _array(self, *shape: int) -> np.ndarray:
        """Zeroed words that live as long as the instances."""
        self._keep.append(np.zeros(shape, np.int64))
        return self._keep[-1]

    def _link(self) -> None:
        """Fill what all calls share, and a record for each instance."""
        fmu, count = self.fmu, len(self.members)
        indicators = fmu.description.numberOfEventIndicators if fmu.kind == fields.MODEL_EXCHANGE else 0
        old, states = self._array(count, max(1, indicators)), max(1, len(fmu.states))
        ends, slopes = self._array(count, states), self._array(count, states)
        records = self._array(count, fields.RECORD_WORDS)
        records[:, fields.HANDLE] = np.array(self.handles, np.uint64).view(np.int64)
        for word, rows in ((fields.INDICATOR_VALUES, old), (fields.END_STATES, ends), (fields.SLOPES, slopes)):
            records[:, word] = [row.ctypes.data for row in rows]
        link = self.link
        link[fields.VERSION], link[fields.KIND] = fmu.version, fmu.kind
        link[fields.RECORDS] = records.ctypes.data
        link[fields.STATES], link[fields.INDICATORS] = len(fmu.states), indicators
        link[fields.BUFFER] = self._array(states).ctypes.data
        link[fields.SIGNS] = self._array(max(1, indicators)).ctypes.data
        link[fields.WORK] = self._array(2 * states).ctypes.data
        link[fields.STAGES], link[fields.JOINT] = self.loop.stages, self.loop.joint
        link[fields.ENDING], link[fields.AGAIN] = self.loop.ending, self.loop.again
        link.view(np.float64)[[fields.STEP, fields.INNER_STEP]] = self.loop.step, self.loop.inner_step
        for word, names in _CALLED.items():
            if word in _needed(fmu):
                link[word] = self.library.address(names[fmu.version - 2])
        if fmu.kind == fields.MODEL_EXCHANGE:
            link[fields.LEAVE_EVENT_MODE] = self.library.address("EnterContinuousTimeMode")
            if fmu.interface.needsCompletedIntegratorStep:
                link[fields.COMPLETED_STEP] = self.library.address("CompletedIntegratorStep")
        elif fmu.kind == fields.EVENT_CO_SIMULATION:
            link[fields.LEAVE_EVENT_MODE] = self.library.address("EnterStepMode")
        elif fmu.version == 2:
            for word, name in ((fields.BOOLEAN_STATUS, "GetBooleanStatus"), (fields.REAL_STATUS, "GetRealStatus")):
                link[word] = self.library.find(name)

    def _plan(self, call: Any) -> int:
        """The address of the table of what a call exchanges."""
        function = call.function
        slots, slot = {}, fields.FIRST
        for name in function.arguments:
            if name != "time":
                slots[name] = slot
                slot += 2
        inputs = [n for n in function.reads if n in self.fmu.ports and self.fmu.ports[n].causality == "input"]
        states = {name for name, _ in self.fmu.states}
        outputs = [n for n in function.arguments if n in function.writes and n in self.fmu.ports]
        if function.kind in ("begin", "events", "settle"):
            outputs = []
        if function.name == "outputs_locals":
            outputs = [n for n in outputs if n in self.wanted]
        plan = self._array(fields.PLAN_WORDS)
        plan[fields.FRAME_WORDS], plan[fields.TASK] = slot, _task(function.kind, self.fmu.kind)
        plan[fields.N_INPUTS], plan[fields.N_OUTPUTS] = len(inputs), len(outputs)
        plan[fields.INPUTS] = self._row_table(inputs, slots, "Set")
        plan[fields.OUTPUTS] = self._row_table(outputs, slots, "Get")
        if states and states <= slots.keys():
            plan[fields.STATE_MAP] = self._map(slots, "")
        if function.kind == "derivatives":
            plan[fields.DERIVATIVE_MAP] = self._map(slots, "d_")
        every = {n for f in self.component.declaration.kind("outputs") for n in f.reads if n in self.fmu.ports}
        plan[fields.SETTLES] = function.kind == "outputs" and every <= {*inputs, *states}
        return plan.ctypes.data

    def _map(self, slots: dict[str, int], prefix: str) -> int:
        places = self._array(len(self.fmu.states), 2)
        places[:] = [(slots[prefix + name], element) for name, element in self.fmu.states]
        return places.ctypes.data

    def _row_table(self, names: list[str], slots: dict[str, int], access: str) -> int:
        rows = self._array(max(1, len(names)), fields.ROW_WORDS)
        for name, row in zip(names, rows, strict=False):
            port = self.fmu.ports[name]
            references = np.array(port.references, np.uint32)
            self._keep.append(references)
            row[fields.FUNCTION] = self.library.address(access + port.accessor)
            row[fields.REFERENCES], row[fields.N_REFERENCES] = references.ctypes.data, len(references)
            dtype = self.component.declaration.variables[name].dtype
            row[fields.N_VALUES], row[fields.SLOT], row[fields.CODE] = port.size, slots[name], port.code
            if port.code == fields.INTEGER32 and dtype.itemsize == 4:
                row[fields.CODE] = fields.PLAIN
            row[fields.BYTES] = port.size * dtype.itemsize
            row[fields.STAGING] = self._array(port.size).ctypes.data
            if access == "Set" and port.is_discrete and self.fmu.kind == fields.MODEL_EXCHANGE:
                row[fields.SHADOW] = self._shadow(name, int(row[fields.BYTES]))
            self._rows[row.ctypes.data] = name
        return rows.ctypes.data

    def _shadow(self, name: str, size: int) -> int:
        """Where the value of a discrete input is kept that the FMU has now; one for all calls."""
        if name not in self._shadows:
            self._shadows[name] = self._array(-(-len(self.members) * size // 8))
        return self._shadows[name].ctypes.data

    @property
    def busy(self) -> bool:
        """Whether the loop waits for these instances, if it waits for the block."""
        return True

    # ---- failing and closing ----

    def failure(self, time: float) -> CosimError:
        """What stopped the loop in one of the calls, as of the link."""
        k, status, failed = (int(self.link[w]) for w in (fields.INSTANCE, fields.STATUS, fields.FAILED))
        name = self._rows.get(int(self.link[fields.ROW]), "")
        if failed == fields.TERMINATED:
            return self.trace.termination(k)
        if failed in REASONS:
            return self.trace.failure(f"it {REASONS[failed]}" + (f": `{name}`" if name else ""), k, time)
        self.lost[k] = status
        on = f" for `{name}`" if name else ""
        function = self.trace.name_of(failed) or "a function"
        return self.trace.failure(f"{function}(){on} returned {_status(status)}{self._last_time(k, function)}", k, time)

    def _last_time(self, k: int, function: str) -> str:
        """How far an FMI 2 step got that was discarded."""
        if function != "fmi2DoStep" or self.lost[k] != fields.DISCARD:
            return ""
        last = ctypes.c_double()
        if not self.link[fields.REAL_STATUS]:
            return ""
        status = self._invoke(k, "GetRealStatus", 2, ctypes.addressof(last))
        return f", it got as far as t = {last.value:g} s" if status == fields.OK else ""

    def close(self, terminate: bool) -> None:
        """Terminate (if they were initialized) and free all instances, as far as their state allows."""
        if self._claimed:
            with _lock:
                _running[str(self.library.path)] -= self._claimed
            self._claimed = 0
        if fields.FATAL in self.lost.values():
            self.handles = []
            return  # nothing may be called any more
        for k, handle in enumerate(self.handles):
            if terminate and self.lost.get(k, fields.OK) <= fields.DISCARD:
                self._invoke(k, "Terminate")
            address = self.library.address("FreeInstance")
            with self.trace.calling(k, address):
                ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)(handle)
        self.handles = []


def _c_function(name: str) -> int:
    """The address of a function of the C library."""
    library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0


def _task(kind: str, fmu_kind: int) -> int:
    """What the adapter has to do in a function of a kind."""
    if kind == "outputs":
        return (fields.GET, fields.EXCHANGE, fields.EVALUATE)[fmu_kind]
    return {
        "start": fields.INITIAL,
        "initial": fields.INITIAL,
        "begin": fields.BEGIN,
        "step": fields.ADVANCE,
        "derivatives": fields.DIFFERENTIATE,
        "events": fields.BEGIN_EVENTS,
        "settle": fields.END_EVENTS,
    }[kind]


def _needed(fmu: Any) -> set[int]:
    """The functions that the adapter calls for a kind of FMU."""
    if fmu.kind == fields.CO_SIMULATION:
        return {fields.EXIT_INITIALIZATION, fields.DO_STEP}
    events = {fields.EXIT_INITIALIZATION, fields.ENTER_EVENT_MODE, fields.UPDATE_DISCRETE_STATES}
    return events | {fields.DO_STEP} if fmu.kind == fields.EVENT_CO_SIMULATION else set(_CALLED) - {fields.DO_STEP}


def _status(status: int) -> str:
    names = messages.STATUS
    return f"`{names[status]}`" if 0 <= status < len(names) else f"the unknown status {status}"


def _categories(description: Any) -> tuple[int, list[str]]:
    """Whether to switch logging on, and for which categories: those of what goes wrong, where others would be noise."""
    names = [c.name for c in description.logCategories if c.name]
    telling = [n for n in names if any(w in n.lower() for w in ("error", "fatal", "warning", "discard"))]
    noisy = set(names) - set(telling) - {"logAll"}
    return int(bool(telling) or not names), telling if noisy else []
