"""How much of a figure's variance each drawn value explains: Sobol indices, with intervals.

First order: the share that a value explains alone; total: with all that it does together with others. From runs at
points of a Sobol sequence, as Saltelli and others, Computer Physics Communications 181 (2010) 259–270, by scipy. The
intervals are percentiles of resampled runs: Efron and Tibshirani, An introduction to the bootstrap (1993).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.errors import MetricError, WrongValue
from cosim.search.evaluator import Evaluator
from cosim.study.member_run import Row
from cosim.study.variants import Settings

CONFIDENCE = 0.95
RESAMPLED = 500
BATCH = 256


@dataclass(frozen=True)
class Share:
    """A share of the variance, with the bounds of its interval at CONFIDENCE."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Sensitivity:
    """What one drawn value, or an element of it, does to one metric."""

    metric: str
    name: str
    first: Share
    total: Share


def sensitivities(
    evaluator: Evaluator,
    metrics: Sequence[str],
    runs: int,
    seed: int,
    watch: Callable[[int, int], None] = lambda done, total: None,
) -> list[Sensitivity]:
    """The indices of all drawn values for each metric, in that order; of no more runs than `runs`.

    Raises: WrongValue for too few runs, MetricError for a run without a number, KeyboardInterrupt, ResultError.
    """
    size = evaluator.draws.size
    count = 2 ** math.floor(math.log2(max(runs / (size + 2), 1.0)))
    if count < 4:
        raise WrongValue(f"{runs} runs are too few for {size} drawn values", None, f"at least {4 * (size + 2)}")
    points = _points(size, count, seed)
    rows: list[Row] = []
    for begin in range(0, len(points), BATCH):
        rows += evaluator.rows([_settings(evaluator, point) for point in points[begin : begin + BATCH]])
        watch(len(rows), len(points))
    names = evaluator.draws.names()
    found = []
    for metric in metrics:
        first, total = _indices(np.array([_number(row, metric) for row in rows]).reshape(size + 2, count), seed)
        found += [Sensitivity(metric, name, *pair) for name, *pair in zip(names, first, total, strict=True)]
    return found


def _points(size: int, count: int, seed: int) -> np.ndarray:
    """The points (size + 2, count, size) of A, of B, and of A with each value from B, one after the other."""
    from scipy.stats import qmc

    both = qmc.Sobol(2 * size, rng=np.random.default_rng(seed)).random(count)
    a, b = both[:, :size], both[:, size:]
    mixed = [np.where(np.arange(size) == k, b, a) for k in range(size)]
    return np.concatenate([a, b, *mixed])


def _settings(evaluator: Evaluator, point: np.ndarray) -> Settings:
    found = evaluator.draws.at(point)
    assert found is not None, "what is accepted makes values depend on each other"
    return found


def _number(row: Row, metric: str) -> float:
    value = row["metrics"].get(metric)
    if row["status"] != "completed" or not isinstance(value, int | float) or not math.isfinite(value):
        reason = row["reason"] or "it has no number"
        raise MetricError(f"`{metric}` has no value in a run: {reason}", None, "draw from a smaller range")
    return float(value)


def _indices(values: np.ndarray, seed: int) -> tuple[list[Share], list[Share]]:
    """First and total indices from values (size + 2, count), with the percentiles of resampled runs."""
    if np.ptp(values) == 0.0:  # nothing explains what does not vary
        none = [Share(0.0, 0.0, 0.0)] * (len(values) - 2)
        return none, none
    count, generator = values.shape[1], np.random.default_rng(seed)
    drawn = generator.integers(0, count, (RESAMPLED, count))
    spread = np.array([_of(values[:, chosen]) for chosen in drawn])
    edges = 0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)
    low, high = np.nanquantile(spread, edges, axis=0)
    first, total = (
        [Share(*map(float, row)) for row in zip(*columns, strict=True)]
        for columns in zip(_of(values), low, high, strict=True)
    )
    return first, total


def _of(values: np.ndarray) -> np.ndarray:
    """First and total indices (2, size); NaN where the values do not vary."""
    from scipy.stats import sobol_indices

    if np.ptp(values[:2]) == 0.0:
        return np.full((2, len(values) - 2), math.nan)
    given = {"f_A": values[:1], "f_B": values[1:2], "f_AB": values[2:, None, :]}
    made: Any = sobol_indices(func=given, n=values.shape[1])
    return np.array([np.ravel(made.first_order), np.ravel(made.total_order)])
