"""Where everything lies in the arena: two segments, what changes along a run and what does not.

An arena is a copy of all that a run knows, and whatever points into it is an offset, so that a copy of it is another
run. The state segment comes first, so that to save and restore a step is one copy of it. Where the elements of a
variable and the members of a fleet lie is decided here, and known by a `Place` alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.authoring.declaration import Function, variable_of
from cosim.authoring.variables import CalculatedParameter, Indicator, Input, Local, Output, Parameter, State, Variable
from cosim.engine.allocation import Allocation, Place, connect, remember
from cosim.master import tables, unknowns
from cosim.wiring import loops, order
from cosim.wiring.network import Component, Loop, Network, Signal

#: What stands where no function has written yet: a NaN that arithmetic does not make.
UNWRITTEN: dict[Any, Any] = {
    np.dtype(float): np.uint64(0x7FF8_C051_0000_0000),
    np.dtype(np.float32): np.uint32(0x7FC0_C051),
}
#: The vectors over all continuous states: as published, of the stage that is evaluated, and derivatives.
VECTORS = ("X", "W", "D")
#: Those of integrators of several stages: at the begin of an inner step, and a weighted sum of slopes.
OF_STAGES = ("BEGUN", "SUM")
#: Those over all indicators: see `tables`.
CROSSINGS = ("Z", "WAS", "HIGH", "DIRECTION")


class Layout(Allocation):
    """A place for every variable of a network.

    next: of discrete states after the next update; scratch: of outputs that derivatives read, inside an integration;
    integrated: of continuous states that are held where others see them; jumped: of states after an event. crossings:
    offsets of CROSSINGS, of `indicators` numbers each. given: offsets and instances of the values
    that a diagram sets. vectors: offsets of VECTORS, of OF_STAGES and of SLOPES, which is `slopes` vectors of
    derivatives. states: the size of each. memory: offset of what integrations keep from one step to the next.
    published: offset and count, by type, of numbers that have to be finite,
    besides the states. changing: bytes of the state segment; then come the constants. repeated: the part of it without
    the histories of inputs, by which a step that is repeated goes better.
    """

    def __init__(self, network: Network) -> None:
        super().__init__(network)
        self.next: dict[Signal, Place] = {}
        self.scratch: dict[Signal, Place] = {}
        self.integrated: dict[Signal, Place] = {}
        self.jumped: dict[Signal, Place] = {}
        self.crossings: dict[str, int] = {}
        self.indicators = 0
        self.given: dict[Signal, list[tuple[int, int]]] = {}
        self.vectors: dict[str, int] = {}
        self.published: dict[str, tuple[int, int]] = {}
        self._unknowns: dict[Loop, int] = {}
        self._lay_out_states()
        self._lay_out_published()
        components = self.network.components.values()
        for component in components:
            self._lay_out_hidden(component)
        for component in components:
            for port in component.wires:
                connect(self, component, port)
        self.repeated = self.allocate(0)
        for component in components:
            for port in component.couplings:
                remember(self, component, port)
        self.changing = self.allocate(0)
        self._lay_out_indicators()
        for component in components:
            for parameter in component.declaration.of(Parameter):
                self._lay_out(component, parameter, dense=False)

    def argument(self, component: Component, function: Function, name: str, stage: bool, hidden: bool) -> Place | None:
        """Where a function finds what it names, None for `time`.

        stage: inside an integration, where outputs are not the published ones; hidden: nor are the states.
        """
        if name == "time":
            return None
        signal = Signal(component.name, variable_of(component.declaration, name).name)
        place = self.own(signal)
        continuous = self.vectors["X"] <= place.offset < self.vectors["X"] + 8 * self.states
        variable = component.declaration.variables.get(name)
        if variable is None:  # d_x or next_x
            after = {"derivatives": self.derivative(place), "update": self.next.get(signal)}
            return after.get(function.kind, self.jumped.get(signal))
        if isinstance(variable, Indicator) and function.kind == "event":
            return place.moved(self.crossings["DIRECTION"] - self.crossings["Z"])
        if hidden and continuous and isinstance(variable, State):
            return place.moved(self.vectors["W"] - self.vectors["X"])
        return self.scratch.get(signal, place) if stage else place

    def own(self, signal: Signal) -> Place:
        """Where a variable is for the functions of its own component."""
        return self.integrated.get(signal) or self.places[signal]

    def derivative(self, state: Place) -> Place:
        """Where the derivative of a continuous state lies."""
        return state.moved(self.vectors["D"] - self.vectors["X"])

    def part(self, component: Component) -> tuple[int, int]:
        """Where a component's continuous states are in the state vector: the first, and the one after the last."""
        places = self.states_of(component)
        return int(places.min()), int(places.max()) + 1

    def states_of(self, component: Component) -> np.ndarray:
        """The places of a component's continuous states in the state vector, (instances, states of each)."""
        parts = [np.zeros((component.count, 0), int)]
        for state in component.declaration.continuous():
            place, size = self.own(Signal(component.name, state.name)), component.nbytes(state) // 8
            first = (place.offset - self.vectors["X"]) // 8
            parts.append(first + size * np.arange(component.count)[:, None] + np.arange(size))
        return np.concatenate(parts, axis=1)

    def unknowns(self, loop: Loop, clocks: Mapping[Signal, int]) -> int:
        """The offset of what is known of the unknowns of an algebraic loop, see `cosim.master.unknowns`.

        clocks: the numbers of those by which its rows compute signals; 0: at every communication point.
        """
        if loop not in self._unknowns:
            members, size = loops.systems(self.network, loop)
            work = self.allocate(8 * members * size * (size + unknowns.UNKNOWNS_VECTORS))
            derived = int(bool(loops.derived(self.network, loop)))
            words = [members, size, len(loop.torn), work, loops.bits(self.network, loop), derived]
            for signal in loop.torn:
                place, numbers = self.places[signal], self.bytes_of(signal) // 8 // members
                usual = self.network.variable(signal).nominal
                nominal = int(np.float64(1.0 if usual is None else np.max(usual)).view(np.int64))
                words += [place.offset, place.stride, numbers, clocks.get(signal, unknowns.NO_ROW), nominal]
            self._unknowns[loop] = self.constant(np.array(words, np.int64))
        return self._unknowns[loop]

    # ---- the state segment ----

    def _lay_out_states(self) -> None:
        continuous = [(c, v) for c in self.network.components.values() for v in c.declaration.continuous()]
        self.states = sum(c.count * c.nbytes(v) for c, v in continuous) // 8
        stages = _stages(self.network)
        for name in (*VECTORS, *OF_STAGES):
            self.vectors[name] = self.allocate(8 * self.states * (stages > 1 or name in VECTORS))
        owners = {component.name for component, _ in continuous}
        self.memory = self.allocate(8 * tables.MEMORY_WORDS * max(1, len(owners)))
        self.slopes = stages if stages > 1 else 0
        self.vectors["SLOPES"] = self.allocate(8 * self.states * self.slopes)
        at = self.vectors["X"]
        for component, state in continuous:
            size = component.nbytes(state)
            place = Place(at, size if component.count > 1 else 0, component.shape(state), state.dtype)
            self._place(component, state, place)
            self._mark(component, state, self.derivative(place).offset)
            at += size * component.count
        for component, state in continuous:
            if component.is_sampled:
                signal = Signal(component.name, state.name)
                self.integrated[signal] = self.places[signal]
                self._place(component, state, self.store(component, state, component.count))

    def _lay_out_published(self) -> None:
        """The variables, those side by side that have to be finite."""
        for kind in ("float64", "float32", ""):
            begin = self.allocate(0)
            for component in self.network.components.values():
                for variable in component.declaration.variables.values():
                    if _checked(variable) == kind and not isinstance(variable, (Parameter, Indicator)):
                        self._lay_out(component, variable, dense=bool(kind))
            if kind:
                self.published[kind] = begin, (self.size - begin) // np.dtype(kind).itemsize

    def _lay_out_indicators(self) -> None:
        """All indicators side by side, several times: see CROSSINGS. Whoever goes back in time keeps them."""
        several = [(c, v) for c in self.network.watched for v in c.declaration.of(Indicator)]
        self.indicators = sum(c.count * c.nbytes(v) for c, v in several) // 8
        for name in CROSSINGS:
            self.crossings[name] = self.allocate(8 * self.indicators)
        at = self.crossings["Z"]
        for component, variable in several:
            size = component.nbytes(variable)
            stride = size if component.count > 1 else 0
            self._place(component, variable, Place(at, stride, component.shape(variable), variable.dtype))
            at += size * component.count

    def _lay_out(self, component: Component, variable: Variable, dense: bool) -> None:
        signal = Signal(component.name, variable.name)
        if signal in self.places or variable.name in component.wires or variable.dtype.hasobject:
            return
        given = component.values.get(variable.name)
        shared = isinstance(variable, (Parameter, Input)) and given is not None and len(given) == 1
        self._place(component, variable, self.store(component, variable, 1 if shared else component.count, dense))

    def _lay_out_hidden(self, component: Component) -> None:
        """What nobody outside sees: the next values of discrete states, the outputs inside an integration."""
        for state in component.declaration.discrete():
            self.next[Signal(component.name, state.name)] = self.store(component, state, component.count)
        for state in component.declaration.jumping():
            self.jumped[Signal(component.name, state.name)] = self.store(component, state, component.count)
        for name in sorted({name for f in order.needed_outputs(component) for name in f.writes}):
            variable = component.declaration.variables[name]
            self.scratch[Signal(component.name, name)] = place = self.store(component, variable, component.count)
            self._mark(component, variable, place.offset)

    # ---- what stands there at first ----

    def _place(self, component: Component, variable: Variable, place: Place) -> None:
        signal = Signal(component.name, variable.name)
        self.places[signal] = place
        given = component.values.get(variable.name)
        if given is not None:
            instances = component.count if place.stride else 1
            self.given.setdefault(signal, []).append((place.offset, instances))
            full = np.broadcast_to(given, (instances, *place.shape)) if instances != len(given) else given
            self.first.append((place.offset, np.asarray(full, variable.dtype)))
        elif isinstance(variable, (Output, CalculatedParameter, Local)):
            self._mark(component, variable, place.offset)

    def shadow(self, component: Component, name: str) -> int:
        """The offset of a second copy of a start value that the diagram gives."""
        signal = Signal(component.name, name)
        place = self.places[signal]
        full = np.broadcast_to(component.values[name], (component.count, *place.shape))
        offset = self.constant(np.array(full, place.dtype))
        self.given[signal].append((offset, component.count))
        return offset

    def _mark(self, component: Component, variable: Variable, offset: int) -> None:
        """Mark what an author's function is to write, so that what it leaves out does not pass for a zero."""
        content = marks(component, variable, component.count * component.nbytes(variable))
        if content is not None:
            self.first.append((offset, content))


def marks(component: Component, variable: Variable, size: int) -> np.ndarray | None:
    """So many bytes of what stands where an author's function is to write; None for what may be anything."""
    if component.declaration.foreign or not variable.finite or variable.dtype not in UNWRITTEN:
        return None
    mark = UNWRITTEN[variable.dtype]
    return np.broadcast_to(mark, size // mark.itemsize)


def _stages(network: Network) -> int:
    """The most stages of any integrator that a network's states may be integrated by."""
    used = (network.diagram.run.integration, *(c.integration for c in network.components.values()))
    return max(integration.method.count for integration in used)


def _checked(variable: Variable) -> str:
    """The data type as which a variable has to be finite at every communication point; "" where it need not."""
    if isinstance(variable, (Parameter, Input, Indicator)) or not variable.finite:
        return ""
    return variable.dtype.name if variable.dtype.name in ("float64", "float32") else ""
