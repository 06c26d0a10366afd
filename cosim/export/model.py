"""What is exported: the variables of a sub-network in FMI's terms, over the program that computes them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from cosim.authoring.variables import (
    CalculatedParameter,
    Indicator,
    Input,
    Output,
    Parameter,
    Period,
    State,
    Unit,
    Variable,
    spread,
)
from cosim.engine import program
from cosim.engine.program import Program
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError
from cosim.export.dependencies import TIME, Dependencies, Knowns
from cosim.export.subnetwork import SubNetwork
from cosim.wiring.network import Component, Network, Signal

Need = Literal["NOTHING", "CALCULATED", "EVALUATED", "DIFFERENTIATED", "INDICATED"]
Kind = Literal["TIME", "PARAMETER", "CONTINUOUS_STATE", "DISCRETE_OUTPUT", "OTHER"]
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
    and at the initialization. nominal, min, max: of every element, where there are some.
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
    nominal: np.ndarray | None = None
    min: np.ndarray | None = None
    max: np.ndarray | None = None
    display: Unit = None
    knowns: Knowns = field(default_factory=dict)
    initial_knowns: Knowns = field(default_factory=dict)

    @property
    def is_indicator(self) -> bool:
        """Whether it is an event indicator."""
        return self.need == "INDICATED"

    @property
    def size(self) -> int:
        """The number of elements."""
        return int(np.prod(self.shape))

    @property
    def type(self) -> str:
        """FMI 3's name of the data type."""
        return TYPES[self.dtype.name]


@dataclass
class Model:
    """A sub-network ready to be written: `variables[0]` is time; derivatives stand in the order of the state vector.

    Importers stop at a NaN, and read an infinity differently. left_out: signals that are not finite at the
    initialization, and so are no variables. moved: inputs that begin elsewhere than in the diagram, as it begins them
    with no number, or beyond their limits.
    """

    name: str
    identifier: str
    description: str
    program: Program
    started: dict[Signal, bool]
    variables: list[FmiVariable] = field(default_factory=list)
    left_out: list[Signal] = field(default_factory=list)
    moved: list[Signal] = field(default_factory=list)

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
    components, diagram = list(sub.network.components.values()), sub.network.diagram
    built = program.build(sub.network, diagram.run.method if len(components) > 1 else "jacobi")
    name = components[0].declaration.name if len(components) == 1 else diagram.title or diagram.path.stem
    doc = components[0].declaration.doc if len(components) == 1 else ", ".join(s.name for s in components)
    model = Model(name, identifier, doc.split("\n\n")[0].replace("\n", " "), built, sub.started)
    model.moved = list(_moved(built))
    model.variables = list(_Describer(model, _initialized(built)).variables())
    return model


def _moved(built: Program) -> Iterator[Signal]:
    """The inputs that begin with no number or beyond a limit: from now on, with 0 or the limit."""
    for component in built.network.components.values():
        for declared in component.declaration.of(Input):
            if declared.name in component.wires:
                continue
            values = built.stored(signal := Signal(component.name, declared.name), built.arena)
            finite = values if _is_finite(values) else np.where(np.isfinite(values), values, 0.0)
            allowed = _within(
                finite,
                *(spread(limit, component.shape(declared), declared.dtype) for limit in (declared.min, declared.max)),
            )
            if (values != allowed).any():
                values[...] = allowed
                yield signal


def _within(values: np.ndarray, low: np.ndarray | None, high: np.ndarray | None) -> np.ndarray:
    """The nearest values within limits."""
    raised = values if low is None else np.maximum(values, low)
    return raised if high is None else np.minimum(raised, high)


def _is_finite(values: np.ndarray) -> bool:
    return values.dtype.kind != "f" or bool(np.isfinite(values).all())


def _initialized(built: Program) -> np.ndarray | None:
    """The arena with what start functions and outputs compute; None where that fails without real inputs."""
    simulation = Simulation(built, None)
    try:
        simulation.initialize()
    except CosimError:
        return None
    return simulation.arena


class _Describer:
    def __init__(self, model: Model, initialized: np.ndarray | None) -> None:
        self.model = model
        self.initialized = model.program.arena if initialized is None else initialized
        self.computed = initialized is not None
        self.knowns = Dependencies(model.network, model.started, starts=False)
        self.initial_knowns = Dependencies(model.network, model.started, starts=True)

    def variables(self) -> Iterable[FmiVariable]:
        """Time, then the variables of each component, each continuous state followed by its derivative."""
        yield FmiVariable("time", TIME, (), np.dtype(float), "independent", "continuous", None, unit="s", kind="TIME")
        for component in self.model.network.components.values():
            continuous = component.declaration.continuous()
            for declared in component.declaration.variables.values():
                if declared.name in component.wires or isinstance(declared, Period):
                    continue
                if not self._is_finite(component, declared):
                    self.model.left_out.append(Signal(component.name, declared.name))
                    continue
                yield (variable := self._variable(component, declared))
                if declared in continuous:
                    yield self._derivative(variable, component, declared)

    def _is_finite(self, component: Component, declared: Variable) -> bool:
        """Whether an importer finds numbers only; what could not be computed yet is taken to be finite."""
        given = isinstance(declared, (Input, Parameter, State))
        signal = Signal(component.name, declared.name)
        return _is_finite(self.model.program.stored(signal, self.initialized)) if given or self.computed else True

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
            need = "INDICATED" if isinstance(declared, Indicator) else "EVALUATED"
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
            start=self._start(component, declared, shape, computed) if has_start else None,
            unit=declared.unit,
            description=declared.description,
            need=need,
            mapped=place.stride > 0,
            **self._quantities(component, declared, shape),
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

    def _quantities(self, component: Component, declared: Variable, shape: tuple[int, ...]) -> dict[str, Any]:
        """Nominal values and limits of every element; a computed integer has no limits, as FMI holds it to them."""
        given = declared.dtype.kind == "f" or isinstance(declared, (Input, Parameter))
        keys = ("nominal", "min", "max") if given else ()
        own = component.shape(declared)
        spreads = {key: spread(getattr(declared, key), own, declared.dtype) for key in keys}
        found = {key: np.broadcast_to(numbers, shape) for key, numbers in spreads.items() if numbers is not None}
        return {**found, "display": declared.display}

    def _start(self, component: Component, declared: Variable, shape: tuple[int, ...], computed: bool) -> np.ndarray:
        """As the diagram has it; of what a start function computes, an approximation within the limits."""
        place = self.model.program.places[Signal(component.name, declared.name)]
        arena = self.initialized if computed else self.model.program.arena
        values = np.ndarray(shape, place.dtype, arena.data, place.offset).copy()
        limits = (spread(limit, component.shape(declared), declared.dtype) for limit in (declared.min, declared.max))
        return _within(values, *limits).astype(place.dtype) if computed else values

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
