"""What is exported: the variables of a sub-network in FMI's terms, over the table that computes them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cosim import engine, order, table
from cosim.block import CalculatedParameter, Input, Output, Parameter, State, Unit
from cosim.block import Variable as Declared
from cosim.errors import CosimError
from cosim.fmu.subnetwork import SubNetwork
from cosim.network import Network, Signal, Slave
from cosim.simulation import Simulation
from cosim.table import Place, Table

Need = Literal["NOTHING", "CALCULATED", "EVALUATED", "DIFFERENTIATED"]
Kind = Literal["TIME", "PARAMETER", "CONTINUOUS_STATE", "DISCRETE_OUTPUT", "OTHER"]
#: What something depends on; True: a member of a fleet depends on what belongs to the same member only.
Knowns = dict[Signal, bool]

TYPES = {
    **{"float64": "Float64", "float32": "Float32", "bool": "Boolean"},
    **{f"int{n}": f"Int{n}" for n in (8, 16, 32, 64)},
    **{f"uint{n}": f"UInt{n}" for n in (8, 16, 32, 64)},
}
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True, eq=False)
class Variable:
    """One FMI variable, an array where `shape` is not (); mapped: its first axis counts the members of a fleet.

    start: None where it is computed. offset: of its first element in the arena. need: what has to be computed before
    it can be read. state: for a derivative, the state's signal. knowns: what it depends on in the course of a run,
    and at the initialization.
    """

    name: str
    signal: Signal
    shape: tuple[int, ...]
    dtype: np.dtype
    causality: str
    variability: str
    initial: str | None
    offset: int = 0
    start: np.ndarray | None = None
    unit: Unit = None
    description: str = ""
    need: Need = "NOTHING"
    kind: Kind = "OTHER"
    state: Signal | None = None
    mapped: bool = False
    knowns: Knowns = field(default_factory=dict)
    initial_knowns: Knowns = field(default_factory=dict)

    @property
    def size(self) -> int:
        """The number of elements."""
        return int(np.prod(self.shape))

    @property
    def type(self) -> str:
        """FMI 3's name of the data type."""
        return TYPES[self.dtype.name]


TIME = Signal("", "time")


@dataclass
class Model:
    """A sub-network ready to be written: `variables[0]` is time; derivatives stand in the order of the state vector."""

    name: str
    identifier: str
    description: str
    table: Table
    started: dict[Signal, bool]
    variables: list[Variable] = field(default_factory=list)

    @property
    def network(self) -> Network:
        """The sub-network."""
        return self.table.network

    @property
    def periods(self) -> list[int]:
        """The periods of sampled blocks, in steps."""
        return sorted({s.every for s in self.network.slaves.values() if s.declaration.kind("update")})

    @property
    def derivatives(self) -> list[Variable]:
        """The derivatives in the order of the state vector."""
        return sorted((v for v in self.variables if v.state), key=lambda v: v.offset)

    def of(self, signal: Signal) -> Variable:
        """The variable that shows a signal; not its derivative."""
        return next(v for v in self.variables if v.signal == signal and not v.state)


def describe(sub: SubNetwork, identifier: str) -> Model:
    """All variables of a sub-network, and the table that computes them. Raises: DiagramErrors."""
    slaves = list(sub.network.slaves.values())
    built = table.build(sub.network, "jacobi")
    name = slaves[0].declaration.name if len(slaves) == 1 else sub.network.diagram.title
    doc = slaves[0].declaration.doc if len(slaves) == 1 else ", ".join(s.name for s in slaves)
    model = Model(name, identifier, doc.split("\n\n")[0].replace("\n", " "), built, sub.started)
    describer = _Describer(model, _initialized(built))
    model.variables = list(describer.variables())
    return model


def _initialized(built: Table) -> np.ndarray:
    """The arena with what `start` functions compute; as declared where that fails without real inputs."""
    simulation = Simulation(built, None)
    try:
        simulation.initialize()
    except CosimError:
        return built.arena
    return simulation.arena


class _Describer:
    def __init__(self, model: Model, initialized: np.ndarray) -> None:
        self.model = model
        self.initialized = initialized
        self.knowns = _Dependencies(model, starts=False)
        self.initial_knowns = _Dependencies(model, starts=True)

    def variables(self) -> Iterable[Variable]:
        """Time, then the variables of each slave, each continuous state followed by its derivative."""
        yield Variable("time", TIME, (), np.dtype(float), "independent", "continuous", None, unit="s", kind="TIME")
        for slave in self.model.network.slaves.values():
            continuous = slave.declaration.continuous()
            for declared in slave.declaration.variables.values():
                if declared.name in slave.wires:
                    continue
                yield (variable := self._variable(slave, declared))
                if declared in continuous:
                    yield self._derivative(variable, slave, declared)

    def _variable(self, slave: Slave, declared: Declared) -> Variable:
        signal = Signal(slave.name, declared.name)
        place = self.model.table.places[signal]
        continuous = declared in slave.declaration.continuous()
        computed = signal in self.model.started and not self.model.started[signal]
        initial = {"input": None, "parameter": "exact"}.get(declared.causality, "calculated")
        variability = "continuous" if declared.dtype.kind == "f" else "discrete"
        need: Need = "NOTHING"
        if isinstance(declared, State):
            initial = "approx" if computed else "exact"
            if not continuous:
                variability, need = "discrete", "EVALUATED"
        elif isinstance(declared, Parameter | CalculatedParameter):
            variability = "tunable"
            need = "CALCULATED" if isinstance(declared, CalculatedParameter) else "NOTHING"
        elif not isinstance(declared, Input):
            need = "EVALUATED"
            variability = "discrete" if order.is_sampled(slave) else variability
        shape = (slave.count, *place.shape) if place.stride else place.shape
        has_start = initial != "calculated"
        return Variable(
            name=self._name(slave, declared),
            signal=signal,
            shape=shape,
            dtype=declared.dtype,
            causality=declared.causality,
            variability=variability,
            initial=initial,
            offset=place.offset,
            start=self._start(place, shape, computed) if has_start else None,
            unit=declared.unit,
            description=declared.description,
            need=need,
            mapped=place.stride > 0,
            kind=self._kind(slave, declared),
            knowns=self.knowns.of(signal),
            initial_knowns=self.initial_knowns.of(signal),
        )

    def _kind(self, slave: Slave, declared: Declared) -> Kind:
        if declared in slave.declaration.continuous():
            return "CONTINUOUS_STATE"
        if isinstance(declared, Output) and declared.dtype.kind != "f" and not order.is_sampled(slave):
            return "DISCRETE_OUTPUT"
        return "PARAMETER" if isinstance(declared, Parameter) else "OTHER"

    def _start(self, place: Place, shape: tuple[int, ...], computed: bool) -> np.ndarray:
        arena = self.initialized if computed else self.model.table.arena
        return np.ndarray(shape, place.dtype, arena.data, place.offset).copy()

    def _derivative(self, state: Variable, slave: Slave, declared: Declared) -> Variable:
        vectors = self.model.table.vectors
        reads = {a for f in slave.declaration.kind("derivatives") if f"d_{declared.name}" in f.writes for a in f.reads}
        return Variable(
            name=f"der({state.name})",
            signal=state.signal,
            shape=state.shape,
            dtype=state.dtype,
            causality="local",
            variability="continuous",
            initial="calculated",
            offset=state.offset - vectors["X"] + vectors["D"],
            unit=_per_second(state.unit),
            description=f"derivative of {state.name}",
            need="DIFFERENTIATED",
            state=state.signal,
            mapped=state.mapped,
            knowns=self.knowns.of_reads(slave, reads),
            initial_knowns=self.initial_knowns.of_reads(slave, reads),
        )

    def _name(self, slave: Slave, declared: Declared) -> str:
        if len(self.model.network.slaves) == 1:
            return declared.name
        return ".".join(_quoted(part) for part in (*slave.name.split("/"), declared.name))


def _quoted(name: str) -> str:
    """FMI's structured naming: what is no identifier stands in apostrophes."""
    if _IDENTIFIER.fullmatch(name):
        return name
    return "'" + name.replace("\\", "\\\\").replace("'", "\\'") + "'"


def _per_second(unit: Unit) -> Unit:
    if unit is None or isinstance(unit, tuple):
        return None if unit is None else tuple(str(_per_second(u)) for u in unit)
    if match := re.fullmatch(r"(.*/s)(\d?)", unit):
        return f"{match[1]}{int(match[2] or 1) + 1}"
    return f"{unit}/s"


class _Dependencies:
    """Which inputs, states (and, at the initialization, parameters) a signal depends on, through all functions."""

    def __init__(self, model: Model, starts: bool) -> None:
        self.network = model.network
        self.started = model.started
        self.starts = starts
        self.found: dict[Signal, Knowns] = {}

    def of(self, signal: Signal) -> Knowns:
        """The knowns of a variable of a slave."""
        if signal not in self.found:
            self.found[signal] = self._search(signal)
        return self.found[signal]

    def of_reads(self, slave: Slave, names: Iterable[str]) -> Knowns:
        """The knowns of what a function computes from the variables that it names."""
        return _merged({TIME: True} if name == "time" else self.of(Signal(slave.name, name)) for name in names)

    def _search(self, signal: Signal) -> Knowns:
        slave = self.network.slaves[signal.slave]
        declared = slave.declaration.variables[signal.variable]
        if signal.variable in slave.wires:
            return self._of_wire(slave, signal.variable)
        if isinstance(declared, Input):
            return {signal: True}
        if isinstance(declared, State):
            return self._of_state(slave, declared, signal)
        if isinstance(declared, Parameter):
            return {signal: True} if self.starts else {}
        if isinstance(declared, CalculatedParameter):
            return self._of_writers(slave, "calculate", signal) if self.starts else {}
        return self._of_writers(slave, "outputs", signal)

    def _of_writers(self, slave: Slave, kind: str, signal: Signal) -> Knowns:
        writers = [f for f in slave.declaration.kind(kind) if signal.variable in f.writes]
        return _merged(self.of_reads(slave, f.reads) for f in writers)

    def _of_wire(self, slave: Slave, port: str) -> Knowns:
        sources = slave.wires[port]
        found = _merged(self.of(source.whole) for source in sources)
        same = slave.fleet is not None and self.network.slaves[sources[0].slave].fleet == slave.fleet
        whole = sources[0].members is None and not order.is_joined(slave, port)
        return found if same and whole else dict.fromkeys(found, False)

    def _of_state(self, slave: Slave, declared: State, signal: Signal) -> Knowns:
        if self.starts and not self.started.get(signal, True):
            return self._of_writers(slave, "start", signal)
        visible = self.starts or declared in slave.declaration.continuous()
        return {signal: True} if visible else {}


def _merged(parts: Iterable[Knowns]) -> Knowns:
    merged: Knowns = {}
    for part in parts:
        for signal, same_member in part.items():
            merged[signal] = merged.get(signal, True) and same_member
    return merged


# ---- operations -------------------------------------------------------------------------------------------------


@dataclass
class Operations:
    """The rows of the table, and the ranges of them that an FMU's functions do; see wrapper/model.h."""

    rows: np.ndarray
    ranges: dict[str, tuple[int, int]]
    started: list[tuple[int, Signal]]  # operation, state


def operations(model: Model) -> Operations:
    """The table's operations, followed by ranges of our own for what only FMUs do."""
    built = model.table
    rows = built.operations.tolist()
    ranges = {"initial": built.initial, "point": built.point, "between": built.between}
    calculate = sum(len(s.declaration.kind("calculate")) for s in model.network.slaves.values())
    ranges["calculate"] = (built.initial[0], built.initial[0] + calculate)

    def call(row: list[int]) -> table.Call | None:
        return built.calls[row[engine.A]] if row[engine.KIND] == engine.CALL else None

    def add(name: str, chosen: list[list[int]]) -> None:
        ranges[name] = (len(rows), len(rows) + len(chosen))
        rows.extend(chosen)

    sampled = {name for name, slave in model.network.slaves.items() if order.is_sampled(slave)}
    published = sum(len(s.declaration.discrete()) for s in model.network.slaves.values())
    outputs = rows[built.point[0] + published : built.point[1]]
    add("held", [row for row in outputs if not ((made := call(row)) and made.slave in sampled)])
    first = [(int(b[engine.FIRST_BEGIN]), int(b[engine.FIRST_END])) for b in built.banks]
    add("derivatives", [row for begin, end in first for row in rows[begin:end]])
    between = rows[built.between[0] : built.between[1]]
    add("update", [row for row in between if (made := call(row)) and made.function.kind == "update"])
    started = []
    for o in range(*built.initial):
        if (made := call(rows[o])) and made.function.kind == "start":
            started += [(o, Signal(made.slave, state)) for state in sorted(made.function.writes)]
    return Operations(np.array(rows, np.int64).reshape(-1, engine.OPERATION_WORDS), ranges, started)
