"""Some blocks of a wired diagram as a network of their own: the wires that the border cuts become open inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim import order, table
from cosim.errors import CosimError, NotExportable, UnknownBlock, WrongValue, nearest
from cosim.network import Network, Signal, Slave
from cosim.simulation import Simulation


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
    fleets = {network.slaves[name].fleet for name in names}
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
    slaves: dict[str, Slave] = {}
    started: dict[Signal, bool] = {}
    for name in names:
        slave = network.slaves[name]
        kept = {port: sources for port, sources in slave.wires.items() if Signal(name, port) not in opened}
        values = slave.values | {signal.variable: v for signal, v in opened.items() if signal.slave == name}
        computed = {v for f in slave.declaration.kind("start") for v in f.writes}
        started |= {Signal(name, state): state in slave.given for state in computed}
        slave = replace(slave, wires=kept, values=values, given=slave.given - computed)
        slaves[name] = _member(slave, member - 1) if fleet else slave
    return SubNetwork(Network(network.diagram, slaves), started)


def _checked(network: Network, blocks: Sequence[str]) -> list[str]:
    """The names in the diagram's order. Raises: UnknownBlock, NotExportable."""
    for name in blocks:
        if name not in network.slaves:
            message = f"the diagram has no block `{name}` to export"
            raise UnknownBlock(message, fix=nearest(name, network.slaves))
    names = [name for name in network.slaves if name in blocks or not blocks]
    for name in names:
        slave = network.slaves[name]
        if slave.entry.kind == "fmu":
            raise NotExportable(f"block {name} is an FMU already", slave.entry.position, "use that file as it is")
        if not slave.declaration.compiled:
            message = f"block {name}: {slave.declaration.name} is plain Python, which an FMU cannot hold"
            fix = "remove `compiled=False` from the class, and write results in place"
            raise NotExportable(message, slave.entry.position, fix)
    return names


def _member(slave: Slave, k: int) -> Slave:
    """One instance of a mapped slave."""
    values = {name: value[k : k + 1] if len(value) > 1 else value for name, value in slave.values.items()}
    return replace(slave, fleet=None, count=1, values=values)


def _opened(network: Network, names: list[str], single: bool) -> dict[Signal, np.ndarray]:
    """The inputs that the border opens, with the values (instances or 1, *shape) that the diagram brings at time zero.

    Zeros where the diagram cannot be initialized without being run. single: one member is exported, so that signals
    joined along the fleet come from outside.
    """
    whole = table.build(network, network.diagram.run.method)
    simulation = Simulation(whole, None)
    try:
        simulation.initialize()
    except CosimError:
        simulation.arena[:] = 0
    opened = {}
    for name in names:
        slave = network.slaves[name]
        for port, sources in slave.wires.items():
            inside = all(source.slave in names for source in sources)
            if inside and not (single and order.is_joined(slave, port)):
                continue
            place = whole.places[Signal(name, port)]
            instances = slave.count if place.stride else 1
            opened[Signal(name, port)] = np.stack([place.view(simulation.arena, k) for k in range(instances)])
    return opened
