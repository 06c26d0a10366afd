"""The communication point that somebody wants to look at: at a time, where a condition holds, or a run fails."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from cosim.compiling.kernels import Kernels
from cosim.engine.hand_run import HandRun
from cosim.engine.probes import Probes
from cosim.engine.program import Program
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError, FormulaError, Position, WrongValue
from cosim.language import places
from cosim.language.formula import parse
from cosim.language.formula_tree import is_instant, mentions
from cosim.language.requirement import RequirementEntry, told
from cosim.language.source import Node
from cosim.requirements.judges import course
from cosim.requirements.margins import margin
from cosim.requirements.terms import Seen
from cosim.wiring import required

BEYOND = 1e-9
"""Of a step: as near as that before a communication point, a time is that point."""


@dataclass(frozen=True)
class Halt:
    """A communication point. tick: which; why: in words; error: what the run fails with behind it, if it does.

    component: whose fault that is, "" where it is nobody's.
    """

    tick: int
    why: str
    error: CosimError | None = None
    component: str = ""


def at(program: Program, time: float) -> Halt:
    """The last communication point that is not after a time (s). Raises: WrongValue for one that is not in the run."""
    run = program.network.diagram.run
    if not 0.0 <= time <= run.stop * (1.0 + BEYOND):
        raise WrongValue(
            f"there is no {time:g} s in a run of {run.stop:g} s", fix="a time within it, or a larger --stop"
        )
    step = min(math.floor(time / run.step + BEYOND), run.steps)
    return Halt(step * program.network.schedule.grid, f"asked for {time:g} s")


def first(program: Program, kernels: Kernels, text: str) -> Halt | None:
    """The first communication point at which a condition holds, of any member; None if it never does.

    Raises: FormulaError, UnknownBlock, UnknownPort, WrongUnit; as `Simulation.batches` where the run fails before.
    """
    network = program.network
    formula = Node(text, Position("--when"))
    place = partial(places.within, formula)
    condition = parse(text, place)
    if not is_instant(condition):
        fix = "a condition of one instant, such as plant.x > 1"
        raise FormulaError("`--when` takes no always, eventually or until", place(0), fix)
    signals = {mention.signal: Node(mention.signal, place(mention.at)) for mention in mentions(condition)}
    entry = RequirementEntry("--when", formula, condition, False, signals, formula.position)
    scope = required.scope(network, entry)
    wanted = margin(condition, scope)
    seen: list[Seen] = [scope.look(name, node.position) for name, node in signals.items()]
    if not seen:
        raise FormulaError("the condition names no signal", place(0), "write block.port, such as plant.x > 1")
    keys = tuple(dict.fromkeys(one.key for one in seen))
    grid = network.schedule.grid
    simulation = Simulation(program, kernels, [Probes(keys, grid)])  # type: ignore[arg-type]
    try:
        simulation.initialize()
        for (samples,) in simulation.batches():
            try:
                holds = course(wanted, samples.times, samples.values) > 0.0  # type: ignore[arg-type]
            except FormulaError as error:
                error.position = place(0)
                raise told("--when", error) from None
            rows = np.flatnonzero(holds.reshape(len(holds), -1).any(axis=1))
            if rows.size:
                time = float(samples.times[rows[0]])
                step = min(round(time / network.diagram.run.step), network.diagram.run.steps)
                return Halt(step * grid, f"{text}, first at t = {time:g} s")
    finally:
        simulation.close()
    return None


def failure(program: Program, kernels: Kernels) -> Halt | None:
    """The last communication point that a run comes to before it fails; None if it comes to its end."""
    simulation = HandRun(program, kernels)
    try:
        simulation.initialize()
        simulation.go_to(simulation.ticks)
    except CosimError as error:
        places_of = {c.entry.position: c.name for c in program.network.components.values()}
        component = places_of.get(error.position, "") if error.position else ""
        grid = program.network.schedule.grid
        return Halt(simulation.done - simulation.done % grid, error.message, error, component)
    finally:
        simulation.close()
    return None
