"""What a run spends its time on: each function of each block, integration, copies, figures, recording, and its start.

The total is that of the run itself, which nothing slows. What of it is whose is measured in a second run of the same
program, whose calls are timed, see `timed_rows`; of a short run in several, of which the quickest counts.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from cosim.engine import compilation
from cosim.engine.run import Run
from cosim.engine.simulation import Simulation
from cosim.machine.stopwatch import START
from cosim.master import tables
from cosim.profiling.timed_rows import Timed, TimedRows

MEASURED = (
    "The total is that of the run itself. Calls, copies and integrations were timed in further runs of the same steps, "
    "less what reading the clock takes. The rest is the loop's own, which walks the program, checks numbers, takes "
    "samples, and looks for crossings and solutions; and by how much those runs differ, as a busy machine has them do."
)
REST = "the loop itself, and the rest"
#: So many further runs are made at most, and no other once they have taken so long (s): pauses hit some of them only.
MOST_ROUNDS, SHORT = 5, 1.0
#: What calls of a block's function take, and what has no function, by both names.
Costs = dict[tuple[str, str], Timed]
_ATTEMPTS = ("SAVE", "REJECT", "REPEAT", "KEEP", "RETAIN", "REVIVE")


@dataclass(frozen=True)
class Cost:
    """What something takes. name: a block, or what else it is, then without a function. share: of the total.

    calls, microseconds: per communication step; calls is None for what is no call.
    """

    name: str
    function: str
    calls: float | None
    microseconds: float
    share: float


@dataclass(frozen=True)
class Compiled:
    """A module of compiled functions: seconds that it took to compile, 0 if it was in the cache."""

    name: str
    seconds: float
    cached: bool


@dataclass(frozen=True)
class Profile:
    """microseconds: a step's, of which the costs are parts, the largest first. start: seconds of each of its parts.

    measured: how, in words. vectors: functions that are done for eight members of a fleet at a time; alone: by function
    of a fleet, why it is not.
    """

    steps: int
    microseconds: float
    costs: tuple[Cost, ...]
    compiled: tuple[Compiled, ...]
    start: dict[str, float]
    vectors: tuple[str, ...]
    alone: dict[str, str]
    measured: str = MEASURED

    def as_json(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def profile(run: Run) -> Profile:
    """Where the time of a compiled run went that has come to its end, not from a checkpoint.

    Raises: UsageError without a clock, and what the run itself may raise.
    """
    plain, steps = run.simulation, max(run.simulation.steps, 1)
    began, rounds = clock.perf_counter(), list[Costs]()
    while not rounds or (len(rounds) < MOST_ROUNDS and clock.perf_counter() - began < SHORT):
        rounds.append(_timed(plain))
    found = {key: min((costs[key] for costs in rounds), key=lambda cost: cost.seconds) for key in rounds[0]}
    aside = {**run.reductions.stopwatch.laps, **run.stopwatch.laps}
    whole = aside.pop("stepping")
    aside["between batches"] = whole - plain.spent - sum(aside.values())
    aside[REST] = plain.spent - sum(cost.seconds for cost in found.values())
    found |= {(name, ""): Timed(seconds, 0) for name, seconds in aside.items()}
    costs = (
        Cost(*key, cost.count / steps or None, 1e6 * cost.seconds / steps, cost.seconds / whole)
        for key, cost in found.items()
    )
    assert plain.kernels
    members = compilation.one_by_one(plain.program, plain.kernels)
    return Profile(
        steps=plain.steps,
        microseconds=1e6 * whole / steps,
        costs=tuple(sorted(costs, key=lambda cost: -cost.microseconds)),
        compiled=tuple(_compiled(plain)),
        start=dict(START.laps),
        vectors=tuple(name for name, reason in members.items() if not reason),
        alone={name: reason for name, reason in members.items() if reason},
    )


def _timed(plain: Simulation) -> Costs:
    """What calls, copies and integrations take in another run, all rows of one thing together."""
    program = plain.program
    rows = TimedRows(program)
    simulation = Simulation(program, plain.kernels, plain.probes, rows.walked)
    simulation.ticks = plain.done
    simulation.initialize()
    rows.begin()
    for _ in simulation.batches():
        pass
    simulation.close()
    found: Costs = {}
    attempts = {at for phase in _ATTEMPTS for at in range(*program.phases[phase])}
    took: list[tuple[str, str, Timed]] = []
    for at, row in enumerate(program.rows):
        if row[tables.KIND] == tables.CALL:
            call = program.calls[row[tables.A]]
            took.append((call.component, call.function.name, rows.took(at)))
        elif row[tables.KIND] == tables.COPY:
            took.append(("keeping steps" if at in attempts else "copies between blocks", "", rows.took(at)))
    for number, bank in enumerate(program.banks):
        name = program.name_of(bank)
        took.append(("integration" if name == "joint" else f"integration of {name}", "", rows.integration(number)))
    for name, function, one in took:
        if one.count:
            before = found.get((name, function), Timed(0.0, 0))
            found[name, function] = Timed(before.seconds + one.seconds, before.count + one.count)
    return found


def _compiled(simulation: Simulation) -> Iterator[Compiled]:
    assert simulation.kernels
    modules = [*simulation.kernels.modules.values(), simulation.kernels.loop]
    for module in {module.key: module for module in modules if module}.values():
        yield Compiled(module.name.partition("-")[0], module.seconds, not module.compiled_now)
