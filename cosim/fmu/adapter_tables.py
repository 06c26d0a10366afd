"""The tables of `cosim.fmu.fields` that the adapter walks for the instances of a block, filled for one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.authoring.foreign import LoopWords
from cosim.compiling.frame import frame_of
from cosim.fmu import c_library, fields
from cosim.fmu.binary import Binary
from cosim.fmu.curve_table import CurveTable
from cosim.fmu.tangent_table import TangentTable
from cosim.machine.memory import own

_TASKS = {
    "start": fields.INITIAL,
    "initial": fields.INITIAL,
    "begin": fields.BEGIN,
    "step": fields.ADVANCE,
    "derivatives": fields.DIFFERENTIATE,
    "events": fields.BEGIN_EVENTS,
    "settle": fields.END_EVENTS,
    "save": fields.KEEP_STATE,
    "restore": fields.GO_BACK,
    "indicators": fields.INDICATE,
    "times": fields.TELL,
}
_OUTPUT_TASKS = {
    fields.CO_SIMULATION: fields.GET,
    fields.EVENT_CO_SIMULATION: fields.EXCHANGE,
    fields.MODEL_EXCHANGE: fields.EVALUATE,
}


class AdapterTables:
    """Tables that live as long as this.

    fmu: a `cosim.fmu.imported.Fmu`. component: its block in the network. handles: its instances' addresses. wanted:
    what somebody looks at.
    """

    def __init__(self, fmu: Any, component: Any, handles: list[int], wanted: set[str], binary: Binary) -> None:
        self._fmu = fmu
        self._component = component
        self._handles = handles
        self._wanted = wanted
        self._binary = binary
        self._keep: list[Any] = []
        self._rows: dict[int, list[str]] = {}
        self._shadows: dict[str, np.ndarray] = {}
        self._gives_derivatives = False
        self._histories: Mapping[str, int] = {}
        self._kept: dict[str, np.ndarray] = {}  # what belongs to a state that is kept, by a name of ours

    def _array(self, *shape: int) -> np.ndarray:
        """Zeroed words."""
        array = np.zeros(shape, np.int64)
        self._keep.append(array)
        return array

    # ---- what all calls share ----

    def link(self, link: np.ndarray, loop: LoopWords) -> None:
        """Fill the link, with a record for each instance. loop: how it steps. Raises: FmuError."""
        fmu = self._fmu
        states, signs = max(1, len(fmu.states)), max(1, fmu.indicators)
        self._keep.append(own())
        link[fields.ALONE] = self._keep[-1].ctypes.data
        link[fields.LEAVE] = c_library.address("_exit")
        link[fields.VERSION], link[fields.KIND] = fmu.version.number, fmu.kind
        link[fields.RECORDS] = self._records(signs)
        link[fields.STATES], link[fields.INDICATORS] = len(fmu.states), fmu.indicators
        link[fields.BUFFER] = self._array(states).ctypes.data
        link[fields.SIGNS] = self._array(signs).ctypes.data
        link[fields.STEP] = loop.step
        link[fields.ENDING], link[fields.AGAIN] = loop.ending, loop.again
        link[fields.NEXT_EVENT], link[fields.EARLY], link[fields.LEFT] = loop.next_event, loop.early, loop.left
        link[fields.TANGENT] = loop.tangent
        link.view(np.float64)[fields.START_TIME] = fmu.settings.start_time
        self._histories = loop.histories
        self._functions(link)
        self._gives_derivatives = bool(link[fields.DIRECTIONAL_DERIVATIVE])
        link[fields.SNAPSHOTS] = self._array(len(self._handles)).ctypes.data
        self._kept["ended"] = link[fields.ENDED : fields.ENDED + 1]

    def _records(self, signs: int) -> int:
        count = len(self._handles)
        records = self._kept["records"] = self._array(count, fields.RECORD_WORDS)
        records[:, fields.HANDLE] = np.array(self._handles, np.uint64).view(np.int64)
        several = self._kept["signs"] = self._array(count, signs)
        records[:, fields.INDICATOR_VALUES] = [row.ctypes.data for row in several]
        self._addresses = records != 0
        return records.ctypes.data

    def _functions(self, link: np.ndarray) -> None:
        fmu = self._fmu
        for word, name in fmu.version.functions[fmu.kind].items():
            link[word] = self._binary.address(name)
        if fmu.kind == fields.MODEL_EXCHANGE and fmu.interface.needsCompletedIntegratorStep:
            link[fields.COMPLETED_STEP] = self._binary.address("CompletedIntegratorStep")
        for word, name in fmu.version.optional[fmu.kind].items():
            link[word] = self._binary.find(name)

    # ---- what the adapter remembers from call to call ----

    @property
    def records(self) -> np.ndarray:
        """The record of each instance."""
        return self._kept["records"]

    def state(self) -> dict[str, np.ndarray]:
        """What the adapter knows of the instances, apart from addresses."""
        kept = {name: array.copy() for name, array in self._kept.items()}
        kept["records"][self._addresses] = 0
        return kept

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a state of another run's. Raises: KeyError, ValueError where it does not fit."""
        own = self.records[self._addresses]
        for name, array in self._kept.items():
            array[...] = state[name]
        self.records[self._addresses] = own

    # ---- what one call exchanges ----

    def plan(self, call: Any) -> int:
        """The address of the table of what a call exchanges. Raises: FmuError."""
        function = call.function
        frame = frame_of(self._component.declaration, function, self._component.constants())
        slots = frame.slots
        inputs, outputs = self._wired(function), self._outputs(function)
        states = {name for name, _ in self._fmu.states}
        plan = self._array(fields.PLAN_WORDS)
        plan[fields.FRAME_WORDS] = frame.size
        plan[fields.TASK] = self._task(function, outputs)
        plan[fields.INPUTS], plan[fields.N_INPUTS] = self._row_table(inputs, slots, "Set")
        plan[fields.OUTPUTS], plan[fields.N_OUTPUTS] = self._row_table(outputs, slots, "Get")
        if function.kind == "step":
            going_on = {n: self._histories[n] for n in inputs if n in self._histories}
            plan[fields.PLAN_CURVES] = CurveTable(self._fmu, self._component, going_on, slots, self._keep).address
        if self._gives_derivatives:
            plan[fields.PLAN_TANGENT] = TangentTable(
                self._fmu, self._component, call, outputs, slots, self._keep
            ).address
        if states and states <= slots.keys():
            plan[fields.STATE_MAP] = self._map(slots, "")
        if function.kind == "indicators":
            plan[fields.INDICATOR_SLOT] = slots[fields.EVENT_INDICATORS]
        if function.kind == "derivatives":
            plan[fields.DERIVATIVE_MAP] = self._map(slots, "d_")
        every = {n for f in self._component.declaration.kind("outputs") for n in self._wired(f)}
        plan[fields.SETTLES] = function.kind == "outputs" and every <= {*inputs}
        return plan.ctypes.data

    def _wired(self, function: Any) -> list[str]:
        """The inputs that a call reads and a wire brings; the others have been set once."""
        return [n for n in function.reads if n in self._component.wires]

    def _outputs(self, function: Any) -> list[str]:
        """What a call gets from the FMU: states, and what somebody looks at."""
        if function.kind in ("begin", "events", "settle", "indicators"):
            return []
        states = {name for name, _ in self._fmu.states}
        return [
            n for n in function.arguments if n in function.writes and n in self._wanted | states & {*self._fmu.ports}
        ]

    def _task(self, function: Any, outputs: Sequence[str]) -> int:
        """What a call does: nothing where nobody looks at its outputs, and another one sets its inputs."""
        if function.kind != "outputs":
            return _TASKS[function.kind]
        kind = self._fmu.kind
        steps = kind != fields.MODEL_EXCHANGE or self._fmu.states
        return _OUTPUT_TASKS[kind] if outputs or not steps else fields.NOTHING

    def _map(self, slots: Mapping[str, int], prefix: str) -> int:
        places = self._array(len(self._fmu.states), 2)
        places[:] = [(slots[prefix + name], element) for name, element in self._fmu.states]
        return places.ctypes.data

    def _row_table(self, names: Sequence[str], slots: Mapping[str, int], access: str) -> tuple[int, int]:
        """The rows for variables, one for all of a type: their address, and how many they are."""
        groups: dict[tuple[str, bool], list[str]] = {}
        for name in names:
            port = self._fmu.ports[name]
            shadowed = access == "Set" and port.is_discrete and self._fmu.kind == fields.MODEL_EXCHANGE
            groups.setdefault((access + port.accessor, shadowed), []).append(name)
        rows = self._array(max(1, len(groups)), fields.ROW_WORDS)
        for row, ((function, shadowed), group) in zip(rows, groups.items(), strict=False):
            self._fill(row, group, slots, shadowed)
            row[fields.FUNCTION] = self._binary.address(function)
            self._rows[row.ctypes.data] = group
        return rows.ctypes.data, len(groups)

    def _fill(self, row: np.ndarray, names: Sequence[str], slots: Mapping[str, int], shadowed: bool) -> None:
        """A row for variables of one type."""
        parts = self._array(len(names), fields.PART_WORDS)
        for part, name in zip(parts, names, strict=True):
            port, dtype = self._fmu.ports[name], self._component.declaration.variables[name].dtype
            plain = port.code == fields.INTEGER32 and dtype.itemsize == 4
            travels = 4 if port.code in (fields.INTEGER32, fields.BOOLEAN32) else dtype.itemsize
            part[fields.SLOT], part[fields.CODE] = slots[name], fields.PLAIN if plain else port.code
            part[fields.COUNT_OF], part[fields.BYTES] = port.size, port.size * dtype.itemsize
            part[fields.TRAVELLING] = port.size * travels
            part[fields.SHADOW] = self._shadow(name, int(part[fields.BYTES])) if shadowed else 0
            self._rows[part.ctypes.data] = [name]
        references = np.array([r for name in names for r in self._fmu.ports[name].references], np.uint32)
        self._keep.append(references)
        row[fields.REFERENCES], row[fields.N_REFERENCES] = references.ctypes.data, len(references)
        row[fields.N_VALUES], row[fields.DISCRETE] = parts[:, fields.COUNT_OF].sum(), shadowed
        row[fields.PARTS], row[fields.N_PARTS] = parts.ctypes.data, len(parts)
        if len(parts) > 1 or parts[0, fields.CODE] in (fields.INTEGER32, fields.BOOLEAN32):
            row[fields.BUFFERED] = self._array(-(-int(parts[:, fields.TRAVELLING].sum()) // 8)).ctypes.data

    def _shadow(self, name: str, size: int) -> int:
        """Where the value of a discrete input is kept that the FMU has now; one for all calls."""
        if name not in self._shadows:
            self._shadows[name] = self._array(-(-len(self._handles) * size // 8))
            self._kept[f"shadow of {name}"] = self._shadows[name]
        return self._shadows[name].ctypes.data

    def finish(self, link: np.ndarray) -> None:
        """Fill in what belongs to a state that is kept, once all calls are planned."""
        table = self._array(len(self._kept), fields.KEPT_WORDS)
        for row, kept in zip(table, self._kept.values(), strict=True):
            row[fields.FROM], row[fields.WORDS] = kept.ctypes.data, kept.size
            row[fields.COPIED] = self._array(kept.size).ctypes.data
        link[fields.KEPT], link[fields.N_KEPT] = table.ctypes.data, len(table)

    def variables(self, row: int) -> list[str]:
        """The variables that the row or part at an address is for."""
        return self._rows.get(row, [])
