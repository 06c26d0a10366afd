"""What a run is worth to a search for a violation: the margin, and by what kind of violation it ended."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cosim.study.member_run import Row
from cosim.study.running import FAILED
from cosim.study.variants import Settings

LARGE = 1e300


@dataclass(frozen=True)
class Trial:
    """A run of a search. margin: None where the run has none.

    ended: how the run ended where it did not come to its end, with the reason. most: what the margin may be at most,
    of a run that was broken off; time: what decides that (s), NaN where nobody knows.
    """

    number: int
    point: tuple[float, ...]
    settings: Settings
    margin: float | None
    ended: str
    place: str
    most: float
    time: float

    @property
    def violates(self) -> bool:
        """Whether it violates the requirement, or did not come to its end, which is a violation of its own kind."""
        return bool(self.ended) or (self.margin is not None and self.margin <= 0.0)

    @property
    def cost(self) -> float:
        """What a search makes small, always a number."""
        if self.ended:
            return -LARGE
        found = self.most if self.margin is None else self.margin
        return LARGE if math.isnan(found) else min(max(found, -LARGE), LARGE)


def trial(number: int, point: tuple[float, ...], settings: Settings, row: Row, requirement: str) -> Trial:
    """The trial that a row of a study is."""
    ended = f"{row['status']}: {row['reason']}" if row["status"] in FAILED else ""
    holds, place = row["requirements"].get(requirement, (None, ""))
    margin = row["metrics"].get(requirement)
    found = None if margin is None or math.isnan(margin) else float(margin)
    if found == 0.0 and holds:  # kept by an equality that is allowed
        found = math.ulp(0.0)
    most, time = row.get("bounds", {}).get(requirement, (math.inf, math.nan))
    return Trial(number, point, settings, found, ended, place, float(most), float(time))
