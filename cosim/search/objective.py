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

    ended: how the run ended where it did not come to its end, with the reason.
    """

    number: int
    point: tuple[float, ...]
    settings: Settings
    margin: float | None
    ended: str
    place: str

    @property
    def violates(self) -> bool:
        """Whether it violates the requirement, or did not come to its end, which is a violation of its own kind."""
        return bool(self.ended) or (self.margin is not None and self.margin <= 0.0)

    @property
    def cost(self) -> float:
        """What a search makes small, always a number."""
        if self.ended:
            return -LARGE
        return LARGE if self.margin is None else min(max(self.margin, -LARGE), LARGE)


def trial(number: int, point: tuple[float, ...], settings: Settings, row: Row, requirement: str) -> Trial:
    """The trial that a row of a study is."""
    ended = f"{row['status']}: {row['reason']}" if row["status"] in FAILED else ""
    holds, place = row["requirements"].get(requirement, (None, ""))
    margin = row["metrics"].get(requirement)
    found = None if margin is None or math.isnan(margin) else float(margin)
    if found == 0.0 and holds:  # kept by an equality that is allowed
        found = math.ulp(0.0)
    return Trial(number, point, settings, found, ended, place)
