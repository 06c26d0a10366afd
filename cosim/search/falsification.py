"""A search for a run that violates a requirement: a first look over the whole space, then CMA-ES from the best of it.

    look at the middle, at corners and at points that fill the space
    repeat
        CMA-ES from the best point that has not been begun from, or from the best of some random ones
    until a run violates the requirement, or all runs are spent

Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772. All that is random comes from the seed, and no run's
result depends on how many are under way at once, so the same search gives the same runs.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.errors import MissingPackage, NoAcceptedDraw
from cosim.search.evaluator import Evaluator
from cosim.search.objective import LARGE, Trial, trial
from cosim.study.variants import Settings

Point = tuple[float, ...]
POPULATION = 16
GENERATIONS = 60
SPREAD = 0.08
"""Of CMA-ES at its begin, of the space's width."""
TRIES = 200
"""How many points are drawn for one that is accepted."""


@dataclass
class Findings:
    """What a search has found so far. trials: how many; least: the one with the smallest margin."""

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
        self._cma = _library()
        self._evaluator, self._requirement, self._runs = evaluator, requirement, runs
        self._random = np.random.default_rng(seed)
        self._watch = watch
        self._deadline = time.monotonic() + seconds
        self.findings = Findings()

    def run(self) -> Findings:
        """Search. Raises: KeyboardInterrupt, which loses no run; ResultError, NoAcceptedDraw."""
        looked = self._tried(list(self._first_points()))
        begins = sorted(looked, key=lambda t: t.cost)[: max(2, len(looked) // 16)]
        while not self._is_over():
            if not begins:
                begins = sorted(self._tried(self._random_points(2 * POPULATION)), key=lambda t: t.cost)[:1]
            if not begins:
                raise NoAcceptedDraw("no point is accepted", self._evaluator.draws.accept_place, "widen `accept`")
            if not self._is_over():
                self._descend(begins.pop(0).point)
        return self.findings

    def _is_over(self) -> bool:
        late = time.monotonic() > self._deadline
        return late or self.findings.violation is not None or self.findings.trials >= self._runs

    def _first_points(self) -> Iterator[Point]:
        """The middle, corners, and a Sobol sequence; as many as a sixteenth of the runs, or a few dozen."""
        from scipy.stats import qmc

        size = self._evaluator.draws.size
        count = max(2 * POPULATION, min(self._runs // 16, 16 * size))
        yield (0.5,) * size
        for _ in range(count // 4):
            yield tuple(self._random.integers(0, 2, size).astype(float).tolist())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a count that is no power of two
            filled = qmc.Sobol(size, rng=self._random).random(TRIES * count // 8)
        accepted = 0
        for row in filled:
            point = tuple(map(float, row))
            if self._evaluator.draws.at(np.array(point)) is not None:
                yield point
                accepted += 1
            if accepted >= count:
                return

    def _random_points(self, count: int) -> list[Point]:
        """Points that are accepted, as many as can be found."""
        return [
            p for _ in range(count) if (p := self._accepted(lambda: self._random.random(self._evaluator.draws.size)))
        ]

    def _accepted(self, draw: Callable[[], Any]) -> Point | None:
        for _ in range(TRIES):
            point = tuple(float(x) for x in draw())
            if self._evaluator.draws.at(np.array(point)) is not None:
                return point
        return None

    def _descend(self, begin: Point) -> None:
        """CMA-ES from a point, until it stands still."""
        options = {
            "bounds": [0.0, 1.0],
            "popsize": POPULATION,
            "maxiter": GENERATIONS,
            "seed": int(self._random.integers(1, 2**31)),
            "verbose": -9,
            "tolfun": 0.0,
        }
        strategy = self._cma.CMAEvolutionStrategy(list(begin), SPREAD, options)
        while not strategy.stop() and not self._is_over():
            points = [self._accepted(lambda: strategy.ask(1)[0]) for _ in range(POPULATION)]
            good = [point for point in points if point is not None]
            if len(good) < POPULATION // 2:
                return  # nearly nothing is accepted there
            trials = self._tried(good)
            found = {t.point: t.cost for t in trials}
            if len(found) < POPULATION // 2:
                return
            strategy.tell([np.array(p) for p in found], [min(c, LARGE) for c in found.values()])

    def _tried(self, points: Sequence[Point]) -> list[Trial]:
        """Run points that are accepted, as long as there are runs, in batches of a population."""
        tried: list[Trial] = []
        accepted: list[tuple[Point, Settings]] = [
            (point, settings) for point in points if (settings := self._evaluator.draws.at(np.array(point))) is not None
        ]
        for begin in range(0, len(accepted), POPULATION):
            batch = accepted[begin : begin + POPULATION][: max(self._runs - self.findings.trials, 0)]
            rows = self._evaluator.rows([settings for _, settings in batch])
            for (point, settings), row in zip(batch, rows, strict=True):
                self.findings.trials += 1
                new = trial(self.findings.trials, point, settings, row, self._requirement)
                tried.append(new)
                if self.findings.least is None or new.cost < self.findings.least.cost:
                    self.findings.least = new
            self._watch(self.findings)
            if self._is_over():
                break
        return tried


def _library() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cma
    except ImportError:
        fix = "pip install 'cosim[search]'"
        raise MissingPackage("a search needs the package cma, which is not installed", fix=fix) from None
    return cma
