"""What the loop and exported FMUs walk: a diagram as a program of named phases over one arena of memory.

The meaning of a step. At the communication point k, the time is t = k h, and every state x has a value x(t):

    PUBLISH    sampled states that are due take the values that were computed for them: x ← x⁺
    EVENTS     foreign blocks that have reached an event begin it
    EVALUATE   outputs and locals, in the order of direct feedthrough, each as a function of t, x(t) and its inputs
    SETTLE     foreign blocks end their events with these inputs; if one had an event, EVALUATE and SETTLE once more
               probes copy what is published
    UPDATE     sampled blocks that are due compute x⁺ from what is published, which stays; histories take it
    ADVANCE    the method takes continuous states and foreign blocks from t to t + h: see its file in `methods/`

A step may be an attempt, which is judged, done anew or repeated: see `attempts`. SAVE keeps what changes, REJECT
restores it, REPEAT all but the histories of inputs, KEEP gives them what blocks publish at the step's end. RETAIN keeps
those histories, and REVIVE restores them, where a crossing is looked for in a step that is done.

Before the first step, CALCULATE has the calculated parameters, and START the start functions and the outputs at time
zero, each after what it reads; then foreign blocks end their initialization, and x⁺ ← x.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from cosim.authoring.variables import CROSSINGS, Indicator, Input, Parameter
from cosim.engine import refusals
from cosim.engine.allocation import Place
from cosim.engine.layout import Layout
from cosim.engine.methods import gauss_seidel, jacobi, joint
from cosim.engine.writer import Call, Writer
from cosim.integrators import ScipyMethod
from cosim.machine.memory import private
from cosim.master import tables, unknowns
from cosim.wiring import jumps, order
from cosim.wiring.clocks import Schedule
from cosim.wiring.network import Component, Loop, Network, Signal, Task

METHODS = {
    "jacobi": jacobi.advance,
    "gauss-seidel": gauss_seidel.advance,
    "iterated": jacobi.advance,  # which `attempts` repeats
    "joint": joint.advance,
}

LARGE = 1 << 26
"""Bytes of an arena up to which that is kept with which runs begin, and what looks at a run does so in a copy."""


@dataclass(frozen=True)
class Attempts:
    """How steps are judged and repeated, see `cosim.master.attempts`.

    starts: whether one is repeated that has nothing to extrapolate from. eventful: whether there may be time events
    between two communication points. histories: offset of their table, how many are not
    read late, and how many are judged.
    """

    tolerance: float
    repeats: int
    starts: bool
    rollback: bool
    eventful: bool
    histories: tuple[int, int, int]

    @property
    def needed(self) -> bool:
        """Whether steps are attempts."""
        return self.tolerance > 0.0 or self.repeats > 0 or self.starts or self.rollback or self.eventful


@dataclass(frozen=True)
class Watched:
    """Whose event indicators are watched: offset and size of the table.

    wanted, terminal: the offsets of which crossings count, and of which end the run.
    """

    table: int
    components: int
    wanted: int
    terminal: int


@dataclass
class Program:
    """What the loop needs of a diagram, position-independent; see `cosim.master.loop` for the columns.

    phases: the rows of each, by name. slopes: the rows of the derivatives of all states at what is published.
    started: the row after which a state is set that a start function computes. loops: algebraic loops, by the row that
    solves them. clocks: the offset of those of blocks. layout: where everything lies in the arena. image: the arena as
    a run begins with it, if that is kept; else it is as the layout says.
    """

    network: Network
    layout: Layout
    image: np.ndarray | None
    rows: np.ndarray
    banks: np.ndarray
    calls: list[Call]
    phases: dict[str, tuple[int, int]]
    slopes: list[tuple[int, int]]
    started: list[tuple[int, Signal]]
    loops: dict[int, Loop]
    clocks: int
    attempts: Attempts
    watched: Watched

    @property
    def arena(self) -> np.ndarray:
        """The arena as a run begins with it, kept from now on: who changes it changes all runs."""
        if self.image is None:
            self.image = self.begun()
        return self.image

    def begun(self, zeros: Callable[[int], np.ndarray] = private) -> np.ndarray:
        """An arena of its own for a run, in memory that `zeros` gives."""
        arena = zeros(self.layout.size)
        self.begin(arena)
        return arena

    def begin(self, arena: np.ndarray) -> None:
        """Let an arena be as a run begins with it."""
        if self.image is None:
            self.layout.write(arena)
        else:
            arena[:] = self.image

    @property
    def places(self) -> dict[Signal, Place]:
        """Where each variable lies."""
        return self.layout.places

    def time(self, tick: int) -> float:
        """The simulated time (s) of a tick, to the bit that of the loop."""
        return tick * float(self.network.schedule.tick)

    @property
    def reference(self) -> ScipyMethod | None:
        """The method of scipy's that integrates all states, in place of an integrator of ours."""
        method = self.network.diagram.run.integration.method
        return method if isinstance(method, ScipyMethod) and len(self.banks) else None

    def going_on(self, component: Component) -> dict[str, int]:
        """The offsets of the histories of inputs that go on in a step, extrapolated or interpolated."""
        several = [port for port, c in component.couplings.items() if c.order or c.interpolated]
        return {port: self.layout.histories[Signal(component.name, port)] for port in several}

    def name_of(self, bank: np.ndarray) -> str:
        """The block whose states a bank has; joint, if there are several."""
        owners = self.owners(bank)
        return owners[0].name if len(owners) == 1 else "joint"

    def owners(self, bank: np.ndarray) -> list[Component]:
        """The blocks whose states a bank has."""
        several = [component for component in self.network.components.values() if component.declaration.continuous()]
        return [c for c in several if bank[tables.BEGIN] <= self.layout.part(c)[0] < bank[tables.END]]

    def unsolved(self, row: int, arena: np.ndarray) -> tuple[float, int | None]:
        """The error with which the solver of an algebraic loop, by its row, gave up, and of which member of a fleet."""
        offset = int(self.rows[row, tables.A])
        words = arena[offset : offset + 8 * unknowns.UNKNOWNS_WORDS].view(np.int64)
        blocks, equations, work = words[[unknowns.BLOCKS, unknowns.EQUATIONS, unknowns.WORK]]
        size = blocks * equations
        vectors = arena[work : work + 8 * unknowns.UNKNOWNS_VECTORS * size].view(np.float64).reshape(-1, size)
        return float(vectors[unknowns.F, 0]), int(vectors[unknowns.R, 0]) if blocks > 1 else None

    def control(self) -> np.ndarray:
        """The words of a control block that are the same in every run; addresses are left out."""
        layout, attempts, watched, schedule = self.layout, self.attempts, self.watched, self.network.schedule
        words = np.zeros(tables.CONTROL_WORDS, np.int64)
        numbers = words.view(np.float64)
        words[tables.LOOPS], words[tables.STATES] = len(self.loops), layout.states
        words[tables.GRID], words[tables.CLOCKS] = schedule.grid, self.clocks
        words[tables.N_CLOCKS] = len(schedule.clocks) + watched.components
        words[tables.PUBLISHED], words[tables.N_PUBLISHED] = layout.published["float64"]
        words[tables.PUBLISHED32], words[tables.N_PUBLISHED32] = layout.published["float32"]
        words[tables.ATTEMPTS], words[tables.REPEATS] = attempts.needed, attempts.repeats
        words[tables.STARTS], words[tables.ROLLBACK] = attempts.starts, attempts.rollback
        words[[tables.HISTORIES, tables.N_HISTORIES, tables.N_JUDGED]] = attempts.histories
        words[tables.EVENTFUL], words[tables.DIVISIBLE] = attempts.eventful, not self.network.rigid
        words[tables.PROPOSED] = schedule.grid if attempts.rollback else 1
        words[tables.WATCHED], words[tables.N_WATCHED] = watched.table, watched.components
        words[tables.WANTED], words[tables.TERMINAL] = watched.wanted, watched.terminal
        words[tables.N_INDICATORS] = layout.indicators
        numbers[tables.TOLERANCE], numbers[tables.TICK_SIZE] = attempts.tolerance, float(schedule.tick)
        numbers[tables.STEP_SIZE] = self.network.diagram.run.step
        for name, offset in (*layout.vectors.items(), *layout.crossings.items()):
            words[getattr(tables, name)] = offset
        return words

    def phase_words(self) -> np.ndarray:
        """The first row of each phase and the one after its last, as the loop wants them."""
        return np.array([self.phases[name] for name in tables.PHASES], np.int64)

    def revalued(self, network: Network, changed: Iterable[Signal]) -> Program:
        """The same program with the values that the changed signals have in `network`, from `wiring.revalue`."""
        arena = self.begun()
        for signal in changed:
            place = self.places[signal]
            for offset, instances in self.layout.given.get(signal, ()):
                view = np.ndarray((instances, *place.shape), place.dtype, arena.data, offset)
                view[...] = network.components[signal.component].values[signal.variable]
        return replace(self, network=network, image=arena)

    def signal(self, signal: Signal, arena: np.ndarray) -> np.ndarray:
        """A signal over all instances, as a view into an arena."""
        stored = self.stored(signal, arena)
        return np.broadcast_to(stored, self.network.shape(signal)) if self.is_shared(signal) else stored

    def stored(self, signal: Signal, arena: np.ndarray) -> np.ndarray:
        """A signal as it lies in an arena, as a view: that of all instances, or the one that all share."""
        place = self.places[signal]
        shape = place.shape if self.is_shared(signal) else self.network.shape(signal)
        return np.ndarray(shape, place.dtype, arena.data, place.offset)

    def is_shared(self, signal: Signal) -> bool:
        """Whether several instances have one and the same value in memory."""
        return self.places[signal].stride == 0 and self.network.components[signal.component].count > 1

    def owner(self, offset: int) -> tuple[Signal, int, int]:
        """Whose value lies at an offset, of which instance, and which element of it (both from 0)."""
        for signal, place in (*self.layout.integrated.items(), *self.places.items()):
            declared = self.network.variable(signal)
            size = int(np.prod(self.network.shape(signal))) * place.dtype.itemsize
            if not isinstance(declared, (Parameter, Input)) and place.offset <= offset < place.offset + size:
                instance, rest = divmod(offset - place.offset, place.stride or size)
                return signal, instance, rest // place.dtype.itemsize
        raise IndexError(offset)


def build(network: Network, method: str) -> Program:
    """The program of a network for one of METHODS. Raises: DiagramErrors, FmuError."""
    writer = Writer(layout := Layout(network))
    clocks = layout.constant(_clock_words(network.schedule, len(writer.watching)))
    _write_start(writer, network.initial)
    _write_point(writer, network.evaluation)
    _write_updates(writer)
    METHODS[method](writer, network.evaluation)
    attempts, watched = _write_attempts(writer), _write_events(writer)
    made = Program(
        network=network,
        layout=layout,
        image=None,
        rows=np.array(writer.rows, np.int64).reshape(-1, tables.ROW_WORDS),
        banks=np.array(writer.banks, np.int64).reshape(-1, tables.BANK_WORDS),
        calls=writer.calls,
        phases=writer.phases,
        slopes=writer.slopes,
        started=writer.started,
        loops=writer.loops,
        clocks=clocks,
        attempts=attempts,
        watched=watched,
    )
    if layout.size <= LARGE:
        made.image = made.begun()
    return made


def _clock_words(schedule: Schedule, events: int) -> np.ndarray:
    """The clocks of blocks as the loop wants them, none of which is due yet; and those of events."""
    words = [[schedule.ticks(clock.period), schedule.ticks(clock.offset), 0] for clock in schedule.clocks]
    return np.array([*words, *([[tables.NEVER, tables.NEVER, 0]] * events)], np.int64)


def _write_start(writer: Writer, tasks: Iterable[Task | Loop]) -> None:
    """CALCULATE and START."""
    components, layout = writer.network.components.values(), writer.layout
    begin = writer.begin()
    for component in components:
        writer.call_kind(component, "calculate")
    writer.phase("CALCULATE", begin)
    begin = writer.begin()
    for task in tasks:
        writer.start(task)
    for component in components:
        writer.call_kind(component, "begin")
    for component in components:
        writer.hold(component)
    for signal, place in layout.next.items():
        writer.copy(place.offset, layout.places[signal].offset, layout.bytes_of(signal))
    writer.phase("START", begin)


def _write_point(writer: Writer, tasks: Iterable[Task | Loop]) -> None:
    """PUBLISH, EVENTS, EVALUATE, SETTLE, and TIMES, when the next event is."""
    components, layout = writer.network.components, writer.layout
    begin = writer.begin()
    for signal, place in layout.next.items():
        clock = writer.clock(components[signal.component])
        writer.copy(layout.places[signal].offset, place.offset, layout.bytes_of(signal), clock)
    for component in components.values():
        writer.hold(component, writer.clock(component))
    writer.phase("PUBLISH", begin)
    begin = writer.begin()
    for component in components.values():
        writer.call_kind(component, "events")
    writer.phase("EVENTS", begin)
    begin = writer.begin()
    writer.tasks(tasks)
    for component, port in jumps.judged(writer.network):
        writer.join(component, port, layout.fresh[Signal(component.name, port)].offset)
    writer.phase("EVALUATE", begin)
    begin = writer.begin()
    for component in components.values():
        writer.call_kind(component, "settle")
    writer.phase("SETTLE", begin)
    begin = writer.begin()
    for component in components.values():
        writer.call_kind(component, "times")
    writer.phase("TIMES", begin)


def _write_updates(writer: Writer) -> None:
    """UPDATE. A foreign block that is sampled samples what is published, as an update does, so it waits for no turn."""
    begin = writer.begin()
    for component in writer.network.components.values():
        writer.call_kind(component, "update", writer.clock(component))
        if not order.has_turn(component):
            writer.call_kind(component, "step")
        for port in component.couplings:
            writer.forget(component, port)
            writer.remember(component, port)
    writer.phase("UPDATE", begin)


def _write_attempts(writer: Writer) -> Attempts:
    """SAVE, REJECT, REPEAT, KEEP, RETAIN, REVIVE, empty where no step is judged or repeated. Raises: FmuError."""
    network, layout = writer.network, writer.layout
    several = [(c, port) for c in network.components.values() for port in c.couplings if not c.is_late(port)]
    run, stuck = network.diagram.run, network.stuck
    steep = any(c.couplings[port].order > 1 for c, port in several) and not stuck
    needed = run.method == "iterated" or (run.coupling_tolerance is not None and run.rollback) or layout.indicators
    early = any(c.declaration.early for c in network.components.values()) and not stuck and not network.rigid
    refusals.refuse_steps_of_one_size(network)
    if needed:
        refusals.refuse_what_cannot_go_back(network)
    goes_back = bool(needed or steep or early)
    histories = layout.changing - layout.repeated
    saved, kept = (layout.allocate(layout.changing), layout.allocate(histories)) if goes_back else (0, 0)
    for phase, task, to, source, size in (
        ("SAVE", "save", saved, 0, layout.changing),
        ("REJECT", "restore", 0, saved, layout.changing),
        ("REPEAT", "restore", 0, saved, layout.repeated),
        ("RETAIN", "", kept, layout.repeated, histories),
        ("REVIVE", "", layout.repeated, kept, histories),
    ):
        begin = writer.begin()
        if goes_back:
            writer.copy(to, source, size)
            for component in network.components.values():
                writer.call_kind(component, task)
        writer.phase(phase, begin)
    begin = writer.begin()
    for component, port in several if goes_back else ():
        writer.remember(component, port)
    writer.phase("KEEP", begin)
    offsets = [layout.histories[Signal(c.name, port)] for c, port in (*several, *jumps.judged(network))]
    return Attempts(
        tolerance=run.coupling_tolerance or 0.0,
        repeats=int(run.method == "iterated"),
        starts=steep,
        rollback=goes_back,
        eventful=bool(writer.phases["TIMES"][0] < writer.phases["TIMES"][1]),
        histories=(layout.constant(np.array(offsets, np.int64)), len(several), len(offsets)),
    )


def _write_events(writer: Writer) -> Watched:
    """INDICATORS and EVENT: what is reset takes its next value once all functions have seen what there was."""
    components, layout = writer.network.components, writer.layout
    begin = writer.begin()
    for component in writer.network.watched:
        writer.call_kind(component, "indicators")
    writer.phase("INDICATORS", begin)
    begin = writer.begin()
    jumping = [(signal, place, writer.watching.get(signal.component, 0)) for signal, place in layout.jumped.items()]
    for signal, place, clock in jumping:
        writer.copy(place.offset, layout.own(signal).offset, layout.bytes_of(signal), clock)
    for name, clock in writer.watching.items():
        writer.call_kind(components[name], "event", clock)
    for signal, place, clock in jumping:
        writer.copy(layout.own(signal).offset, place.offset, layout.bytes_of(signal), clock)
    writer.phase("EVENT", begin)
    rows, wanted, terminal = list[list[int]](), list[float](), list[float]()
    for name, clock in writer.watching.items():
        first = len(wanted)
        for indicator in components[name].declaration.of(Indicator):
            size = components[name].count * components[name].nbytes(indicator) // 8
            wanted += [float(CROSSINGS[indicator.crossing])] * size
            terminal += [float(indicator.terminal)] * size
        rows.append([first, len(wanted), clock])
    table, vectors = np.array(rows, np.int64), (np.array(wanted), np.array(terminal))
    return Watched(layout.constant(table), len(rows), *(layout.constant(vector) for vector in vectors))
