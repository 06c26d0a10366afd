"""Resolves a diagram: which block each name stands for, the size of every axis, every value, and every wire.

The result is a `Network` of `Component`s. All mistakes of a diagram are found in one go.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from cosim.authoring.block import Block
from cosim.authoring.variables import Input, Local, Parameter, State, Unit, Variable
from cosim.errors import (
    CosimError,
    MissingParameter,
    NotWirable,
    Position,
    Problems,
    TooManyInstances,
    UnconnectedInput,
    UnknownBlock,
    UnknownFleet,
    UnknownParameter,
    UnknownPort,
    WrongDataType,
    WrongUnit,
    WrongValue,
    nearest,
)
from cosim.language import units
from cosim.language.diagram import BlockEntry, Diagram, note_inherited
from cosim.language.grammar import endpoint
from cosim.language.source import Node
from cosim.language.swaps import Swap
from cosim.language.values import Value
from cosim.wiring import conditions, dimensions, library, order, replacing, sizes, windows
from cosim.wiring.network import Axis, Component, Network, Signal

_PLACES = 8
INTEGERS = (np.dtype(np.int32), np.dtype(np.int64))


def wire(diagram: Diagram, problems: Problems | None = None, code: bool = True) -> Network:
    """Resolve a diagram; `problems` may already hold mistakes. Raises: DiagramErrors with all of them.

    Without `code`, blocks of `python:` files are left out, whose code would have to run, and named as `unchecked`.
    """
    return _Wiring(diagram, problems or Problems(), code).network()


def revalue(network: Network, values: Mapping[Signal, Value]) -> Network:
    """The same network with other parameters and start values, of the shapes that it was wired with.

    Nothing is wired again; rules that see a changed value are judged again. Raises: DiagramErrors.
    """
    problems, fleets = Problems(), network.diagram.fleets
    changed = {s.component: replace(network.components[s.component]) for s in values}
    components = {**network.components, **changed}
    for component in changed.values():
        new = {s.variable: v for s, v in values.items() if s.component == component.name}
        variables = component.declaration.variables
        arrays = {name: problems.attempt(_array, component, variables[name], v, fleets) for name, v in new.items()}
        component.values = {**component.values, **{k: v for k, v in arrays.items() if v is not None}}
    problems.raise_if_any()
    parametrised = {s.component for s in values if isinstance(network.variable(s), Parameter)}
    seen = _after(components, parametrised)
    conditions.check(components, [name for name in components if name in changed or name in seen], problems)
    problems.raise_if_any()
    return replace(network, components=components)


def _after(components: Mapping[str, Component], names: set[str]) -> set[str]:
    """The named components and all that wires lead to from them: a rule may look at any block before its own."""
    readers: dict[str, set[str]] = {}
    for component in components.values():
        for source in (source for wires in component.wires.values() for source in wires):
            readers.setdefault(source.component, set()).add(component.name)
    found, todo = set(names), list(names)
    while todo:
        new = readers.get(todo.pop(), set()) - found
        found |= new
        todo += new
    return found


class _Wiring:
    """The stages of resolving one diagram; each collects its mistakes and goes on with what is left."""

    def __init__(self, diagram: Diagram, problems: Problems, code: bool) -> None:
        self.diagram = diagram
        self.problems = problems
        self.code = code
        self.unchecked = [e.name for e in diagram.blocks.values() if e.kind == "python" and not code]
        self.missing: dict[str, list[tuple[Node, str]]] = {}
        self.portless: dict[tuple[str, str], list[tuple[Node, str]]] = {}
        self.fleetless: dict[str, list[BlockEntry]] = {}
        self.components: dict[str, Component] = {}
        self.values: dict[tuple[str, str], Value] = {}
        self.swaps: list[Swap] = [*diagram.swaps]

    def network(self) -> Network:
        for entry in self.diagram.blocks.values():
            if entry.name not in self.diagram.unread and entry.name not in self.unchecked:
                self.problems.attempt(self._component, entry)
        self._report_fleets()
        for component in self.components.values():
            self.problems.attempt(self._names, component)
            self.problems.attempt(self._wires, component)
        self._agree_on_integers()
        dimensions.solve(self.components, self.values, self.diagram.fleets, self.problems)
        dimensions.report_sizes(self.components, self.values, self.problems)
        if self._is_whole():
            self.problems.attempt(order.initial_order, Network(self.diagram, self.components))
        if self._is_whole():  # else what is missing may only be a consequence
            dimensions.report_unsolved(self.components, self.problems)
        if not sizes.fit(self.components.values(), self.problems):
            self.problems.raise_if_any()  # what comes next would need that memory
        for component in self.components.values():
            if all(component.signal_axes(v) is not None for v in component.declaration.variables.values()):
                self._evaluate(component)
        self._check_wires()
        self._check_signals()
        self._report_missing()
        conditions.check(self.components, self.components, self.problems)
        note_inherited(self.diagram, self.problems)
        self.problems.raise_if_any()
        return Network(self.diagram, self.components, swaps=self.swaps, unchecked=self.unchecked)

    def _is_whole(self) -> bool:
        """Whether all blocks are known and nothing is wrong so far."""
        return not (self.problems.errors or self.missing or self.portless or self.unchecked)

    # ---- blocks and names ----

    def _component(self, entry: BlockEntry) -> None:
        block: type[Block] = library.find(entry)
        swap = replacing.settle(entry, block.declaration, self.problems, self.code)
        if swap:
            self.swaps.append(swap)
        run = self.diagram.run
        component = Component(entry.name, entry, block.declaration)
        component.method = entry.integrator.value if entry.integrator else run.integrator
        component.inner_steps = entry.inner_steps.value if entry.inner_steps else run.inner_steps
        if entry.per:
            fleets = self.diagram.fleets
            if entry.per.value not in fleets:
                self.fleetless.setdefault(str(entry.per.value), []).append(entry)
                return
            component.fleet, component.count = entry.per.value, fleets[entry.per.value]
        if entry.period:
            self.problems.attempt(self._period, component, entry.period)
        for key in ("integrator", "inner_steps"):
            self.problems.attempt(self._check_integration, component, key)
        most = block.declaration.most_instances
        if most is not None and component.count > most:
            count, name = component.count, entry.path.name
            message = f"block {entry.name}: {count} instances, but one process may have {most} of `{name}`"
            self.problems.add(TooManyInstances(message, entry.position, "write `isolate: true`"))
        for name, size in block.declaration.dimensions.items():
            component.axes[name] = Axis(size.default)
        self.problems.attempt(self._given_dimensions, component)
        self.components[entry.name] = component

    def _check_integration(self, component: Component, key: str) -> None:
        """Raises: WrongValue for an integrator of a block's own that would be ignored."""
        node: Node | None = getattr(component.entry, key)
        if node is None or node.inherited:
            return
        if not component.declaration.continuous():
            message = (
                f"block {component.name}: {component.declaration.name} has no continuous states, so it takes no `{key}`"
            )
            raise WrongValue(message, node.place, f"remove `{key}`")
        if self.diagram.run.method == "joint":
            message = (
                f"block {component.name}: `{key}` is ignored under `joint`, which integrates all blocks as one system"
            )
            raise WrongValue(message, node.place, f"remove it, set run.{key}, or choose another run.method")

    def _period(self, component: Component, period: Node) -> None:
        if not component.declaration.kind("update"):
            message = f"block {component.name}: {component.declaration.name} is not sampled, so it takes no period"
            raise WrongValue(message, period.position, "remove `period`, or give the block an update() function")
        steps = float(period.value) / self.diagram.run.step
        component.every = round(steps)
        if component.every < 1 or abs(steps - component.every) > 1e-9 * steps:
            message = f"block {component.name}: the period {period.value} s is no whole number of steps"
            raise WrongValue(message, period.position, f"choose a multiple of run.step = {self.diagram.run.step} s")

    def _given_dimensions(self, component: Component) -> None:
        known = component.declaration.dimension_names()
        for name, node in component.entry.dimensions.items():
            if name in known:
                component.axes[name] = Axis(int(node.value))
            else:
                message = f"block {component.name}: {component.declaration.name} has no dimension `{name}`"
                self.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))

    def _names(self, component: Component) -> None:
        """Match the entry's parameters and start values with the declaration, and take defaults for the rest."""
        declaration = component.declaration
        parameters = {v.name: v for v in declaration.of(Parameter)}
        starts = {v.name: v for v in declaration.startable()}
        for given, known, kind in (
            (component.entry.parameters, parameters, "parameter"),
            (component.entry.start, starts, "state or input to start"),
        ):
            for name, node in given.items():
                if name in known:
                    component.given.add(name)
                    self.problems.attempt(self._read_value, component, known[name], node)
                else:
                    message = f"block {component.name}: {declaration.name} has no {kind} `{name}`"
                    self.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))
        for variable in (*parameters.values(), *starts.values()):
            if variable.name in component.given:
                continue
            if variable.start is not None:
                self.values[component.name, variable.name] = Value.of(variable.start, component.entry.position)
            elif isinstance(variable, Parameter):
                message = f"block {component.name}: parameter `{variable.name}` of {declaration.name} has no value"
                fix = f"add `{variable.name}:` under blocks.{component.name}.parameters"
                self.problems.add(MissingParameter(message, component.entry.position, fix))

    def _read_value(self, component: Component, variable: Variable, node: Node) -> None:
        self.values[component.name, variable.name] = Value.read(node, f"{component.name}.{variable.name}")

    # ---- wires ----

    def _wires(self, component: Component) -> None:
        inputs = {v.name: v for v in component.declaration.of(Input)}
        for name, node in component.entry.inputs.items():
            sources = node.value if isinstance(node.value, list) else [node]
            if name in inputs and sources:
                found = [self.problems.attempt(self._source, component, name, source) for source in sources]
                component.wires[name] = tuple(s for s in found if s)
                self.problems.attempt(self._check_idle_start, component, name, sources[0])
            elif name not in inputs:
                message = f"block {component.name}: {component.declaration.name} has no input `{name}`"
                self.problems.add(UnknownPort(message, node.key_position, nearest(name, inputs)))
        for name in inputs:
            if name not in component.entry.inputs and (component.name, name) not in self.values:
                message = f"block {component.name}: input `{name}` is not connected and has no start value"
                fix = f"add `{name}: block.port` under blocks.{component.name}.inputs"
                if "/" in component.name:
                    outer, _, inner = component.name.rpartition("/")
                    own = f"inputs: {{{name}: {inner}.{name}}}"
                    fix = f"give that diagram an input, {own}, and wire it under blocks.{outer}.inputs"
                self.problems.add(UnconnectedInput(message, component.entry.position, fix))

    def _check_idle_start(self, component: Component, name: str, wire: Node) -> None:
        """A wired input has its source's value from time zero on; a diagram in a diagram may keep its own start."""
        start = component.entry.start.get(name)
        if start is None or ("/" in component.name and start.position.file != wire.position.file):
            return
        message = f"block {component.name}: input `{name}` is wired, so that its start value has no effect"
        raise WrongValue(message, start.key_position, f"remove it (an overlay writes `{name}: ~`), or the wire")

    def _source(self, component: Component, taker: str, node: Node) -> Signal:
        """What an input is wired to. Raises: NotWirable."""
        name, port = endpoint(str(node.value))
        port, members = _members(port)
        if name in self._unknown:
            return Signal(component.name, "")
        if name not in self.components:
            self.missing.setdefault(name, []).append((node, component.name))
            return Signal(component.name, "")
        source = self.components[name].declaration
        outputs = {v.name for v in source.variables.values() if v.causality == "output"}
        locals_ = {v.name for v in source.of(Local, State)} - outputs
        may_tap = component.declaration.measuring or component.declaration.feeds_locals_only(taker)
        if port in locals_ and not may_tap:
            message = f"block {component.name}: `{node.value}` is a local variable of {source.name}, not a port"
            fix = "only recordings, measuring blocks and locals may read locals" + _or_ports(name, outputs)
            raise NotWirable(message, node.position, fix)
        if port not in outputs | locals_:
            self.portless.setdefault((name, port), []).append((node, component.name))
            return Signal(component.name, "")
        if source.measuring and not may_tap:
            message = f"block {component.name}: `{node.value}` comes from a measuring block"
            raise NotWirable(message, node.position, "only recordings and measuring blocks may read a measure")
        return Signal(name, port, members)

    def _agree_on_integers(self) -> None:
        """Ports that take any integer take the type that comes or is wanted."""
        for component in self.components.values():
            for port, sources in component.wires.items():
                here = component.declaration.variables[port]
                for source in (s for s in sources if s.variable):
                    there = self.components[source.component].declaration.variables[source.variable]
                    if here.any_integer and there.dtype in INTEGERS:
                        here.dtype = there.dtype
                    elif there.any_integer and here.dtype in INTEGERS:
                        there.dtype = here.dtype

    # ---- values ----

    def _evaluate(self, component: Component) -> None:
        """Every value as an array (instances or 1, *shape)."""
        for variable in (*component.declaration.of(Parameter), *component.declaration.startable()):
            value = self.values.get((component.name, variable.name))
            if value is not None:
                array = self.problems.attempt(self._numbers, component, variable, value)
                if array is not None:
                    self._check_start(component, variable, value, array)
                    component.values[variable.name] = array

    def _numbers(self, component: Component, variable: Variable, value: Value) -> np.ndarray:
        """The array of a value; what is wrong with a default says whose it is. Raises: ExpressionError, WrongValue."""
        try:
            return _array(component, variable, value, self.diagram.fleets)
        except CosimError as error:
            if variable.name in component.given:
                raise
            message = f"block {component.name}: the default of `{variable.name}`: {error.message}"
            raise type(error)(message, error.position, error.fix) from None

    def _check_start(self, component: Component, variable: Variable, value: Value, array: np.ndarray) -> None:
        if isinstance(variable, State) and variable.finite and array.dtype.kind == "f" and not np.isfinite(array).all():
            message = f"block {component.name}: state `{variable.name}` starts as {array[~np.isfinite(array)][0]}"
            self.problems.add(WrongValue(message, value.position, "give a number below 1e100"))

    # ---- checks ----

    def _unit_there(self, source: Signal) -> Unit:
        """The unit of what is taken of a variable: its units are of its first axis, its members perhaps a fleet's."""
        there = self.components[source.component]
        unit = there.declaration.variables[source.variable].unit
        if not isinstance(unit, tuple) or source.members is None or there.fleet:
            return unit
        last = source.members if isinstance(source.members, int) else source.members[1]
        return unit[source.first : last]

    def _unit_here(self, component: Component, port: str, source: Signal, at: int) -> Unit:
        """The unit of what a source brings of an input, whose first axis several may fill one after the other."""
        variable, joined = component.declaration.variables[port], len(component.wires[port]) > 1
        along = max(1, *(self._rank(s) for s in component.wires[port])) == len(variable.shape)
        if isinstance(variable.unit, tuple) and joined and along:
            return variable.unit[at : at + self._length(source)]
        return variable.unit

    def _check_wires(self) -> None:
        for component in self.components.values():
            for port, sources in component.wires.items():
                at = 0
                for source in sources:
                    if source.variable:
                        self.problems.attempt(self._check_wire, component, port, source, at)
                        at += self._length(source)

    def _left(self, source: Signal) -> tuple[Axis, ...]:
        """The axes of what is taken of a variable; none where they are not known."""
        there = self.components[source.component]
        axes = there.signal_axes(there.declaration.variables[source.variable]) if source.variable else None
        return source.axes(axes) if axes else ()

    def _rank(self, source: Signal) -> int:
        return len(self._left(source))

    def _length(self, source: Signal) -> int:
        """How many members a source adds to those that are joined before it."""
        left = self._left(source)
        return left[0].size if left else 1

    def _check_wire(self, component: Component, port: str, source: Signal, at: int) -> None:
        """at: how many members are joined before this source."""
        here = component.declaration.variables[port]
        there = self.components[source.component].declaration.variables[source.variable]
        position = component.entry.inputs[port].position
        only = getattr(here, "only", "")
        if only and source.variable.rpartition(".")[2] != only:  # an FMU's port may say whose it is
            message = (
                f"block {component.name}: input `{port}` takes ports called `{only}` and nothing else, not {source}"
            )
            taps = {n: s.declaration.variables.get(only) for n, s in self.components.items()}
            wanted = [f"{n}.{only}" for n, variable in taps.items() if variable and variable.causality != "input"]
            raise NotWirable(message, position, f"wire {' or '.join(wanted) or f'a port of the name `{only}`'}")
        taken, given = self._unit_here(component, port, source, at), self._unit_there(source)
        if not units.same(taken, given):
            message = f"block {component.name}: input `{port}` is in {_unit(taken)}, but {source} is in {_unit(given)}"
            raise WrongUnit(message, position, "wire a signal in that unit, or put a gain between")
        if here.dtype != there.dtype:
            message = f"block {component.name}: input `{port}` is {here.dtype}, but {source} is {there.dtype}"
            raise WrongDataType(message, position, "wire a signal of that data type")

    def _check_signals(self) -> None:
        """What is recorded is there, and the metrics fit what they reduce."""
        record = self.diagram.record
        for node in record.signals if record else ():
            self._found(node)
        for node in self.diagram.outputs.values():
            self._found(node)
        for node in (node for nodes in self.diagram.inputs.values() for node in nodes):
            self._check_own_input(node)
        metrics = {name: metric for name, metric in self.diagram.metrics.items() if self._found(metric.signal)}
        if self.diagram.run.steps:
            self.problems.attempt(windows.reduced, Network(replace(self.diagram, metrics=metrics), self.components))

    def _found(self, node: Node) -> bool:
        """Whether a signal that is named is there and its shape is known; if it is not there, that is a mistake."""
        name = endpoint(str(node.value))[0]
        if name not in self.components:
            if name not in self._unknown:
                self.missing.setdefault(name, []).append((node, ""))
            return False
        network = Network(self.diagram, self.components)
        signal = self.problems.attempt(network.find, str(node.value), node.position)
        return signal is not None and self.components[name].signal_axes(network.variable(signal)) is not None

    def _check_own_input(self, node: Node) -> None:
        """What an input of the diagram itself drives is an input of a block."""
        name, port = endpoint(str(node.value))
        if name in self.components:
            inputs = [v.name for v in self.components[name].declaration.of(Input)]
            if port not in inputs:
                message = f"`{node.value}`: {self.components[name].declaration.name} ({name}) has no input `{port}`"
                self.problems.add(UnknownPort(message, node.position, nearest(port, inputs) or "name another block"))
        elif name not in self._unknown:
            self.missing.setdefault(name, []).append((node, ""))

    def _report_fleets(self) -> None:
        """One mistake for each fleet that is not there; of its blocks no more can be said."""
        for fleet, entries in self.fleetless.items():
            assert entries[0].per
            message = f"block {entries[0].name}: there is no fleet `{fleet}`"
            if len(entries) > 1:
                message += f", nor for {', '.join(entry.name for entry in entries[1:])}"
            fix = nearest(fleet, self.diagram.fleets) or f"write fleets: {{{fleet}: 6}}"
            self.problems.add(UnknownFleet(message, entries[0].per.position, fix))

    def _report_missing(self) -> None:
        """One mistake for each block or output that is not there, however many wires and signals name it."""
        for (name, port), uses in self.portless.items():
            source = self.components[name].declaration
            outputs = [v.name for v in source.variables.values() if v.causality == "output"]
            (node, taker), others = _sorted(uses)
            message = f"block {taker}: {source.name} ({name}) has no output `{port}`"
            message += f", which others name at {others}" if others else ""
            fix = nearest(port, outputs) or "it has no outputs"
            if (whole := port.partition("[")[0]) in outputs:
                fix = f"members are counted from 1, such as {whole}[2] or {whole}[1..3]"
            self.problems.add(UnknownPort(message, node.position, fix))
        for name, uses in self.missing.items() if self.components else ():
            (node, taker), others = _sorted(uses)
            message = f"`{node.value}` names no block of the diagram"
            message = f"block {taker}: {message}" if taker else message
            if others:
                message = f"the diagram has no block `{name}`, which {len(uses)} wires and signals name"
                message += f", the others at {others}"
            fix = self._meant(name, {_members(endpoint(str(n.value))[1])[0] for n, _ in uses})
            self.problems.add(UnknownBlock(message, node.position, fix))

    def _meant(self, name: str, ports: set[str]) -> str:
        """The usual fix: the block of the nearest name, or else the one that has the ports which are asked for."""
        able = {n for n, component in self.components.items() if ports <= set(component.declaration.variables)}
        close = get_close_matches(name, able, n=1, cutoff=0.5) or get_close_matches(
            name, self.components, n=1, cutoff=0.5
        )
        if not close and len(able) == 1 and len(ports) > 1:
            return f"did you mean `{able.pop()}`, which has {', '.join(sorted(ports))}?"
        return nearest(close[0] if close else name, self.components)

    @property
    def _unknown(self) -> set[str]:
        """Blocks whose own mistakes keep them from being known: what names them is no further mistake."""
        return (self.diagram.unread | set(self.diagram.blocks)) - set(self.components)


def _array(component: Component, variable: Variable, value: Value, fleets: Mapping[str, int]) -> np.ndarray:
    """A value as an array (instances or 1, *shape), each member's expressions evaluated with its number i."""
    shape = component.shape(variable)
    if component.fleet:
        members = _members_of(variable, value, component.count, shape)
        return (
            value.array(shape, variable.dtype, {"i": 1.0, "N": float(component.count)})[None]
            if members is None
            else members
        )
    if shape and component.counts_members(variable.shape[0]):
        members = _members_of(variable, value, shape[0], shape[1:])
        if members is None:
            members = np.broadcast_to(value.array(shape[1:], variable.dtype, {"i": 1.0, "N": float(shape[0])}), shape)
        return members[None]
    size = {"N": float(next(iter(fleets.values())))} if len(fleets) == 1 else {}
    return value.array(shape, variable.dtype, size)[None]


def _members_of(variable: Variable, value: Value, count: int, shape: tuple[int, ...]) -> np.ndarray | None:
    """A value for each member of a fleet (count, *shape); None where all have the same one."""
    per_member = len(value.shape) == len(shape) + 1
    if not per_member and (variable.dtype.hasobject or not value.uses("i")):
        return None
    array = np.empty((count, *shape), variable.dtype)
    for k in range(count):
        row = value.member(k) if per_member else value
        array[k] = row.array(shape, variable.dtype, {"i": k + 1.0, "N": float(count)})
    return array


def _members(port: str) -> tuple[str, tuple[int, int] | int | None]:
    """A port's name, and the members that a wire takes: `u[1..5]`, or `u[6]` for one without the axis."""
    match = re.fullmatch(r"(.+)\[(\d+)(?:\.\.(\d+))?\]", port)
    if not match or not 1 <= int(match[2]) <= int(match[3] or match[2]):
        return port, None
    return match[1], (int(match[2]), int(match[3])) if match[3] else int(match[2])


def _place(position: Position, file: str) -> str:
    """A place; in the same file, line and column alone."""
    return f"{position.line}:{position.column}" if position.file == file and position.line else str(position)


def _sorted(uses: list[tuple[Node, str]]) -> tuple[tuple[Node, str], str]:
    """The first of the uses of a name, and the places of the others."""
    ordered = sorted(uses, key=lambda use: (use[0].position.file, use[0].position.line, use[0].position.column))
    first = ordered[0][0].position.file
    places = [_place(node.position, first) for node, _ in ordered[1:]]
    return ordered[0], ", ".join(places[:_PLACES]) + (", …" if len(places) > _PLACES else "")


def _or_ports(name: str, outputs: set[str]) -> str:
    return f"; its ports are {', '.join(f'{name}.{o}' for o in sorted(outputs))}" if outputs else ""


def _unit(unit: Unit) -> str:
    one = unit[0] if isinstance(unit, tuple) and len(unit) == 1 else unit
    return "(" + ", ".join(one) + ")" if isinstance(one, tuple) else str(one)
