"""Which inputs, states and parameters a variable depends on, through all functions of all exported blocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from cosim.authoring.variables import CalculatedParameter, Input, Parameter, State
from cosim.wiring.network import Component, Network, Signal

#: What something depends on; True: a member of a fleet depends on what belongs to the same member only.
Knowns = dict[Signal, bool]
TIME = Signal("", "time")


class Dependencies:
    """The dependencies in the course of a run or (starts) at the initialization, where parameters count too.

    started: the states that start functions compute, and whether the diagram gives them all the same.
    """

    def __init__(self, network: Network, started: Mapping[Signal, bool], starts: bool) -> None:
        self.network = network
        self.started = started
        self.starts = starts
        self._sources: dict[Signal, Knowns | None] = {}

    def of(self, signal: Signal) -> Knowns:
        """The knowns of a variable of a component."""
        return self._reach({signal: True})

    def of_reads(self, component: Component, names: Iterable[str]) -> Knowns:
        """The knowns of what a function computes from the variables that it names."""
        return self._reach(_read(component, names))

    def _reach(self, begin: Knowns) -> Knowns:
        """All knowns behind some signals; those of an algebraic loop depend on each other, so paths may be circles."""
        found: Knowns = {}
        seen: Knowns = {}
        waiting = list(begin.items())
        while waiting:
            signal, same = waiting.pop()
            if signal in seen and (same or not seen[signal]):
                continue
            seen[signal] = same
            if signal not in self._sources:
                self._sources[signal] = self._search(signal)
            sources = self._sources[signal]
            if sources is None:
                found[signal] = found.get(signal, True) and same
            else:
                waiting += [(source, same and own) for source, own in sources.items()]
        return found

    def _search(self, signal: Signal) -> Knowns | None:
        """What a signal is computed from; None if it is a known itself."""
        if signal == TIME:
            return None
        component = self.network.components[signal.component]
        declared = self.network.variable(signal)
        if signal.variable in component.wires:
            return self._of_wire(component, signal.variable)
        if isinstance(declared, Input):
            return None
        if isinstance(declared, State):
            return self._of_state(component, declared, signal)
        if isinstance(declared, Parameter):
            return None if self.starts else {}
        if isinstance(declared, CalculatedParameter):
            return _of_writers(component, "calculate", signal) if self.starts else {}
        return _of_writers(component, "outputs", signal)

    def _of_wire(self, component: Component, port: str) -> Knowns:
        """A member reads its own part of a fleet's signal, or, where the port has room for it, that of all members."""
        sources = component.wires[port]
        same = component.fleet is not None and self.network.components[sources[0].component].fleet == component.fleet
        shape = component.shape(component.declaration.variables[port])
        dealt = len(self.network.shape(sources[0])) == len(shape) + 1
        whole = sources[0].members is None and not component.is_joined(port)
        return dict.fromkeys((source.whole for source in sources), same and dealt and whole)

    def _of_state(self, component: Component, declared: State, signal: Signal) -> Knowns | None:
        if self.starts and not self.started.get(signal, True):
            return _of_writers(component, "start", signal)
        visible = self.starts or declared in component.declaration.continuous()
        return None if visible else {}


def _of_writers(component: Component, kind: str, signal: Signal) -> Knowns:
    writers = [f for f in component.declaration.kind(kind) if signal.variable in f.writes]
    return {s: True for f in writers for s in _read(component, f.reads)}


def _read(component: Component, names: Iterable[str]) -> Knowns:
    return {TIME if name == "time" else Signal(component.name, name): True for name in names}
