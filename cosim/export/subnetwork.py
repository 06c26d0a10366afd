"""Some blocks of a wired diagram as a network of their own: the wires that the border cuts become open inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.engine import program
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError, DiagramErrors, NotExportable, UnknownBlock, WrongValue, nearest
from cosim.integrators import REFERENCES
from cosim.wiring import jumps, order
from cosim.wiring.clocks import Clock, exact
from cosim.wiring.network import Component, Network, Signal


@dataclass(frozen=True)
class SubNetwork:
    """A network without cut wires; `started` has the states that `start` functions compute unless they are given.

    `start` functions would overwrite given values, so `given` names none of these states: an FMU decides at run time.
    """

    network: Network
    started: dict[Signal, bool]  # whether the diagram gives the state's value


def cut(network: Network, blocks: Sequence[str], member: int) -> SubNetwork:
    """The blocks (none: all), as one member of their fleet if all are mapped by the same one.

    member: counts from 1. Raises: UnknownBlock, NotExportable, WrongValue.
    """
    names = _checked(network, blocks)
    fleets = {network.components[name].fleet for name in names}
    fleet = fleets.pop() if len(fleets) == 1 else None
    if fleet and not 1 <= member <= network.diagram.fleets[fleet]:
        message = f"there is no {fleet} {member} in a fleet of {network.diagram.fleets[fleet]}"
        raise WrongValue(message, fix=f"choose --member 1 … {network.diagram.fleets[fleet]}")
    if not fleet and member != 1:
        message = (
            f"there is no member {member}: {', '.join(names)} {'is' if len(names) == 1 else 'are'} not of one fleet"
        )
        raise WrongValue(message, fix="leave out --member")
    opened = _opened(network, names, single=fleet is not None)
    components: dict[str, Component] = {}
    started: dict[Signal, bool] = {}
    for name in names:
        component = _timed(network.components[name], alone=len(names) == 1)
        kept = {port: sources for port, sources in component.wires.items() if Signal(name, port) not in opened}
        values = component.values | {signal.variable: v for signal, v in opened.items() if signal.component == name}
        computed = {v for f in component.declaration.kind("start") for v in f.writes}
        started |= {Signal(name, state): state in component.given for state in computed}
        couplings = {port: coupling for port, coupling in component.couplings.items() if port in kept}
        component = replace(component, wires=kept, couplings=couplings, values=values, given=component.given - computed)
        components[name] = _member(component, member - 1) if fleet else component
    inside = Network(network.diagram, components)
    jumps.settle(inside)
    _sample_late(inside)
    return SubNetwork(_ordered(inside), started)


def _sample_late(cut: Network) -> None:
    """Have importers stop at every step of the diagram's, at which wires that bring something late take samples.

    Raises: NotExportable where something is not read before the diagram's end, for which there is no room.
    """
    run = cut.diagram.run
    for component in cut.components.values():
        for port, coupling in component.couplings.items():
            if coupling.delay > exact(run.stop):
                message = f"block {component.name}: `{port}` is read later than the diagram's end"
                place = component.entry.inputs[port].beside["delay"].place
                raise NotExportable(message, place, f"a run.stop of {float(coupling.delay):g} s or more")
            if component.is_late(port):
                component.couplings[port] = replace(coupling, jumps=(*coupling.jumps, Clock(exact(run.step))))


def _ordered(cut: Network) -> Network:
    """Raises: NotExportable where start values break a loop at initialization, as an importer may give none."""
    try:
        return order.ordered(cut)
    except DiagramErrors as loops:
        error, fix = loops.errors[0], "export its blocks one by one, and let the importer solve it"
        raise NotExportable(f"as one FMU, there is an {error.message}", error.position, fix) from None


def _checked(network: Network, blocks: Sequence[str]) -> list[str]:
    """The names in the diagram's order. Raises: UnknownBlock, NotExportable."""
    for name in blocks:
        if name not in network.components:
            message = f"the diagram has no block `{name}` to export"
            raise UnknownBlock(message, fix=nearest(name, network.components))
    run = network.diagram.run
    if run.integrator in REFERENCES:
        message = f"`{run.integrator}` is scipy's, which an FMU cannot hold"
        raise NotExportable(message, run.nodes["integrator"].place, "choose an integrator of ours, such as rodas5p")
    names = [name for name in network.components if name in blocks or not blocks]
    for name in names:
        component = network.components[name]
        if component.entry.kind == "fmu":
            raise NotExportable(f"block {name} is an FMU already", component.entry.position, "use that file as it is")
        if not component.declaration.compiled:
            message = f"block {name}: {component.declaration.name} is plain Python, which an FMU cannot hold"
            fix = "remove `compiled=False` from the class, and write results in place"
            raise NotExportable(message, component.entry.position, fix)
    return names


def _timed(component: Component, alone: bool) -> Component:
    """A block that is exported alone leaves its period to who runs it, unless its `update` needs it.

    Raises: NotExportable.
    """
    if alone and not component.declaration.kind("update"):
        return replace(component, clock=None)
    if component.samples_inputs:
        message = f"block {component.name}: its period keeps it from being exported together with others"
        fix = "export it alone, and give the FMU its period in the diagram that runs it"
        raise NotExportable(message, component.entry.settings["period"].key_position, fix)
    return component


def _member(component: Component, k: int) -> Component:
    """One instance of a mapped component."""
    values = {name: value[k : k + 1] if len(value) > 1 else value for name, value in component.values.items()}
    return replace(component, fleet=None, count=1, values=values)


def _opened(network: Network, names: list[str], single: bool) -> dict[Signal, np.ndarray]:
    """The inputs that the border opens, with the values (instances or 1, *shape) that the diagram brings at time zero.

    Zeros where the diagram cannot be initialized without being run. single: one member is exported, so that signals
    joined along the fleet come from outside.
    """
    whole = program.build(network, network.diagram.run.method)
    simulation = Simulation(whole, None)
    try:
        simulation.initialize()
    except CosimError:
        simulation.arena[:] = 0
    opened = {}
    for name in names:
        component = network.components[name]
        for port, sources in component.wires.items():
            inside = all(source.component in names for source in sources)
            if inside and not (single and component.is_joined(port)):
                continue
            place = whole.places[Signal(name, port)]
            instances = component.count if place.stride else 1
            opened[Signal(name, port)] = np.stack([place.view(simulation.arena, k) for k in range(instances)])
    return opened
