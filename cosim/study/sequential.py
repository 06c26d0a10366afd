"""Draws until a probability is known: intervals that hold at all numbers of draws at once, so that one may stop at any.

Of k violations in n independent trials, those p are left for which

    B(k + 1/2, n - k + 1/2) / B(1/2, 1/2)  <  p^k (1 - p)^(n - k) / alpha

The left side over p^k (1 - p)^(n - k) is a martingale if p is true, and ever beyond 1/alpha with a probability of at
most alpha: Robbins, Statistical methods related to the law of the iterated logarithm, Annals of Mathematical
Statistics 41 (1970); Howard, Ramdas, McAuliffe and Sekhon, Annals of Statistics 49 (2021), compare such sequences.
Wald's test needs fewer draws, but two probabilities between which it does not care, and gives no interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.results.metrics import from_json
from cosim.study.definition import Sought, Study
from cosim.study.row_figures import Row, number, satisfies

Group = tuple[str, tuple[int, ...]]
"""A variant and a point of the grid."""


@dataclass
class Trials:
    """What the draws of a group say of a probability, in their order: violated, kept, or None where nobody knows."""

    until: Sought
    group: Group
    outcomes: list[bool | None] = field(default_factory=list)

    def known_after(self) -> int | None:
        """After how many draws the probability is known to be below or above; None if it is not."""
        violated = np.cumsum([outcome is True for outcome in self.outcomes])
        open_ = np.cumsum([outcome is None for outcome in self.outcomes])
        p, limit = self.until.probability, -math.log(1.0 - self.until.confidence)
        draws = np.arange(1, len(self.outcomes) + 1)
        above = (_evidence(violated, draws, p) >= limit) & (violated > p * draws)
        below = (_evidence(violated + open_, draws, p) >= limit) & (violated + open_ < p * draws)
        decided = np.flatnonzero(above | below)
        return int(decided[0]) + 1 if decided.size else None

    def interval(self, draws: int) -> tuple[float, float]:
        """The bounds of the probability after so many draws; those of which nobody knows may be either."""
        seen = self.outcomes[:draws]
        violated, open_ = seen.count(True), seen.count(None)
        confidence = self.until.confidence
        return interval(violated, draws, confidence)[0], interval(violated + open_, draws, confidence)[1]


def _evidence(violated: Any, draws: Any, p: float) -> Any:
    """The logarithm of the martingale against p."""
    from scipy.special import betaln

    return betaln(violated + 0.5, draws - violated + 0.5) - betaln(0.5, 0.5) - _log_likelihood(violated, draws, p)


def _log_likelihood(violated: Any, draws: Any, p: float) -> Any:
    return violated * math.log(p) + (draws - violated) * math.log1p(-p)


def interval(violated: int, draws: int, confidence: float) -> tuple[float, float]:
    """The bounds of a probability after so many draws, which hold at all numbers of draws at once."""
    from scipy.optimize import brentq

    if not draws:
        return 0.0, 1.0
    limit, middle = -math.log(1.0 - confidence), (violated + 0.5) / (draws + 1.0)

    def beyond(p: float) -> float:
        return float(_evidence(violated, draws, p)) - limit

    least, most = 1e-300, 1.0 - 2.0**-53
    low = float(brentq(beyond, least, middle, xtol=1e-300, rtol=1e-12)) if violated else 0.0
    high = float(brentq(beyond, middle, most, rtol=1e-12)) if violated < draws else 1.0
    return low, high


def violates(until: Sought, row: Row) -> bool | None:
    """Whether a run is a violation; None where nobody can say."""
    if until.above is None and until.below is None:
        holds = row["requirements"].get(until.name, (None, ""))[0]
        return None if holds is None else not holds
    found = number({**row, "metrics": from_json(row["metrics"])}, until.name)
    return None if found is None else bool(satisfies(np.array([found]), until.above, until.below)[0])


def trials(study: Study, rows: Iterable[Row]) -> list[Trials]:
    """What the rows say of each probability, group by group; a group without the figure has no part in it."""
    found: dict[tuple[str, Group], Trials] = {}
    for row in rows:
        group = row["variant"], tuple(row["grid"])
        for until in study.until:
            one = found.setdefault((until.name, group), Trials(until, group))
            one.outcomes.append(violates(until, row))
    return [one for one in found.values() if any(outcome is not None for outcome in one.outcomes)]


def draws_needed(found: Sequence[Trials]) -> int | None:
    """After how many draws each probability of each group is known; None if one is not."""
    known = [one.known_after() for one in found]
    return max((n for n in known if n is not None), default=None) if None not in known else None
