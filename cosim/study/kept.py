"""How often the runs of a study keep each requirement, and where they keep it least."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from cosim.results.formatting import format_value
from cosim.results.metrics import for_json
from cosim.results.text_table import TextTable
from cosim.study.definition import Study
from cosim.study.row_figures import Row

CONFIDENCE = 0.95


@dataclass
class Tally:
    """One requirement over the runs of a variant.

    undecided: also of those that did not come to a verdict. alike: whether they differ in what was drawn alone, each by
    itself, so that they are trials of one probability. least: the smallest margin, in which run, and where in it.
    """

    runs: int = 0
    violated: int = 0
    undecided: int = 0
    alike: bool = True
    least: tuple[float, str, str] = (math.inf, "", "")

    @property
    def share(self) -> tuple[float, float]:
        """The bounds of the probability of a violation in runs that are drawn alike; undecided ones may be any."""
        trials = self.runs + self.undecided
        low, high = interval(self.violated, trials), interval(self.violated + self.undecided, trials)
        return low[0], high[1]


def interval(count: int, trials: int) -> tuple[float, float]:
    """The bounds at CONFIDENCE of a probability by what was seen in independent trials; never too narrow.

    Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial, Biometrika 26
    (1934).
    """
    from scipy.special import betaincinv

    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(betaincinv(count, trials - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, trials - count, 1.0 - tail)) if count < trials else 1.0
    return low, high


def draws_are_trials(study: Study) -> bool:
    """Whether draws are independent trials: others fill the space evenly, and `until` looks at what they gave."""
    return study.random is not None and study.random.method == "random" and not study.until


def tallies(study: Study, rows: Iterable[Row]) -> dict[tuple[str, str], Tally]:
    """Each requirement over all runs that judge it, by its name and the variant."""
    found: dict[tuple[str, str], Tally] = {}
    runs: dict[str, int] = {}
    independent = draws_are_trials(study)
    for row in rows:
        runs[row["variant"]] = runs.get(row["variant"], 0) + 1
        for name, (holds, place) in row.get("requirements", {}).items():  # rows of earlier versions have none
            tally = found.setdefault((name, row["variant"]), Tally())
            tally.runs += holds is not None
            tally.violated += holds is False
            tally.alike &= independent and row["draw"] is not None and not row["grid"]
            margin = row["metrics"].get(name)
            if margin is not None and float(margin) < tally.least[0]:
                tally.least = float(margin), row["name"], place
    for (_, variant), tally in found.items():
        tally.undecided = runs[variant] - tally.runs
    return found


def violated(rows: Iterable[Row]) -> bool:
    """Whether a run violates a requirement."""
    return any(holds is False for row in rows for holds, _ in row.get("requirements", {}).values())


def as_json(study: Study, rows: Iterable[Row]) -> list[dict[str, Any]]:
    """The tallies as JSON has them; probability: the bounds at CONFIDENCE, where runs are drawn alike."""
    return [
        {
            "requirement": name,
            "variant": variant,
            "runs": tally.runs,
            "violated": tally.violated,
            "undecided": tally.undecided,
            "probability": tally.share if tally.alike else None,
            "least": for_json(dict(zip(("margin", "run", "at"), tally.least, strict=True))) if tally.least[1] else None,
        }
        for (name, variant), tally in tallies(study, rows).items()
    ]


def table(study: Study, rows: Iterable[Row]) -> TextTable | None:
    """A line for each requirement of each variant; None where there are no requirements."""
    found = tallies(study, rows)
    lines = []
    for (name, variant), tally in found.items():
        low, high = tally.share
        least, run, place = tally.least
        open_ = f", {tally.undecided} undecided" if tally.undecided else ""
        chance = f"{100 * low:.3g} … {100 * high:.3g} %" if tally.alike else ""
        margin = format_value(least) if run else ""
        lines.append([variant, name, f"{tally.violated} of {tally.runs}{open_}", chance, margin, place, run])
    head = ["variant", "requirement", "violated", f"probability, {100 * CONFIDENCE:g} %", "least margin", "at", "in"]
    if len({variant for _, variant in found}) < 2:
        head, lines = head[1:], [line[1:] for line in lines]
    return TextTable("requirements", head, lines) if lines else None
