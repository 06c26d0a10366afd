"""What is exported: the variables of a sub-network in FMI's terms, over the program that computes them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cosim.authoring.variables import CalculatedParameter, Input, Output, Parameter, Period, State, Unit, Variable
from cosim.engine import program
from cosim.engine.allocation import Place
from cosim.engine.program import Program
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError
from cosim.export.subnetwork import SubNetwork
from cosim.master import tables
from cosim.wiring.network import Component, Network, Signal

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
class FmiVariable:
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
    program: Program
    started: dict[Signal, bool]
    variables: list[FmiVariable] = field(default_factory=list)

    @property
    def network(self) -> Network:
        """The sub-network."""
        return self.program.network

    @property
    def derivatives(self) -> list[FmiVariable]:
        """The derivatives in the order of the state vector."""
        return sorted((v for v in self.variables if v.state), key=lambda v: v.offset)

    def of(self, signal: Signal) -> FmiVariable:
        """The variable that shows a signal; not its derivative."""
        return next(v for v in self.variables if v.signal == signal and not v.state)


def describe(sub: SubNetwork, identifier: str) -> Model:
    """All variables of a sub-network, and the program that computes them. Raises: DiagramErrors."""
    components = list(sub.network.components.values())
    built = program.build(sub.network, "jacobi")
    name = components[0].declaration.name if len(components) == 1 else sub.network.diagram.title
    doc = components[0].declaration.doc if len(components) == 1 else ", ".join(s.name for s in components)
    model = Model(name, identifier, doc.split("\n\n")[0].replace("\n", " "), built, sub.started)
    describer = _Describer(model, _initialized(built))
    model.variables = list(describer.variables())
    return model


def _initialized(built: Program) -> np.ndarray:
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

    def variables(self) -> Iterable[FmiVariable]:
        """Time, then the variables of each component, each continuous state followed by its derivative."""
        yield FmiVariable("time", TIME, (), np.dtype(float), "independent", "continuous", None, unit="s", kind="TIME")
        for component in self.model.network.components.values():
            continuous = component.declaration.continuous()
            for declared in component.declaration.variables.values():
                if declared.name in component.wires or isinstance(declared, Period):
                    continue
                yield (variable := self._variable(component, declared))
                if declared in continuous:
                    yield self._derivative(variable, component, declared)

    def _variable(self, component: Component, declared: Variable) -> FmiVariable:
        signal = Signal(component.name, declared.name)
        place = self.model.program.places[signal]
        continuous = declared in component.declaration.continuous()
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
            variability = "discrete" if component.is_sampled else variability
        shape = (component.count, *place.shape) if place.stride else place.shape
        has_start = initial != "calculated"
        return FmiVariable(
            name=self._name(component, declared),
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
            kind=self._kind(component, declared),
            knowns=self.knowns.of(signal),
            initial_knowns=self.initial_knowns.of(signal),
        )

    def _kind(self, component: Component, declared: Variable) -> Kind:
        if declared in component.declaration.continuous():
            return "CONTINUOUS_STATE"
        if isinstance(declared, Output) and declared.dtype.kind != "f" and not component.is_sampled:
            return "DISCRETE_OUTPUT"
        return "PARAMETER" if isinstance(declared, Parameter) else "OTHER"

    def _start(self, place: Place, shape: tuple[int, ...], computed: bool) -> np.ndarray:
        arena = self.initialized if computed else self.model.program.arena
        return np.ndarray(shape, place.dtype, arena.data, place.offset).copy()

    def _derivative(self, state: FmiVariable, component: Component, declared: Variable) -> FmiVariable:
        reads = {
            a for f in component.declaration.kind("derivatives") if f"d_{declared.name}" in f.writes for a in f.reads
        }
        return FmiVariable(
            name=f"der({state.name})",
            signal=state.signal,
            shape=state.shape,
            dtype=state.dtype,
            causality="local",
            variability="continuous",
            initial="calculated",
            offset=self.model.program.layout.derivative(self.model.program.places[state.signal]).offset,
            unit=_per_second(state.unit),
            description=f"derivative of {state.name}",
            need="DIFFERENTIATED",
            state=state.signal,
            mapped=state.mapped,
            knowns=self.knowns.of_reads(component, reads),
            initial_knowns=self.initial_knowns.of_reads(component, reads),
        )

    def _name(self, component: Component, declared: Variable) -> str:
        if len(self.model.network.components) == 1:
            return declared.name
        return ".".join(_quoted(part) for part in (*component.name.split("/"), declared.name))


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
        """The knowns of a variable of a component."""
        if signal not in self.found:
            self.found[signal] = self._search(signal)
        return self.found[signal]

    def of_reads(self, component: Component, names: Iterable[str]) -> Knowns:
        """The knowns of what a function computes from the variables that it names."""
        return _merged({TIME: True} if name == "time" else self.of(Signal(component.name, name)) for name in names)

    def _search(self, signal: Signal) -> Knowns:
        component = self.network.components[signal.component]
        declared = component.declaration.variables[signal.variable]
        if signal.variable in component.wires:
            return self._of_wire(component, signal.variable)
        if isinstance(declared, Input):
            return {signal: True}
        if isinstance(declared, State):
            return self._of_state(component, declared, signal)
        if isinstance(declared, Parameter):
            return {signal: True} if self.starts else {}
        if isinstance(declared, CalculatedParameter):
            return self._of_writers(component, "calculate", signal) if self.starts else {}
        return self._of_writers(component, "outputs", signal)

    def _of_writers(self, component: Component, kind: str, signal: Signal) -> Knowns:
        writers = [f for f in component.declaration.kind(kind) if signal.variable in f.writes]
        return _merged(self.of_reads(component, f.reads) for f in writers)

    def _of_wire(self, component: Component, port: str) -> Knowns:
        sources = component.wires[port]
        found = _merged(self.of(source.whole) for source in sources)
        same = component.fleet is not None and self.network.components[sources[0].component].fleet == component.fleet
        whole = sources[0].members is None and not component.is_joined(port)
        return found if same and whole else dict.fromkeys(found, False)

    def _of_state(self, component: Component, declared: State, signal: Signal) -> Knowns:
        if self.starts and not self.started.get(signal, True):
            return self._of_writers(component, "start", signal)
        visible = self.starts or declared in component.declaration.continuous()
        return {signal: True} if visible else {}


def _merged(parts: Iterable[Knowns]) -> Knowns:
    merged: Knowns = {}
    for part in parts:
        for signal, same_member in part.items():
            merged[signal] = merged.get(signal, True) and same_member
    return merged


# ---- phases -----------------------------------------------------------------------------------------------------

#: What only FMUs do: EVALUATE while sampled blocks hold what they gave, and the derivatives of all states.
PHASES = (*tables.PHASES, "HELD", "DERIVATIVES")


@dataclass
class Rows:
    """The rows of a program, followed by those of HELD and DERIVATIVES.

    phases: of each of PHASES the first row and the one after the last.
    """

    rows: np.ndarray
    phases: list[tuple[int, int]]


def rows(model: Model) -> Rows:
    """The program's rows, followed by rows of our own for what only FMUs do."""
    built = model.program
    sampled = {name for name, component in model.network.components.items() if component.is_sampled}

    def is_held(row: list[int]) -> bool:
        return row[tables.KIND] == tables.CALL and built.calls[row[tables.A]].component in sampled

    found = built.rows.tolist()
    held = [row for row in found[slice(*built.phases["EVALUATE"])] if not is_held(row)]
    first = [slice(int(bank[tables.FIRST_BEGIN]), int(bank[tables.FIRST_END])) for bank in built.banks]
    derivatives = [row for part in first for row in found[part]]
    phases = [built.phases[name] for name in tables.PHASES]
    for added in (held, derivatives):
        phases.append((len(found), len(found) + len(added)))
        found += added
    return Rows(np.array(found, np.int64).reshape(-1, tables.ROW_WORDS), phases)
