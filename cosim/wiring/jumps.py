"""When what a wire brings jumps: where a sampled block behind it is due, later by the delays on the way.

The master stops where an input jumps that is read late, so that no step of an integrator has a jump inside.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from cosim.authoring.variables import CalculatedParameter, Parameter, Period, State
from cosim.wiring.clocks import MOST_TICKS, Clock, common, exact, schedule
from cosim.wiring.network import Component, Coupling, Network, Signal, Task
from cosim.wiring.order import needed_outputs

FINEST = 2**30  # parts of a tick: 1e-9 of it, as near as which a time is that of a sample
ECHOES = 32  # how often a way back leads through one wire that is late


@dataclass(frozen=True)
class Behind:
    """What a wire depends on at one instant.

    clocks: by which it jumps, also from start values; strikes: whether it does at other times too, such as an event's.
    flows: whether it changes between two jumps. states: those behind it that are integrated, and by how much it is
    later than they are (s).
    """

    clocks: tuple[Clock, ...]
    strikes: bool
    flows: bool
    states: tuple[tuple[Signal, Fraction], ...] = ()


def settle(network: Network) -> None:
    """Fill in of `Coupling` how long a delay is for the schedule, and the clocks by which inputs that are late jump."""
    late = [(c, port) for c in network.components.values() for port in c.couplings if c.is_late(port)]
    if not late:
        return
    unit = _unit(network, [component.couplings[port].delay for component, port in late])
    for component, port in late:
        coupling = component.couplings[port]
        component.couplings[port] = replace(coupling, shift=math.ceil(coupling.delay / unit) * unit)
    for component, port in late:
        found = tuple(_jumps(network, component, port))
        component.couplings[port] = replace(component.couplings[port], jumps=found)


def behind(network: Network, component: Component, port: str) -> Behind:
    """What the sources of an input depend on, the nearest ways first."""
    clocks, echoes = dict[Clock, None](), Counter[Signal]()
    waiting = deque((source.whole, Fraction(0)) for source in component.wires[port])
    seen, strikes, flows, states = set(waiting), False, False, list[tuple[Signal, Fraction]]()
    while waiting:
        signal, shift = waiting.popleft()
        there = network.components[signal.component]
        if signal.variable not in there.wires and _holds(there, signal.variable):
            clock = there.clock and there.clock.later(shift)
            strikes |= clock is None or there.declaration.variables.get(signal.variable) in there.declaration.jumping()
            if clock and not any(clock.follows(other) for other in clocks):
                clocks[clock] = None
            continue
        if there.declaration.variables.get(signal.variable) in there.declaration.continuous():
            states.append((signal, shift))
        if there.is_late(signal.variable):
            shift += there.couplings[signal.variable].shift
            echoes[signal] += 1
            if signal.variable in there.given:
                clocks[_once(network, shift)] = None
        writer = there.declaration.writer(signal.variable)
        strikes |= writer is not None and writer.held
        reads, changes = _reads(network, signal)
        flows |= changes
        for read in reads if echoes[signal] <= ECHOES else ():
            if (read, shift) not in seen:
                seen.add((read, shift))
                waiting.append((read, shift))
    return Behind(tuple(clocks), strikes, flows, tuple(states))


def breaks(network: Network, component: Component, port: str) -> list[Clock]:
    """The clocks by which an input goes on otherwise than before: it jumps, or, for a parabola, has a corner."""
    found, order = behind(network, component, port), component.couplings[port].order
    corners = _corners(network, found) if order > 1 else ()
    return [*dict.fromkeys((*found.clocks, *corners))]


def flows(network: Network, component: Component, port: str) -> bool:
    """Whether what an input reads is real and changes between two jumps, so that there are values in between."""
    return component.declaration.variables[port].dtype == np.float64 and behind(network, component, port).flows


def judged(network: Network) -> list[tuple[Component, str]]:
    """The inputs that are read late on lines, by whose bends a tolerance chooses steps; none where none is given."""
    late = [(c, port) for c in network.components.values() for port in c.couplings if c.is_late(port)]
    tolerance = network.diagram.run.coupling_tolerance
    return [(c, port) for c, port in late if tolerance is not None and flows(network, c, port)]


def are_met(network: Network, component: Component, port: str) -> bool:
    """Whether steps end wherever an input jumps that is read late."""
    coupling = component.couplings[port]
    missed = network.rigid and coupling.shift != coupling.delay
    return not (missed or behind(network, component, port).strikes)


def room(network: Network, coupling: Coupling) -> int:
    """How many samples are kept of what is read late: those of its delay, and one on either side."""
    return network.schedule.most_points(min(coupling.delay, exact(network.diagram.run.stop))) + 2


def _holds(there: Component, name: str) -> bool:
    """Whether a variable that is no wired input changes at sample times only."""
    variable = there.declaration.variables.get(name)
    return there.is_sampled or (isinstance(variable, State) and variable not in there.declaration.continuous())


def _reads(network: Network, signal: Signal) -> tuple[Iterable[Signal], bool]:
    """What a signal depends on at one instant, and whether it changes by itself too."""
    there = network.components[signal.component]
    variable = there.declaration.variables.get(signal.variable)
    if signal.variable in there.wires:
        return [source.whole for source in there.wires[signal.variable]], False
    if writer := there.declaration.writer(signal.variable):
        return network.read(Task(there.name, writer.name)), there.declaration.foreign is not None
    return (), not isinstance(variable, (Parameter, CalculatedParameter, Period))


def _jumps(network: Network, component: Component, port: str) -> list[Clock]:
    """The clocks by which an input that is read late jumps between two samples of the block itself, if any."""
    run, coupling = network.diagram.run, component.couplings[port]
    if component.is_sampled or coupling.delay > exact(run.stop):
        return []
    clocks = [clock.later(coupling.shift) for clock in behind(network, component, port).clocks]
    if port in component.given and all(clock.offset > coupling.shift for clock in clocks):
        clocks.append(_once(network, coupling.shift))
    return clocks


def _corners(network: Network, found: Behind) -> Iterable[Clock]:
    """The clocks by which a slope jumps, as the derivative of a state does."""
    for state, shift in found.states:
        there = network.components[state.component]
        driving = [f for f in there.declaration.kind("derivatives") if f"d_{state.variable}" in f.writes]
        reads = (name for function in (*needed_outputs(there), *driving) for name in function.reads)
        for name in {*reads} & {*there.wires}:
            late = there.is_late(name)
            clocks = there.couplings[name].jumps if late else behind(network, there, name).clocks
            yield from (clock.later(shift) for clock in clocks)


def _once(network: Network, time: Fraction) -> Clock:
    """When an input that is read late leaves its start value, at a time (s)."""
    run = network.diagram.run
    return Clock((run.steps + 1) * exact(run.step), time)


def _unit(network: Network, delays: Iterable[Fraction]) -> Fraction:
    """What delays are multiples of (s), rounded up where ticks would become too short else.

    That is where a run would have too many of them, or where steps vary down to one. Where a block takes steps of one
    size only, it is the step.
    """
    run, clocks = network.diagram.run, [c.clock for c in network.components.values() if c.clock]
    if network.rigid:
        return exact(run.step)
    coarse = schedule(run.step, clocks, network.smallest_step).tick
    kept = [delay for delay in delays if delay <= exact(run.stop)]
    longest = max(exact(run.stop), *(clock.period + clock.offset for clock in clocks), Fraction(0)) + sum(kept)
    fine = common([exact(run.step), *(time for c in clocks for time in (c.period, c.offset)), *kept])
    if longest < MOST_TICKS * fine and fine >= (network.smallest_step or 0.0):
        return fine
    parts = 1
    while network.smallest_step is None and parts < FINEST and 2 * parts * longest < MOST_TICKS * coarse:
        parts *= 2
    return coarse / parts
