"""Values of free parameters with which runs come nearest to measurements: nonlinear least squares from several starts.

Each start is one of scipy's trust-region-reflective searches within the bounds (Branch, Coleman and Li, SIAM Journal on
Scientific Computing 21 (1999) 1–23). The Jacobian is made of differences, whose runs are under way at once; no result
depends on how many are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.errors import CosimError
from cosim.search import estimates
from cosim.search.estimates import Estimates
from cosim.search.evaluator import Evaluator
from cosim.search.finer import finer
from cosim.search.measurements import Measurements
from cosim.study.addresses import value_at
from cosim.study.definition import Fit
from cosim.study.member_run import Row
from cosim.study.variants import Settings

DIFFERENCE = 1e-4
"""Of the distance of the bounds: between it and a hundredth of its square, errors of central differences are small."""
ENOUGH = 1e-10
"""Relative change of the sum of squares, and of the values, at which a search stands still."""
ALIKE = 1e-3
"""Of the distance of the bounds: two searches that end as near as that have found the same values."""


@dataclass(frozen=True)
class End:
    """Where a search has come: a point of the unit cube, with its residuals."""

    point: np.ndarray
    residuals: np.ndarray

    @property
    def cost(self) -> float:
        """The sum of squares."""
        return float(self.residuals @ self.residuals)


@dataclass(frozen=True)
class Fitted:
    """The best end, with what is known of its values. before: of the diagram's own values, None where they do not run.

    ends: of each start that came to one, the best one first. finer: the residuals at a tenth of the step, None where
    there is no such run. complete: whether there were enough runs for all starts.
    """

    before: np.ndarray | None
    ends: tuple[End, ...]
    settings: Settings
    estimates: Estimates
    finer: np.ndarray | None
    complete: bool

    @property
    def best(self) -> End:
        """The end with the least sum of squares."""
        return self.ends[0]

    def others(self) -> list[End]:
        """The ends that are other values."""
        return [end for end in self.ends if np.max(np.abs(end.point - self.best.point)) > ALIKE]


class _Spent(Exception):
    """No runs are left."""


@dataclass
class FitRun:
    """The search of a `fit` section, in so many runs, and until `deadline` (time.monotonic()).

    watch: told how many runs are done, and the least sum of squares so far. spent: how many runs it took.
    """

    evaluator: Evaluator
    measurements: Measurements
    fit: Fit
    runs: int
    deadline: float
    seed: int
    watch: Callable[[int, float | None], None]
    spent: int = 0
    _best: list[End] = field(default_factory=list)
    _reason: str = ""

    def run(self) -> Fitted:
        """Search. Raises: CosimError where no start runs to its end; KeyboardInterrupt, ResultError."""
        begins = self._begins()
        before = self._residuals([begins[0]])[0]
        ends, complete = [], True
        for begin in begins:
            self._best = []
            try:
                self._descend(begin)
            except _Spent:
                complete = False
            ends += self._best
            if not complete:
                break
        if not ends:
            message = f"not one of {len(begins)} starts runs to its end: {self._reason}"
            raise CosimError(message, self.fit.node.place, "narrower bounds, or begin with values that run to the end")
        ends.sort(key=lambda end: end.cost)
        settings = self._settings(ends[0].point)
        return Fitted(before, tuple(ends), settings, self._estimates(ends[0]), self._finer(settings), complete)

    def _begins(self) -> list[np.ndarray]:
        """The diagram's own values, and others that fill the bounds."""
        from scipy.stats import qmc

        network = self.evaluator.variants.base(self.evaluator.variant)
        own = self.evaluator.draws.point_of(lambda path: value_at(network, path))
        count = max(self.fit.starts - 1, 0)
        size = 2 ** int(np.ceil(np.log2(max(count, 1))))
        more = qmc.Sobol(self.evaluator.draws.size, rng=np.random.default_rng(self.seed)).random(size)
        return [own, *more[:count]]

    def _descend(self, begin: np.ndarray) -> None:
        """One search; the best of its points is left in `_best`. Raises: _Spent."""
        from scipy.optimize import least_squares

        inner = np.clip(begin, ENOUGH, 1.0 - ENOUGH)
        if not np.all(np.isfinite(self._checked(inner))):
            return
        least_squares(
            self._checked, inner, self._jacobian, (0.0, 1.0), method="trf", ftol=ENOUGH, xtol=ENOUGH, gtol=ENOUGH
        )

    def _checked(self, point: np.ndarray) -> np.ndarray:
        """The residuals at a point, NaN where it does not run to its end; scipy goes less far then."""
        if self.spent >= self.runs or time.monotonic() > self.deadline:
            raise _Spent
        found = self._residuals([point])[0]
        if found is None:
            return np.full(self.measurements.size, np.nan)
        if not self._best or float(found @ found) < self._best[0].cost:
            self._best = [End(point.copy(), found)]
        self.watch(self.spent, self._best[0].cost)
        return found

    def _jacobian(self, point: np.ndarray) -> np.ndarray:
        """Of the residuals by the unit cube's coordinates (size, n), by central differences.

        They are one-sided at a bound, and beside runs that do not come to their end.

        Raises: CosimError where a run so near does not come to its end.
        """
        low, high = np.maximum(point - DIFFERENCE, 0.0), np.minimum(point + DIFFERENCE, 1.0)
        points = []
        for k in range(len(point)):
            below, above = point.copy(), point.copy()
            below[k], above[k] = low[k], high[k]
            points += [below, above]
        here, *found = self._residuals([point, *points])
        columns = []
        for k, sides in enumerate(zip(found[::2], found[1::2], strict=True)):
            ends = [(at[k], side) for at, side in zip((low, high), sides, strict=True) if side is not None]
            if len(ends) < 2 and here is not None:  # beside runs that do not come to their end
                ends.append((point[k], here))
            if len(ends) < 2 or ends[0][0] == ends[1][0]:
                name = self.evaluator.draws.names()[k]
                message = f"a run with {name} a little off does not come to its end: {self._reason}"
                raise CosimError(message, self.fit.node.place, "narrower bounds")
            (a, one), (b, other) = ends
            columns.append((other - one) / (b - a))
        return np.array(columns).T

    def _estimates(self, end: End) -> Estimates:
        lower, upper = (self.evaluator.draws.numbers_at(np.full(len(end.point), at)) for at in (0.0, 1.0))
        jacobian = self._jacobian(end.point)
        return estimates.estimates(end.point, lower, upper - lower, end.residuals, jacobian, self.measurements.known)

    def _finer(self, settings: Settings) -> np.ndarray | None:
        step = finer(self.evaluator)
        return None if step is None else self._of(self._rows([(*settings, *step)])[0])

    def _settings(self, point: np.ndarray) -> Settings:
        found = self.evaluator.draws.at(point)
        assert found is not None, "what is free has no `accept`"
        return found

    def _residuals(self, points: Sequence[np.ndarray]) -> list[np.ndarray | None]:
        return [self._of(row) for row in self._rows([self._settings(point) for point in points])]

    def _rows(self, settings: Sequence[Settings]) -> list[Row]:
        self.spent += len(settings)
        return self.evaluator.rows(settings)

    def _of(self, row: Row) -> np.ndarray | None:
        """The residuals of a run; None where it has none."""
        if row["status"] == "completed" and row.get("observed") is not None:
            return self.measurements.residuals(row["observed"])
        early = "it ends before the last measurement, or what is measured is not finite"
        self._reason = early if row["status"] == "completed" else row["reason"] or row["status"]
        return None
