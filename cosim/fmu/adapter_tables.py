"""The tables of `cosim.fmu.fields` that the adapter walks for the instances of a block, filled for one run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.authoring.foreign import LoopWords
from cosim.compiling.frame import frame_of
from cosim.fmu import c_library, fields
from cosim.fmu.binary import Binary
from cosim.machine.memory import own

_TASKS = {
    "start": fields.INITIAL,
    "initial": fields.INITIAL,
    "begin": fields.BEGIN,
    "step": fields.ADVANCE,
    "derivatives": fields.DIFFERENTIATE,
    "events": fields.BEGIN_EVENTS,
    "settle": fields.END_EVENTS,
}
_OUTPUT_TASKS = {
    fields.CO_SIMULATION: fields.GET,
    fields.EVENT_CO_SIMULATION: fields.EXCHANGE,
    fields.MODEL_EXCHANGE: fields.EVALUATE,
}


class AdapterTables:
    """Tables that live as long as this.

    fmu: a `cosim.fmu.importer.Fmu`. component: its block in the network. handles: its instances' addresses. wanted: the
    locals that somebody looks at.
    """

    def __init__(self, fmu: Any, component: Any, handles: list[int], wanted: set[str], binary: Binary) -> None:
        self._fmu = fmu
        self._component = component
        self._handles = handles
        self._wanted = wanted
        self._binary = binary
        self._keep: list[Any] = []
        self._rows: dict[int, str] = {}
        self._shadows: dict[str, np.ndarray] = {}

    def _array(self, *shape: int) -> np.ndarray:
        """Zeroed words."""
        array = np.zeros(shape, np.int64)
        self._keep.append(array)
        return array

    # ---- what all calls share ----

    def link(self, link: np.ndarray, loop: LoopWords) -> None:
        """Fill the link, with a record for each instance. loop: how it steps. Raises: FmuError."""
        fmu = self._fmu
        indicators = fmu.description.numberOfEventIndicators if fmu.kind == fields.MODEL_EXCHANGE else 0
        states, signs = max(1, len(fmu.states)), max(1, indicators)
        self._keep.append(own())
        link[fields.ALONE] = self._keep[-1].ctypes.data
        link[fields.LEAVE] = c_library.address("_exit")
        link[fields.VERSION], link[fields.KIND] = fmu.version.number, fmu.kind
        link[fields.RECORDS] = self._records(states, signs)
        link[fields.STATES], link[fields.INDICATORS] = len(fmu.states), indicators
        link[fields.BUFFER] = self._array(states).ctypes.data
        link[fields.SIGNS] = self._array(signs).ctypes.data
        link[fields.WORK] = self._array((2 + loop.stages) * states).ctypes.data
        tableau = self._array(len(loop.tableau))
        tableau.view(np.float64)[:] = loop.tableau
        link[fields.TABLEAU], link[fields.STAGES] = tableau.ctypes.data, loop.stages
        link[fields.STEP], link[fields.INNER_STEPS], link[fields.JOINT] = loop.step, loop.inner_steps, loop.joint
        link[fields.ENDING], link[fields.AGAIN] = loop.ending, loop.again
        self._functions(link)

    def _records(self, states: int, signs: int) -> int:
        count = len(self._handles)
        records = self._array(count, fields.RECORD_WORDS)
        records[:, fields.HANDLE] = np.array(self._handles, np.uint64).view(np.int64)
        for word, size in ((fields.INDICATOR_VALUES, signs), (fields.END_STATES, states), (fields.SLOPES, states)):
            records[:, word] = [row.ctypes.data for row in self._array(count, size)]
        return records.ctypes.data

    def _functions(self, link: np.ndarray) -> None:
        fmu = self._fmu
        for word, name in fmu.version.functions[fmu.kind].items():
            link[word] = self._binary.address(name)
        if fmu.kind == fields.MODEL_EXCHANGE and fmu.interface.needsCompletedIntegratorStep:
            link[fields.COMPLETED_STEP] = self._binary.address("CompletedIntegratorStep")
        for word, name in fmu.version.optional[fmu.kind].items():
            link[word] = self._binary.find(name)

    # ---- what one call exchanges ----

    def plan(self, call: Any) -> int:
        """The address of the table of what a call exchanges. Raises: FmuError."""
        function = call.function
        frame = frame_of(self._component.declaration, function, self._component.constants())
        slots = frame.slots
        inputs = [n for n in function.reads if n in self._fmu.ports and self._fmu.ports[n].causality == "input"]
        states = {name for name, _ in self._fmu.states}
        outputs = self._outputs(function)
        plan = self._array(fields.PLAN_WORDS)
        plan[fields.FRAME_WORDS] = frame.size
        plan[fields.TASK] = _OUTPUT_TASKS[self._fmu.kind] if function.kind == "outputs" else _TASKS[function.kind]
        plan[fields.N_INPUTS], plan[fields.N_OUTPUTS] = len(inputs), len(outputs)
        plan[fields.INPUTS] = self._row_table(inputs, slots, "Set")
        plan[fields.OUTPUTS] = self._row_table(outputs, slots, "Get")
        if states and states <= slots.keys():
            plan[fields.STATE_MAP] = self._map(slots, "")
        if function.kind == "derivatives":
            plan[fields.DERIVATIVE_MAP] = self._map(slots, "d_")
        every = {n for f in self._component.declaration.kind("outputs") for n in f.reads if n in self._fmu.ports}
        plan[fields.SETTLES] = function.kind == "outputs" and every <= {*inputs, *states}
        return plan.ctypes.data

    def _outputs(self, function: Any) -> list[str]:
        """What a call gets from the FMU."""
        if function.kind in ("begin", "events", "settle"):
            return []
        outputs = [n for n in function.arguments if n in function.writes and n in self._fmu.ports]
        return [n for n in outputs if n in self._wanted] if function.name == "outputs_locals" else outputs

    def _map(self, slots: Mapping[str, int], prefix: str) -> int:
        places = self._array(len(self._fmu.states), 2)
        places[:] = [(slots[prefix + name], element) for name, element in self._fmu.states]
        return places.ctypes.data

    def _row_table(self, names: list[str], slots: Mapping[str, int], access: str) -> int:
        rows = self._array(max(1, len(names)), fields.ROW_WORDS)
        for name, row in zip(names, rows, strict=False):
            port = self._fmu.ports[name]
            references = np.array(port.references, np.uint32)
            self._keep.append(references)
            row[fields.FUNCTION] = self._binary.address(access + port.accessor)
            row[fields.REFERENCES], row[fields.N_REFERENCES] = references.ctypes.data, len(references)
            dtype = self._component.declaration.variables[name].dtype
            row[fields.N_VALUES], row[fields.SLOT], row[fields.CODE] = port.size, slots[name], port.code
            if port.code == fields.INTEGER32 and dtype.itemsize == 4:
                row[fields.CODE] = fields.PLAIN
            row[fields.BYTES] = port.size * dtype.itemsize
            row[fields.STAGING] = self._array(port.size).ctypes.data
            if access == "Set" and port.is_discrete and self._fmu.kind == fields.MODEL_EXCHANGE:
                row[fields.SHADOW] = self._shadow(name, int(row[fields.BYTES]))
            self._rows[row.ctypes.data] = name
        return rows.ctypes.data

    def _shadow(self, name: str, size: int) -> int:
        """Where the value of a discrete input is kept that the FMU has now; one for all calls."""
        if name not in self._shadows:
            self._shadows[name] = self._array(-(-len(self._handles) * size // 8))
        return self._shadows[name].ctypes.data

    def variable(self, row: int) -> str:
        """The variable that the row at an address is for, "" for none."""
        return self._rows.get(row, "")
