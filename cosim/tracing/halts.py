"""The communication point that somebody wants to look at: at a time, where a condition holds, or a run fails."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cosim.compiling.kernels import Kernels
from cosim.engine.hand_run import HandRun
from cosim.engine.probes import Probes, Samples
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
from cosim.wiring import required

BEYOND = 1e-9
"""Of a step: as near as that before a communication point, a time is that point."""


@dataclass(frozen=True)
class Halt:
    """A communication point. tick: which; None: before a run is initialized. why: in words.

    fails: whether the run fails soon behind it; component: by whose fault, "" where it is nobody's.
    """

    tick: int | None
    why: str
    fails: bool = False
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

    Where the run fails before, as of `failure`. Raises: FormulaError, UnknownBlock, UnknownPort, WrongUnit.
    """
    network = program.network
    formula = Node(text, Position("--when"))
    place = partial(places.within, formula)
    condition = parse(text, place)
    if not is_instant(condition):
        fix = "a condition of one instant, such as plant.x > 1"
        raise FormulaError("`--when` takes no always, eventually or until", place(0), fix)
    signals = {mention.signal: Node(mention.signal, place(mention.at)) for mention in mentions(condition)}
    if not signals:
        raise FormulaError("the condition names no signal", place(0), "write block.port, such as plant.x > 1")
    entry = RequirementEntry("--when", formula, condition, False, signals, formula.position)
    scope = required.scope(network, entry)
    wanted = margin(condition, scope)
    keys: dict[Any, None] = {scope.look(name, node.position).key: None for name, node in signals.items()}
    simulation = Simulation(program, kernels, [Probes(tuple(keys), network.schedule.grid)])
    try:
        simulation.initialize()
        for (samples,) in simulation.batches():
            holds = course(wanted, samples.times, samples.values) > 0.0  # type: ignore[arg-type]
            rows = np.flatnonzero(holds.reshape(len(holds), -1).any(axis=1))
            if rows.size:
                return Halt(at(program, float(samples.times[rows[0]])).tick, f"{text}, first at {_time(samples, rows)}")
    except FormulaError as error:
        error.position = place(0)
        raise told("--when", error) from None
    except CosimError:
        return failure(program, kernels)
    finally:
        simulation.close()
    return None


def _time(samples: Samples, rows: np.ndarray) -> str:
    return f"t = {samples.times[rows[0]]:g} s"


def failure(program: Program, kernels: Kernels) -> Halt | None:
    """The last communication point but one that a run comes to before it fails; None if it comes to its end.

    The last one may be where it fails.
    """
    simulation = HandRun(program, kernels)
    try:
        simulation.initialize()
        simulation.go_to(simulation.ticks)
    except CosimError as error:
        places_of = {c.entry.position: c.name for c in program.network.components.values()}
        grid = program.network.schedule.grid
        tick = (simulation.done - 1) // grid * grid if simulation.done else None
        return Halt(tick, error.message, True, places_of.get(error.position, "") if error.position else "")
    finally:
        simulation.close()
    return None
