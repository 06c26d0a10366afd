"""Better values of free parameters: CMA-ES from those that the diagram has.

Each new best one is checked with a tenth of the step before it counts.

    judge the values before, at the diagram's step and at a tenth of it
    repeat
        run some candidates on all draws that are tuned with
        while the cheapest of them is cheaper than the best so far
            run it with a tenth of the step too: what it costs is the dearer of the two, and what its figures change by
            it is the best so far if it is still cheaper
    until all runs are spent
    run the values before and the best ones on the draws that were held out
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.errors import CosimError
from cosim.search import descent
from cosim.search.evaluator import Evaluator
from cosim.search.finer import finer
from cosim.search.worth import HEAVY, LOST, Worth, Yardstick, changed_by, objective
from cosim.study.addresses import value_at
from cosim.study.definition import Tuning
from cosim.study.member_run import Row
from cosim.study.variants import Settings

SPREAD = 0.2
GENERATIONS = 1000
WORTH_CHECKING = 0.01
"""Of the cost of the best so far, by which another has to be cheaper for a run with a tenth of the step."""


@dataclass(frozen=True)
class Candidate:
    """Values of the free parameters, with their runs at the diagram's step, and at a tenth of it.

    changes: by how much the figures differ between the two, of their size; held: the runs on draws that were held out.
    """

    settings: Settings
    rows: list[Row]
    finer: list[Row]
    worth: Worth
    changes: float
    held: list[Row]


class TuningRun:
    """The search of a `tune` section. starts: the draws, as settings, one empty one where there are none.

    watch: told how many runs are done, and the objective of the best candidate so far.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        tuning: Tuning,
        starts: Sequence[Settings],
        runs: int,
        seconds: float,
        seed: int,
        watch: Callable[[int, float | None], None],
    ) -> None:
        descent.library()  # before anything is run
        self._evaluator, self._tuning, self._watch = evaluator, tuning, watch
        kept = len(starts) - tuning.held_out
        self._starts, self._held = starts[:kept], starts[kept:]
        self._runs, self._deadline, self._seed = runs, time.monotonic() + seconds, seed
        self._finer = finer(evaluator)
        self.spent = 0

    def run(self) -> tuple[Candidate, Candidate | None]:
        """The values before, and the best ones that keep all bounds; None if none do, or none is better.

        Raises: CosimError where the values before have no objective; KeyboardInterrupt, ResultError.
        """
        before = self._before()
        best: Candidate | None = None
        limit = before.worth.cost if not before.worth.broken else math.inf
        strategy = descent.strategy(self._begin(), SPREAD, self._seed % 2**31 + 1, GENERATIONS)
        while not strategy.stop() and not self._is_over():
            points = strategy.ask()
            costs, found = self._generation(points, min(limit, best.worth.cost if best else math.inf))
            strategy.tell(points, costs)
            best = found or best
            self._watch(self.spent, best.worth.objective if best else None)
        return self._held_out(before), self._held_out(best) if best else None

    def _is_over(self) -> bool:
        return time.monotonic() > self._deadline or self.spent >= self._runs

    def _before(self) -> Candidate:
        """The values that the diagram has, and by what others are judged."""
        rows = self._run([()])[0]
        values = [objective(self._tuning, row["metrics"]) for row in rows]
        if any(value is None for value in values) or any(row["status"] != "completed" for row in rows):
            reason = next((row["reason"] for row in rows if row["status"] != "completed"), "a metric has no number")
            message = f"with the values before, `{self._tuning.objective.value}` has no value: {reason}"
            raise CosimError(message, self._tuning.objective.position, "begin with values that run to the end")
        mean = sum(value for value in values if value is not None) / len(values)
        named = {name for row in rows for name, holds in row["conditions"].items() if holds is not False}
        every = {name for row in rows for name in row["conditions"]}
        failing = {name for row in rows for name, holds in row["conditions"].items() if holds is False}
        expected = {"kept": named - failing, "all": every, "any": set[str]()}[self._tuning.conditions]
        self._measure = Yardstick(self._tuning, abs(mean) or 1.0, frozenset(expected))
        return self._checked((), rows)

    def _begin(self) -> np.ndarray:
        """The diagram's own values in the unit cube."""
        network = self._evaluator.variants.base(self._evaluator.variant)
        return self._evaluator.draws.point_of(lambda path: value_at(network, path))

    def _generation(self, points: Sequence[np.ndarray], limit: float) -> tuple[list[float], Candidate | None]:
        """What each point costs, and the best one if it costs less than the limit."""
        places = [self._evaluator.draws.at(np.asarray(point)) for point in points]
        settings = [place if place is not None else () for place in places]
        rows = self._run(settings)
        worths = [self._measure.worth(own) for own in rows]
        costs = [LOST if place is None else worth.cost for place, worth in zip(places, worths, strict=True)]
        best: Candidate | None = None
        for k in sorted(range(len(costs)), key=lambda k: costs[k]):
            if costs[k] >= limit * (1.0 - WORTH_CHECKING) or worths[k].broken:
                break
            candidate = self._checked(settings[k], rows[k])
            costs[k] = candidate.worth.cost
            if not candidate.worth.broken and candidate.worth.cost < limit:
                best, limit = candidate, candidate.worth.cost
        return costs, best

    def _checked(self, settings: Settings, rows: list[Row]) -> Candidate:
        """A candidate with its runs at a tenth of the step, by which it is judged too."""
        if self._finer is None:
            return Candidate(settings, rows, [], self._measure.worth(rows), 0.0, [])
        finer = self._run([(*settings, *self._finer)])[0]
        coarse, fine = self._measure.worth(rows), self._measure.worth(finer)
        changes = changed_by(self._tuning, rows, finer)
        broken, cost = dict.fromkeys((*coarse.broken, *fine.broken)), max(coarse.cost, fine.cost)
        if changes > self._tuning.accuracy:
            broken[f"figures within {100 * self._tuning.accuracy:g} % of those at a tenth of the step"] = None
            cost += HEAVY * (1.0 + min(changes, 100.0))
        return Candidate(settings, rows, finer, Worth(fine.objective, tuple(broken), cost), changes, [])

    def _held_out(self, candidate: Candidate) -> Candidate:
        if not self._held:
            return candidate
        held = self._evaluator.rows([(*start, *candidate.settings) for start in self._held])
        self.spent += len(held)
        return Candidate(candidate.settings, candidate.rows, candidate.finer, candidate.worth, candidate.changes, held)

    def _run(self, settings: Sequence[Settings]) -> list[list[Row]]:
        """The rows of each candidate, one for each draw."""
        size = len(self._starts)
        rows = self._evaluator.rows([(*start, *own) for own in settings for start in self._starts])
        self.spent += len(rows)
        return [rows[k : k + size] for k in range(0, len(rows), size)]
