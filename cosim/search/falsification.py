"""A search for a run that violates a requirement: a first look over the whole space, then CMA-ES from the best of it.

    look at the middle, at corners and at points that fill the space
    repeat
        CMA-ES from the best point that has not been begun from, or from the best of some random ones, until it
        stands still; meanwhile one run of eleven is of a corner or of a random point
    until a run violates the requirement, or all runs are spent

A descent looks no further along its runs than it has to: twice as far as what decides its begin's margin. What such a
run has seen bounds the margin of the whole run from above, so a violation in it is one of the whole run; the best of
each descent is run as a whole. What a descent asks for beyond the space is moved onto its bounds, which so are
searched too.

Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772. All that is random comes from the seed, and no run's
result depends on how many are under way at once, so the same search gives the same runs.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from cosim.errors import NoAcceptedDraw
from cosim.search import descent
from cosim.search.descent import POPULATION
from cosim.search.evaluator import Evaluator
from cosim.search.objective import Trial, trial
from cosim.study.variants import Settings

Point = tuple[float, ...]
Place = tuple[Point, Settings]
GENERATIONS = 300
SPREAD = 0.3
"""Of CMA-ES at its begin, of the space's width."""
BEGUN, NEAR = 20, 0.02
"""A descent stands still where, after so many generations, half of one lie within this share of the best margin."""
STILL, GAIN = 60, 0.05
"""It does too where so many generations gain less than this share of the margin."""
SHORTEST = 1 / 128
"""Of the run, what is always looked at: less saves nothing."""
LOOKED_AT, AT_ONCE = 32, 8
"""How many points a look has, and how many of them are run at once: what is easily found needs few runs."""
ELSEWHERE = 5
"""After so many generations of a descent some points elsewhere are looked at: it may be in a valley without an exit."""
FIRST = 2
"""How many points of the first look are begun from."""
TRIES = 200
"""How many points are drawn for one that is accepted."""


@dataclass
class Findings:
    """What a search has found so far. trials: how many; least: the whole run with the smallest margin."""

    trials: int = 0
    least: Trial | None = None

    @property
    def violation(self) -> Trial | None:
        """The trial that violates the requirement."""
        return self.least if self.least and self.least.violates else None


class Falsification:
    """The search for one requirement's violation, in so many runs, and seconds of wall-clock time.

    watch: told of all that it has found after every batch. Raises: MissingPackage.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        requirement: str,
        runs: int,
        seconds: float,
        seed: int,
        watch: Callable[[Findings], None],
    ) -> None:
        descent.library()  # before anything is run
        self._evaluator, self._requirement, self._runs = evaluator, requirement, runs
        self._random = np.random.default_rng(seed)
        self._watch = watch
        self._deadline = time.monotonic() + seconds
        self.findings = Findings()

    def run(self) -> Findings:
        """Search. Raises: KeyboardInterrupt, which loses no run; ResultError, NoAcceptedDraw."""
        begins = sorted(self._tried(self._first_places(), at_once=AT_ONCE), key=lambda t: t.cost)[:FIRST]
        while not self._is_over():
            begins = begins or sorted(self._tried(self._random_places(LOOKED_AT)), key=lambda t: t.cost)[:1]
            if not begins:
                raise NoAcceptedDraw("no point is accepted", self._evaluator.draws.accept_place, "widen `accept`")
            if not self._is_over():
                self._descend(begins.pop(0))
        return self.findings

    def _is_over(self) -> bool:
        late = time.monotonic() > self._deadline
        return late or self.findings.violation is not None or self.findings.trials >= self._runs

    def _first_places(self) -> list[Place]:
        """The middle, corners, and a Sobol sequence, those of them that are accepted."""
        from scipy.stats import qmc

        size = self._evaluator.draws.size
        corners = self._random.integers(0, 2, (LOOKED_AT // 2, size))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a count that is no power of two
            filled = qmc.Sobol(size, rng=self._random).random(LOOKED_AT * TRIES)
        found = [self._place(point) for point in (np.full(size, 0.5), *corners)]
        accepted = (place for point in filled if (place := self._place(point)))
        return [*filter(None, found), *islice(accepted, LOOKED_AT)]

    def _random_places(self, count: int) -> list[Place]:
        """Points that are accepted, as many as can be found."""
        size = self._evaluator.draws.size
        return [*filter(None, (self._accepted(lambda: self._random.random(size)) for _ in range(count)))]

    def _elsewhere(self) -> list[Place]:
        """Some corners, those of them that are accepted, and other points: as many as are run at once."""
        size = self._evaluator.draws.size
        corners = self._random.integers(0, 2, (AT_ONCE // 2, size))
        found = [*filter(None, map(self._place, corners))]
        return [*found, *self._random_places(AT_ONCE - len(found))]

    def _accepted(self, draw: Callable[[], Any]) -> Place | None:
        """The first of some points that is accepted."""
        return next(filter(None, (self._place(draw()) for _ in range(TRIES))), None)

    def _place(self, point: Any) -> Place | None:
        """A point with what it sets; None if that is not accepted."""
        row = np.asarray(point, float)
        settings = self._evaluator.draws.at(row)
        return None if settings is None else (tuple(row.tolist()), settings)

    def _descend(self, begin: Trial) -> None:
        """CMA-ES from a run's point, until it stands still."""
        until = self._sight(begin)
        seed = int(self._random.integers(1, 2**31))
        strategy = descent.strategy(begin.point, SPREAD, seed, GENERATIONS, onto_bounds=True)
        best, courses, typical = begin, [begin.cost], math.inf
        while best.cost > 0.0 and not (strategy.stop() or _stands_still(courses, typical) or self._is_over()):
            places = [*filter(None, (self._accepted(lambda: strategy.ask(1)[0]) for _ in range(POPULATION)))]
            trials = self._tried(places, until)
            best = min([best, *trials], key=lambda t: t.cost)
            if len(trials) < POPULATION // 2:  # nearly nothing is accepted there, or all runs are spent
                break
            strategy.tell([np.array(t.point) for t in trials], [t.cost for t in trials])
            typical = float(np.median([t.cost for t in trials]))
            if best.cost > 0.0 and not len(courses) % ELSEWHERE:
                best = min([best, *self._tried(self._elsewhere(), until)], key=lambda t: t.cost)
            courses.append(best.cost)
        found = best.cost <= 0.0  # which is shown as a whole run whatever has been spent
        if best is not begin and until < math.inf and (found or not self._is_over()):
            self._tried([(best.point, best.settings)], more=int(found))

    def _sight(self, begin: Trial) -> float:
        """How far a descent looks (s): as far as leaves the margin of its begin as it is, or to the end."""
        evaluator = self._evaluator
        stop = evaluator.variants.base(evaluator.variant).diagram.run.stop
        until = max(2.0 * begin.time, SHORTEST * stop)
        if not until <= stop / 2:
            return math.inf
        seen = self._tried([(begin.point, begin.settings)], until)
        return until if seen and seen[0].cost == begin.cost else math.inf

    def _tried(
        self, places: Sequence[Place], until: float = math.inf, at_once: int = POPULATION, more: int = 0
    ) -> list[Trial]:
        """Run points up to a time (s), as long as there are runs and so many more, in batches."""
        tried: list[Trial] = []
        for begin in range(0, len(places), at_once):
            batch = places[begin : begin + at_once][: max(self._runs + more - self.findings.trials, 0)]
            rows = self._evaluator.rows([settings for _, settings in batch], until)
            for (point, settings), row in zip(batch, rows, strict=True):
                self.findings.trials += 1
                tried.append(trial(self.findings.trials, point, settings, row, self._requirement))
                if until == math.inf and (not self.findings.least or tried[-1].cost < self.findings.least.cost):
                    self.findings.least = tried[-1]
            self._watch(self.findings)
            if self._is_over():
                break
        return tried


def _stands_still(courses: Sequence[float], typical: float) -> bool:
    """Whether little is to be gained. courses: the best cost so far after each generation; typical: of the last one."""
    if len(courses) > STILL and courses[-1] > (1.0 - GAIN) * courses[-1 - STILL]:
        return True
    return len(courses) > BEGUN and typical - courses[-1] < NEAR * courses[-1]
