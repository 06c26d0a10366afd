"""Resolves a diagram: which block each name stands for, the size of every axis, every value, and every wire.

The result is a `Network` of `Slave`s. All mistakes of a diagram are found in one go.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim import units
from cosim.block import Block, Declaration, Input, Local, Parameter, Rule, State, Variable
from cosim.diagram import BlockEntry, Diagram
from cosim.errors import (
    CosimError,
    FleetMismatch,
    MissingParameter,
    NotWirable,
    Position,
    Problems,
    RuleViolation,
    UnconnectedInput,
    UnknownBlock,
    UnknownFleet,
    UnknownParameter,
    UnknownPort,
    UnsolvedDimension,
    WrongDataType,
    WrongShape,
    WrongUnit,
    WrongValue,
    nearest,
)
from cosim.source import Node
from cosim.values import Value


@dataclass(frozen=True)
class Axis:
    """The size of one axis of a signal, and the fleet whose members it counts."""

    size: int
    fleet: str | None = None


@dataclass(frozen=True)
class Signal:
    """One variable of one slave."""

    slave: str
    variable: str

    def __str__(self) -> str:
        return f"{self.slave}.{self.variable}"


@dataclass(frozen=True)
class Source:
    """What a block's rule sees of the block at the other end of a wire."""

    block: str
    parameters: dict[str, np.ndarray]


@dataclass
class Finding:
    """A condition of a theorem, evaluated on a block's parameters."""

    slave: str
    text: str
    source: str
    holds: bool
    numbers: str


@dataclass
class Slave:
    """One block of a diagram, wired. Values have the shape (instances or 1, *shape of the variable)."""

    name: str
    entry: BlockEntry
    declaration: Declaration
    fleet: str | None = None
    count: int = 1
    axes: dict[str, Axis] = field(default_factory=dict)
    values: dict[str, np.ndarray] = field(default_factory=dict)
    given: set[str] = field(default_factory=set)
    wires: dict[str, tuple[Signal, ...]] = field(default_factory=dict)
    every: int = 1
    method: str = "euler"
    inner_steps: int = 1

    def shape(self, variable: Variable) -> tuple[int, ...]:
        """The shape of a variable in one instance."""
        return tuple(d if isinstance(d, int) else self.axes[d].size for d in variable.shape)

    def signal_axes(self, variable: Variable) -> tuple[Axis, ...] | None:
        """The axes of a variable over all instances; None while a dimension is not solved."""
        if any(isinstance(d, str) and d not in self.axes for d in variable.shape):
            return None
        own = tuple(Axis(d) if isinstance(d, int) else self.axes[d] for d in variable.shape)
        return (Axis(self.count, self.fleet), *own) if self.fleet else own

    def constants(self) -> dict[str, int]:
        """The dimensions that are compiled into kernels: those of ports, unless a fleet sets them."""
        ports = (v for v in self.declaration.variables.values() if v.causality in ("input", "output"))
        names = dict.fromkeys(d for v in ports for d in v.shape if isinstance(d, str))
        return {name: self.axes[name].size for name in names if self.axes[name].fleet is None}


@dataclass
class Network:
    """A resolved diagram."""

    diagram: Diagram
    slaves: dict[str, Slave]
    findings: list[Finding]

    def variable(self, signal: Signal) -> Variable:
        """The declaration of a signal."""
        return self.slaves[signal.slave].declaration.variables[signal.variable]

    def shape(self, signal: Signal) -> tuple[int, ...]:
        """The shape of a signal over all instances."""
        axes = self.slaves[signal.slave].signal_axes(self.variable(signal))
        assert axes is not None
        return tuple(a.size for a in axes)

    def find(self, text: str, position: Position | None) -> Signal:
        """The signal that a recording or metric names; any variable but inputs.

        Raises: UnknownBlock, UnknownPort.
        """
        name, _, port = text.rpartition(".")
        if name not in self.slaves:
            fix = nearest(name, self.slaves)
            raise UnknownBlock(f"`{text}`: the diagram has no block `{name}`", position, fix)
        variables = {k: v for k, v in self.slaves[name].declaration.variables.items() if not isinstance(v, Input)}
        if port not in variables:
            message = f"`{text}`: block {name} has no variable `{port}` to record"
            raise UnknownPort(message, position, nearest(port, variables))
        return Signal(name, port)


def wire(diagram: Diagram, problems: Problems | None = None) -> Network:
    """Resolve a diagram; `problems` may already hold mistakes. Raises: DiagramErrors with all of them."""
    return _Wiring(diagram, problems or Problems()).network()


def revalue(network: Network, values: Mapping[Signal, Value]) -> Network:
    """The same network with other parameters and start values, of the shapes that it was wired with.

    Nothing is wired again; rules that see a changed value are judged again. Raises: DiagramErrors.
    """
    problems = Problems()
    wiring = _Wiring(network.diagram, problems)
    changed = {s.slave: replace(network.slaves[s.slave]) for s in values}
    wiring.slaves = {**network.slaves, **changed}
    for slave in changed.values():
        new = {s.variable: v for s, v in values.items() if s.slave == slave.name}
        variables = slave.declaration.variables
        arrays = {name: wiring._attempt(wiring._array, slave, variables[name], v) for name, v in new.items()}
        slave.values = {**slave.values, **{k: v for k, v in arrays.items() if v is not None}}
    problems.raise_if_any()
    parametrised = {s.slave for s in values if isinstance(network.variable(s), Parameter)}
    for slave in wiring.slaves.values():
        sources = {source.slave for wires in slave.wires.values() for source in wires}
        if slave.name in changed or sources & parametrised:
            wiring._rules(slave)
    problems.raise_if_any()
    return replace(network, slaves=wiring.slaves)


class _Wiring:
    """The stages of resolving one diagram; each collects its mistakes and goes on with what is left."""

    def __init__(self, diagram: Diagram, problems: Problems) -> None:
        self.diagram = diagram
        self.problems = problems
        self.slaves: dict[str, Slave] = {}
        self.values: dict[tuple[str, str], Value] = {}

    def network(self) -> Network:
        for entry in self.diagram.blocks.values():
            self._attempt(self._slave, entry)
        for slave in self.slaves.values():
            self._attempt(self._names, slave)
            self._attempt(self._wires, slave)
        self._solve_dimensions()
        solved = [s for s in self.slaves.values() if self._all_solved(s)]
        for slave in solved:
            self._attempt(self._evaluate, slave)
        self._check_wires()
        self._check_signals()
        findings: list[Finding] = []
        if not self.problems.errors:
            for slave in self.slaves.values():
                findings += self._rules(slave)
        self.problems.raise_if_any()
        return Network(self.diagram, self.slaves, findings)

    def _attempt(self, stage: Any, *arguments: Any) -> Any:
        try:
            return stage(*arguments)
        except CosimError as error:
            self.problems.add(error)
            return None

    # ---- blocks and names ----

    def _slave(self, entry: BlockEntry) -> None:
        from cosim import library

        block: type[Block] = library.find(entry)
        run = self.diagram.run
        slave = Slave(entry.name, entry, block.declaration)
        slave.method = entry.integrator.value if entry.integrator else run.integrator
        slave.inner_steps = entry.inner_steps.value if entry.inner_steps else run.inner_steps
        if entry.per:
            fleets = self.diagram.fleets
            if entry.per.value not in fleets:
                message = f"block {entry.name}: there is no fleet `{entry.per.value}`"
                self.problems.add(UnknownFleet(message, entry.per.position, nearest(str(entry.per.value), fleets)))
            else:
                slave.fleet, slave.count = entry.per.value, fleets[entry.per.value]
        if entry.period:
            self._attempt(self._period, slave, entry.period)
        for name, size in block.declaration.dimensions.items():
            slave.axes[name] = Axis(size.default)
        self._attempt(self._given_dimensions, slave)
        self.slaves[entry.name] = slave

    def _period(self, slave: Slave, period: Node) -> None:
        if not slave.declaration.kind("update"):
            message = f"block {slave.name}: {slave.declaration.name} is not sampled, so it takes no period"
            raise WrongValue(message, period.position, "remove `period`, or give the block an update() function")
        steps = float(period.value) / self.diagram.run.step
        slave.every = round(steps)
        if slave.every < 1 or abs(steps - slave.every) > 1e-9 * steps:
            message = f"block {slave.name}: the period {period.value} s is no whole number of steps"
            raise WrongValue(message, period.position, f"choose a multiple of run.step = {self.diagram.run.step} s")

    def _given_dimensions(self, slave: Slave) -> None:
        known = {d for v in slave.declaration.variables.values() for d in v.shape if isinstance(d, str)}
        for name, node in slave.entry.dimensions.items():
            if name in known:
                slave.axes[name] = Axis(int(node.value))
            else:
                message = f"block {slave.name}: {slave.declaration.name} has no dimension `{name}`"
                self.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))

    def _names(self, slave: Slave) -> None:
        """Match the entry's parameters and start values with the declaration, and take defaults for the rest."""
        declaration = slave.declaration
        parameters = {v.name: v for v in declaration.of(Parameter)}
        starts = {v.name: v for v in declaration.of(State, Input)}
        for given, known, kind in (
            (slave.entry.parameters, parameters, "parameter"),
            (slave.entry.start, starts, "state or input to start"),
        ):
            for name, node in given.items():
                if name in known:
                    slave.given.add(name)
                    self._attempt(self._read_value, slave, known[name], node)
                else:
                    message = f"block {slave.name}: {declaration.name} has no {kind} `{name}`"
                    self.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))
        for variable in (*parameters.values(), *starts.values()):
            if variable.name in slave.given:
                continue
            if variable.start is not None:
                self.values[slave.name, variable.name] = Value.of(variable.start, slave.entry.position)
            elif isinstance(variable, Parameter):
                message = f"block {slave.name}: parameter `{variable.name}` of {declaration.name} has no value"
                fix = f"add `{variable.name}:` under blocks.{slave.name}.parameters"
                self.problems.add(MissingParameter(message, slave.entry.position, fix))

    def _read_value(self, slave: Slave, variable: Variable, node: Node) -> None:
        self.values[slave.name, variable.name] = Value.read(node, f"{slave.name}.{variable.name}")

    # ---- wires ----

    def _wires(self, slave: Slave) -> None:
        inputs = {v.name: v for v in slave.declaration.of(Input)}
        for name, node in slave.entry.inputs.items():
            if name in inputs:
                sources = node.value if isinstance(node.value, list) else [node]
                found = [self._attempt(self._source, slave, source) for source in sources]
                slave.wires[name] = tuple(s for s in found if s)
            else:
                message = f"block {slave.name}: {slave.declaration.name} has no input `{name}`"
                self.problems.add(UnknownPort(message, node.key_position, nearest(name, inputs)))
        for name in inputs:
            if name not in slave.wires and (slave.name, name) not in self.values:
                message = f"block {slave.name}: input `{name}` is not connected and has no start value"
                fix = f"add `{name}: block.port` under blocks.{slave.name}.inputs"
                self.problems.add(UnconnectedInput(message, slave.entry.position, fix))

    def _source(self, slave: Slave, node: Node) -> Signal:
        name, _, port = str(node.value).rpartition(".")
        if name not in self.diagram.blocks:
            message = f"block {slave.name}: `{node.value}` names no block of the diagram"
            raise UnknownBlock(message, node.position, nearest(name, self.diagram.blocks))
        if name not in self.slaves:
            return Signal(slave.name, "")  # the block's own mistake is reported already
        source = self.slaves[name].declaration
        outputs = {v.name for v in source.variables.values() if v.causality == "output"}
        locals_ = {v.name for v in source.of(Local, State)} - outputs
        if port in locals_ and not slave.declaration.measuring:
            message = f"block {slave.name}: `{node.value}` is a local variable of {source.name}, not a port"
            fix = "only recordings and measuring blocks may read locals" + _or_ports(name, outputs)
            raise NotWirable(message, node.position, fix)
        if port not in outputs | locals_:
            message = f"block {slave.name}: {source.name} ({name}) has no output `{port}`"
            raise UnknownPort(message, node.position, nearest(port, outputs))
        if source.measuring and not slave.declaration.measuring:
            message = f"block {slave.name}: `{node.value}` comes from a measuring block"
            raise NotWirable(message, node.position, "only recordings and measuring blocks may read a measure")
        return Signal(name, port)

    # ---- dimensions ----

    def _solve_dimensions(self) -> None:
        """Named dimensions from wires, then from values, until nothing new is learnt."""
        learnt = True
        while learnt:
            before = {n: dict(s.axes) for n, s in self.slaves.items()}
            for slave in self.slaves.values():
                for port in list(slave.wires):
                    self._attempt(self._learn_from_wire, slave, port)
            for (name, variable), value in self.values.items():
                slave = self.slaves[name]
                self._attempt(self._learn_from_value, slave, slave.declaration.variables[variable], value)
            learnt = any(before[n] != s.axes for n, s in self.slaves.items())

    def _learn_from_wire(self, slave: Slave, port: str) -> None:
        variable = slave.declaration.variables[port]
        axes = self.joined_axes(slave, port)
        if axes is None:
            return
        node = slave.entry.inputs[port]
        if slave.fleet and len(axes) == len(variable.shape) + 1 and axes[0].size == slave.count:
            axes = axes[1:]
        if len(axes) != len(variable.shape):
            raise self._shape_error(slave, variable, axes, node)
        for dimension, axis in zip(variable.shape, axes, strict=True):
            if not self._unify(slave, dimension, axis):
                raise self._shape_error(slave, variable, axes, node)

    def joined_axes(self, slave: Slave, port: str) -> tuple[Axis, ...] | None:
        """The axes that arrive at an input: those of its source, or of its sources joined along the first axis."""
        sources = [s for s in slave.wires[port] if s.variable]
        found = [
            self.slaves[s.slave].signal_axes(self.slaves[s.slave].declaration.variables[s.variable]) for s in sources
        ]
        if not found or any(axes is None for axes in found):
            return None
        if not isinstance(slave.entry.inputs[port].value, list):
            return found[0]
        rank = max(len(axes) for axes in found if axes is not None)
        parts = [axes if len(axes) == rank else (Axis(1), *axes) for axes in found if axes is not None]
        if any(len(axes) != rank or axes[1:] != parts[0][1:] for axes in parts):
            message = f"block {slave.name}: the sources joined for input `{port}` differ in shape"
            raise WrongShape(message, slave.entry.inputs[port].position, "join signals that differ in members only")
        size = sum(axes[0].size for axes in parts)
        fleet = next((f for f, n in self.diagram.fleets.items() if n == size), None)
        return (Axis(size, slave.fleet or fleet), *parts[0][1:])

    def _unify(self, slave: Slave, dimension: int | str, axis: Axis) -> bool:
        if isinstance(dimension, int):
            return dimension == axis.size
        known = slave.axes.get(dimension)
        if known is None or (known.size == axis.size and known.fleet is None):
            slave.axes[dimension] = axis
            return True
        return known.size == axis.size

    def _shape_error(self, slave: Slave, variable: Variable, axes: tuple[Axis, ...], node: Node) -> WrongShape:
        expected = ", ".join(self._dimension_text(slave, d) for d in variable.shape)
        arrived = ", ".join(f"{a.fleet}: {a.size}" if a.fleet else str(a.size) for a in axes)
        message = f"block {slave.name}: input `{variable.name}` takes ({expected}), but ({arrived}) arrives"
        fleet = axes[0].fleet if axes else None
        fix = f"is `per: {fleet}` missing?" if fleet and not slave.fleet else "wire a signal of that shape"
        return WrongShape(message, node.position, fix)

    def _dimension_text(self, slave: Slave, dimension: int | str) -> str:
        known = slave.axes.get(dimension) if isinstance(dimension, str) else None
        return f"{dimension} = {known.size}" if known else str(dimension)

    def _learn_from_value(self, slave: Slave, variable: Variable, value: Value) -> None:
        shape = value.shape
        rank = len(variable.shape)
        if shape == ():
            return
        if slave.fleet and len(shape) == rank + 1:
            if shape[0] != slave.count:
                message = (
                    f"block {slave.name}: `{variable.name}` has {shape[0]} entries for {slave.count} {slave.fleet}s"
                )
                fix = f"give one for each {slave.fleet}, or one value for all"
                raise FleetMismatch(message, value.position, fix)
            shape = shape[1:]
        elif len(shape) == rank - 1:  # one row, evaluated for each member of the first axis
            if not self._unify_all(slave, variable.shape[1:], shape):
                raise self._value_error(slave, variable, value)
            return
        if len(shape) == rank and rank and self._is_fleet(slave, variable.shape[0]):
            size = slave.axes[variable.shape[0]].size  # type: ignore[index]
            if shape[0] != size:
                message = f"block {slave.name}: `{variable.name}` has {shape[0]} entries for a fleet of {size}"
                raise FleetMismatch(message, value.position, "give one for each member, or an expression in i")
        if len(shape) != rank or not self._unify_all(slave, variable.shape, shape):
            raise self._value_error(slave, variable, value)

    def _is_fleet(self, slave: Slave, dimension: int | str) -> bool:
        return isinstance(dimension, str) and dimension in slave.axes and slave.axes[dimension].fleet is not None

    def _unify_all(self, slave: Slave, dimensions: tuple[int | str, ...], shape: tuple[int, ...]) -> bool:
        return all([self._unify(slave, d, Axis(n)) for d, n in zip(dimensions, shape, strict=True)])

    def _value_error(self, slave: Slave, variable: Variable, value: Value) -> WrongShape:
        expected = ", ".join(self._dimension_text(slave, d) for d in variable.shape)
        message = f"block {slave.name}: `{variable.name}` has the shape ({expected}), not {value.shape}"
        return WrongShape(message, value.position, "give a list of that shape, or one number for all elements")

    def _all_solved(self, slave: Slave) -> bool:
        names = {d for v in slave.declaration.variables.values() for d in v.shape if isinstance(d, str)}
        missing = sorted(names - set(slave.axes))
        for name in missing:
            if not self.problems.errors:
                message = f"block {slave.name}: nothing determines the dimension `{name}` of {slave.declaration.name}"
                fix = f"add `{name}: <size>` under blocks.{slave.name}.dimensions"
                self.problems.add(UnsolvedDimension(message, slave.entry.position, fix))
        return not missing

    # ---- values ----

    def _evaluate(self, slave: Slave) -> None:
        """Every value as an array (instances or 1, *shape)."""
        for variable in slave.declaration.of(Parameter, State, Input):
            value = self.values.get((slave.name, variable.name))
            if value is not None:
                array = self._attempt(self._array, slave, variable, value)
                if array is not None:
                    slave.values[variable.name] = array

    def _array(self, slave: Slave, variable: Variable, value: Value) -> np.ndarray:
        shape = slave.shape(variable)
        if slave.fleet:
            names = [{"i": k + 1.0, "N": float(slave.count)} for k in range(slave.count)]
            per_member = len(value.shape) == len(shape) + 1
            if per_member or value.uses("i"):
                rows = [value.member(k) if per_member else value for k in range(slave.count)]
                return np.stack([row.array(shape, variable.dtype, n) for row, n in zip(rows, names, strict=True)])
            return value.array(shape, variable.dtype, names[0])[np.newaxis]
        if shape and self._is_fleet(slave, variable.shape[0]):
            names = [{"i": k + 1.0, "N": float(shape[0])} for k in range(shape[0])]
            per_member = len(value.shape) == len(shape)
            rows = [value.member(k) if per_member else value for k in range(shape[0])]
            parts = [row.array(shape[1:], variable.dtype, n) for row, n in zip(rows, names, strict=True)]
            return np.stack(parts)[np.newaxis]
        sizes = {"N": float(next(iter(self.diagram.fleets.values())))} if len(self.diagram.fleets) == 1 else {}
        return value.array(shape, variable.dtype, sizes)[np.newaxis]

    # ---- checks ----

    def _check_wires(self) -> None:
        for slave in self.slaves.values():
            for port, sources in slave.wires.items():
                for source in sources:
                    if source.variable:
                        self._attempt(self._check_wire, slave, port, source)

    def _check_wire(self, slave: Slave, port: str, source: Signal) -> None:
        here = slave.declaration.variables[port]
        there = self.slaves[source.slave].declaration.variables[source.variable]
        position = slave.entry.inputs[port].position
        if not units.same(here.unit, there.unit):
            message = f"block {slave.name}: input `{port}` is in {_unit(here)}, but {source} is in {_unit(there)}"
            raise WrongUnit(message, position, "wire a signal in that unit, or put a gain between")
        if here.dtype != there.dtype:
            message = f"block {slave.name}: input `{port}` is {here.dtype}, but {source} is {there.dtype}"
            raise WrongDataType(message, position, "wire a signal of that data type")

    def _check_signals(self) -> None:
        network = Network(self.diagram, self.slaves, [])
        record = self.diagram.record
        for node in record.signals if record else ():
            self._attempt(network.find, str(node.value), node.position)
        for metric in self.diagram.metrics.values():
            self._attempt(network.find, str(metric.signal.value), metric.signal.position)

    # ---- rules ----

    def _rules(self, slave: Slave) -> list[Finding]:
        findings: dict[tuple[str, str], Finding] = {}
        for rule in slave.declaration.rules:
            for member in range(slave.count):
                holds, numbers = self._judge(slave, rule, member)
                if rule.warning:
                    finding = Finding(slave.name, rule.text, rule.source, holds, numbers)
                    findings.setdefault((rule.text, numbers), finding)
                elif not holds:
                    self.problems.add(self._violation(slave, rule, numbers))
                    break
        return list(findings.values())

    def _judge(self, slave: Slave, rule: Rule, member: int) -> tuple[bool, str]:
        arguments = [self._rule_argument(slave, name, member) for name in rule.arguments]
        result = rule.function(*arguments)
        return result if isinstance(result, tuple) else (bool(result), "")

    def _rule_argument(self, slave: Slave, name: str, member: int) -> Any:
        if name in slave.axes:
            return slave.axes[name].size
        variable = slave.declaration.variables[name]
        if isinstance(variable, Input):
            sources = slave.wires.get(name)
            if not sources:
                return None
            other = self.slaves[sources[0].slave]
            parameters = {v.name: other.values[v.name] for v in other.declaration.of(Parameter)}
            unmapped = {k: v if other.fleet else v[0] for k, v in parameters.items()}
            return Source(other.declaration.name, unmapped)
        value = slave.values[name]
        own = value[member if len(value) > 1 else 0]
        return own.item() if own.shape == () else own

    def _violation(self, slave: Slave, rule: Rule, numbers: str) -> RuleViolation:
        nodes = {**slave.entry.parameters}
        node = next((nodes[a] for a in rule.arguments if a in nodes), None)
        source = f" ({rule.source})" if rule.source else ""
        message = f"block {slave.name}: {slave.declaration.name} requires {rule.text}{source}"
        fix = f"change {', '.join(a for a in rule.arguments)}" + (f"; now {numbers}" if numbers else "")
        return RuleViolation(message, node.position if node else slave.entry.position, fix)


def _or_ports(name: str, outputs: set[str]) -> str:
    return f"; its ports are {', '.join(f'{name}.{o}' for o in sorted(outputs))}" if outputs else ""


def _unit(variable: Variable) -> str:
    unit = variable.unit
    return "(" + ", ".join(unit) + ")" if isinstance(unit, tuple) else str(unit)


def signals(network: Network) -> Iterator[Signal]:
    """All variables of all slaves but inputs, in the order of the diagram."""
    for slave in network.slaves.values():
        for variable in slave.declaration.variables.values():
            if not isinstance(variable, Input):
                yield Signal(slave.name, variable.name)
