"""A resolved diagram: components with their axes, values and wires, and the signals that they exchange."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from cosim.authoring.declaration import Declaration, Function
from cosim.authoring.variables import Indicator, Input, OpenDimension, State, Variable
from cosim.errors import Position, UnknownBlock, UnknownPort, nearest
from cosim.integrators import Integration
from cosim.language.diagram import BlockEntry, Diagram
from cosim.language.reader import endpoint
from cosim.language.swaps import Swap
from cosim.wiring import meaning
from cosim.wiring.clocks import Clock, Schedule, schedule


@dataclass(frozen=True)
class Axis:
    """The size of one axis of a signal, and the fleet whose members it counts."""

    size: int
    fleet: str | None = None


@dataclass(frozen=True)
class Signal:
    """One variable of one component; a wire may take some members of its first axis only.

    members: the first and the last one, from 1; a single number is that member without the axis.
    """

    component: str
    variable: str
    members: tuple[int, int] | int | None = None

    @property
    def whole(self) -> Signal:
        """The variable with all its members."""
        return Signal(self.component, self.variable)

    @property
    def first(self) -> int:
        """How many members come before those that are taken."""
        return (self.members[0] if isinstance(self.members, tuple) else self.members or 1) - 1

    def axes(self, axes: tuple[Axis, ...]) -> tuple[Axis, ...]:
        """What is left of the axes of the whole variable."""
        if self.members is None:
            return axes
        if isinstance(self.members, int):
            return axes[1:]
        return (Axis(self.members[1] - self.members[0] + 1), *axes[1:])

    def __str__(self) -> str:
        members = self.members if isinstance(self.members, int) else "..".join(map(str, self.members or ()))
        return f"{self.component}.{self.variable}" + (f"[{members}]" if members else "")


def port_and_members(text: str) -> tuple[str, tuple[int, int] | int | None]:
    """A port's name, and the members that a wire takes: `u[1..5]`, or `u[6]` for one without the axis."""
    match = re.fullmatch(r"(.+)\[(\d+)(?:\.\.(\d+))?\]", text)
    if not match or not 1 <= int(match[2]) <= int(match[3] or match[2]):
        return text, None
    return match[1], (int(match[2]), int(match[3])) if match[3] else int(match[2])


@dataclass
class Finding:
    """Something worth knowing of a valid diagram: a theorem's condition, a delay that a swap brings.

    holds: None where nobody can say.
    """

    component: str
    text: str
    source: str
    holds: bool | None
    numbers: str

    @property
    def name(self) -> str:
        """Block, source and condition, which do not depend on the run."""
        return f"{self.component}: {self.source or 'condition'}, {self.text}"

    @property
    def summary(self) -> str:
        """One line: its name, and the numbers."""
        return f"{self.name}: {self.numbers}" if self.numbers else self.name


@dataclass(frozen=True)
class Coupling:
    """How an input is read: as it was so long ago (s), or extrapolated to an order between communication points.

    interpolated: where a step is repeated, also by what its source gives at the end. Of what is late, see `jumps`:
    shift: the delay (s) as a multiple of the schedule's ticks, no shorter; jumps: the clocks by which it jumps.
    """

    delay: Fraction = Fraction(0)
    order: int = 0
    interpolated: bool = False
    shift: Fraction = Fraction(0)
    jumps: tuple[Clock, ...] = ()


@dataclass
class Component:
    """One block of a diagram, wired. Values have the shape (instances or 1, *shape of the variable).

    axes: by the name of the dimension; of an open one, its elements as one axis. opened: the axes of an open one; where
    only their number is known, one axis, or none for one element. clock: when it is due; None: at every communication
    point.
    """

    name: str
    entry: BlockEntry
    declaration: Declaration
    fleet: str | None = None
    count: int = 1
    axes: dict[str, Axis] = field(default_factory=dict)
    opened: dict[str, tuple[Axis, ...]] = field(default_factory=dict)
    values: dict[str, np.ndarray] = field(default_factory=dict)
    given: set[str] = field(default_factory=set)
    wires: dict[str, tuple[Signal, ...]] = field(default_factory=dict)
    couplings: dict[str, Coupling] = field(default_factory=dict)
    clock: Clock | None = None
    integration: Integration = field(default_factory=Integration)

    def own_axes(self, variable: Variable) -> tuple[Axis, ...]:
        """The axes of a variable in one instance, whose dimensions are solved."""
        return tuple(axis for d in variable.shape for axis in self.axes_of(d))

    def axes_of(self, dimension: int | str) -> tuple[Axis, ...]:
        """The axes of a dimension that is solved: one, but of an open one those that there are."""
        if isinstance(dimension, int):
            return (Axis(dimension),)
        if isinstance(dimension, OpenDimension):
            alone = () if self.axes[dimension].size == 1 else (self.axes[dimension],)
            return self.opened.get(dimension, alone)
        return (self.axes[dimension],)

    def shape(self, variable: Variable) -> tuple[int, ...]:
        """The shape of a variable in one instance."""
        return tuple(axis.size for axis in self.own_axes(variable))

    def seen_shape(self, variable: Variable) -> tuple[int, ...]:
        """The shape in which functions see a variable: an open dimension is one axis, of 1 for a scalar."""
        return tuple(d if isinstance(d, int) else self.axes[d].size for d in variable.shape)

    def nbytes(self, variable: Variable) -> int:
        """The size of a variable in one instance."""
        return math.prod(self.shape(variable)) * int(variable.dtype.itemsize)

    def signal_axes(self, variable: Variable) -> tuple[Axis, ...] | None:
        """The axes of a variable over all instances; None while a dimension is not solved."""
        if any(isinstance(d, str) and d not in self.axes for d in variable.shape):
            return None
        own = self.own_axes(variable)
        return (Axis(self.count, self.fleet), *own) if self.fleet else own

    @property
    def is_sampled(self) -> bool:
        """Whether its outputs change at its sample times only; beside `derivatives`, an `update` alone does."""
        updates, flows = self.declaration.kind("update"), self.declaration.kind("derivatives")
        return self.declaration.sampled or bool(updates and not flows) or (self.clock is not None and not updates)

    @property
    def samples_inputs(self) -> bool:
        """Whether what goes on in it between its sample times sees its inputs as they were at the last one."""
        return (
            self.clock is not None
            and self.is_sampled
            and bool(self.declaration.continuous() or self.declaration.kind("step"))
        )

    def is_joined(self, port: str) -> bool:
        """Whether an input is copied to memory of its own.

        So is what several sources bring along a fleet, what is sampled, read late or extrapolated, and an output of the
        same block, which the function that reads it may be about to write.
        """
        if self.samples_inputs or port in self.couplings:
            return True
        own = [source.variable for source in self.wires.get(port, ()) if source.component == self.name]
        outputs = [name for name in own if not isinstance(self.declaration.variables[name], State)]
        return isinstance(self.entry.inputs[port].value, list) or bool(outputs)

    def source(self, name: str) -> Signal:
        """What is behind a name in a function: the one source of an input, else the component's own variable."""
        wires = self.wires.get(name, ())
        return wires[0].whole if wires and not self.is_joined(name) else Signal(self.name, name)

    def is_late(self, port: str) -> bool:
        """Whether an input is what was there some time ago."""
        return port in self.couplings and self.couplings[port].delay > 0

    def constants(self) -> dict[str, int]:
        """The dimensions that are compiled into kernels, unless a fleet sets them: those of ports, of members all."""
        told = (v for v in self.declaration.variables.values() if self.count > 1 or v.causality in ("input", "output"))
        names = dict.fromkeys(d for v in told for d in v.shape if isinstance(d, str))
        return {name: self.axes[name].size for name in names if self.axes[name].fleet is None}


@dataclass(frozen=True)
class Task:
    """One function of one component, or (function "") the joining of the sources of one of its inputs."""

    component: str
    function: str
    port: str = ""


@dataclass(frozen=True)
class Loop:
    """Tasks that depend on each other at one instant, in order, and the signals whose values are solved for."""

    tasks: tuple[Task, ...]
    torn: tuple[Signal, ...]


@dataclass
class Network:
    """A resolved diagram. unchecked: blocks that are left out, as their code was not to be run.

    recorded: what is written to the result; reduced: the signal of each metric, by the metric's name.
    initial, evaluation: the order of what is done at time zero, and at every communication point; see `order`.
    stops: when the master stops besides, where nothing is due.
    """

    diagram: Diagram
    components: dict[str, Component]
    swaps: list[Swap] = field(default_factory=list)
    unchecked: list[str] = field(default_factory=list)
    recorded: tuple[Signal, ...] = ()
    reduced: dict[str, Signal] = field(default_factory=dict)
    initial: tuple[Task | Loop, ...] = ()
    evaluation: tuple[Task | Loop, ...] = ()
    stops: tuple[Clock, ...] = ()

    @cached_property
    def schedule(self) -> Schedule:
        """When the master stops."""
        run, several = self.diagram.run, self.components.values()
        couplings = [coupling for component in several for coupling in component.couplings.values()]
        jumps = [jump for coupling in couplings for jump in coupling.jumps]
        clocks = [*(component.clock for component in several), *jumps, *self.stops]
        return schedule(run.step, clocks, self.smallest_step)

    def revalued(self, components: dict[str, Component]) -> Network:
        """The same network with other values, on which no time depends."""
        new = replace(self, components=components)
        vars(new)["schedule"] = self.schedule
        return new

    @property
    def smallest_step(self) -> float | None:
        """How short (s) a communication step may become; None where all are of one size."""
        run = self.diagram.run
        return (run.smallest_step or run.step / 1024) if run.coupling_tolerance else None

    def variable(self, signal: Signal) -> Variable:
        """The declaration of a signal."""
        return self.components[signal.component].declaration.variables[signal.variable]

    def function(self, task: Task) -> Function:
        """The function of a task that is no join."""
        return next(f for f in self.components[task.component].declaration.functions if f.name == task.function)

    def clock(self, task: Task) -> Clock | None:
        """The clock by which a task is done; None: at every communication point."""
        component = self.components[task.component]
        return component.clock if (component.is_sampled if task.function else component.samples_inputs) else None

    def is_held(self, task: Task) -> bool:
        """Whether a task is done at communication points and events only."""
        component = self.components[task.component]
        return component.is_sampled or bool(task.function and self.function(task).held)

    def read(self, task: Task) -> list[Signal]:
        """What a task reads; a join, its sources."""
        component = self.components[task.component]
        if not task.function:
            return [source.whole for source in component.wires[task.port]]
        return [component.source(name) for name in self.function(task).reads]

    def written(self, task: Task) -> list[Signal]:
        """What a task writes; a join, its port."""
        names = sorted(self.function(task).writes) if task.function else [task.port]
        return [Signal(task.component, name) for name in names]

    @property
    def has_foreign(self) -> bool:
        """Whether FMUs are among the blocks."""
        return any(component.declaration.foreign for component in self.components.values())

    @cached_property
    def stuck(self) -> list[Component]:
        """The foreign blocks that cannot go back to a state, so that no step can be done anew."""
        foreign = [component for component in self.components.values() if component.declaration.foreign]
        return [component for component in foreign if not component.declaration.kind("restore")]

    @cached_property
    def rigid(self) -> list[Component]:
        """The foreign blocks that take steps of one size only, so that no step can end at an event."""
        return [c for c in self.components.values() if c.declaration.rigid and not c.declaration.sampled]

    @cached_property
    def watched(self) -> list[Component]:
        """The components with event indicators; foreign ones look for themselves where no step can be done anew.

        Where steps are of one size only, what changes nothing but where they end is not looked for.
        """
        several = [c for c in self.components.values() if any(c.declaration.of(Indicator))]
        if self.rigid:
            several = [
                c
                for c in several
                if c.declaration.kind("event") or any(i.terminal for i in c.declaration.of(Indicator))
            ]
        return [c for c in several if not (c.declaration.foreign and (self.stuck or self.rigid))]

    def shape(self, signal: Signal) -> tuple[int, ...]:
        """The shape of a signal over all instances."""
        return tuple(axis.size for axis in self.axes(signal))

    def axes(self, signal: Signal) -> tuple[Axis, ...]:
        """The axes of a signal over all instances."""
        axes = self.components[signal.component].signal_axes(self.variable(signal))
        assert axes is not None
        return signal.axes(axes)

    def find(self, text: str, position: Position | None) -> Signal:
        """The signal that a recording or metric names; any variable but inputs that read one.

        Raises: UnknownBlock, UnknownPort.
        """
        name, port = endpoint(text)
        if name not in self.components:
            fix = nearest(name, self.components)
            raise UnknownBlock(f"`{text}`: the diagram has no block `{name}`", position, fix)
        component, declaration = self.components[name], self.components[name].declaration
        variable = declaration.variables.get(port)
        if sources := component.wires.get(port):
            message = f"`{text}`: what an input reads is recorded where it comes from"
            raise UnknownPort(message, position, f"name {', '.join(map(str, sources))}")
        if variable is None or not (_can_record(variable) or isinstance(variable, Input)):
            message = f"`{text}`: block {name} has no variable `{port}` to record"
            known = [k for k, v in declaration.variables.items() if _can_record(v)]
            raise UnknownPort(message, position, meaning.usual_fix(declaration, port, known))
        return Signal(name, port)

    def signals(self) -> Iterator[Signal]:
        """All variables of all components but inputs, in the order of the diagram."""
        for component in self.components.values():
            for variable in component.declaration.variables.values():
                if _can_record(variable):
                    yield Signal(component.name, variable.name)


def _can_record(variable: Variable) -> bool:
    """Inputs are other blocks' signals or constants, and texts and event indicators are no signals."""
    return not isinstance(variable, (Indicator, Input)) and not variable.dtype.hasobject
