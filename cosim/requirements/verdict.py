"""Whether a run keeps a requirement, by how much, and where it is nearest to not doing so: as data and in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from cosim.requirements.margins import NO_MARGIN
from cosim.requirements.monitor import Robustness
from cosim.results.formatting import format_change, format_with_error

WORDS = {True: "kept", False: "violated", None: "undecided"}
"""What is said of a requirement that holds, does not, or is not known to."""


@dataclass(frozen=True)
class Verdict:
    """How a run keeps a requirement.

    holds: None where too little was seen. margin: the robustness, positive where it is kept, in `unit`; None as holds.
    settled: whether what was still to come could not have changed the margin. time (s) and where: what decides it.
    reason: why it is undecided.
    """

    name: str
    formula: str
    holds: bool | None
    margin: float | None
    unit: str
    settled: bool
    time: float | None
    where: str
    reason: str = ""

    @property
    def word(self) -> str:
        """One word for it."""
        return WORDS[self.holds]

    @property
    def margin_text(self) -> str:
        """The margin, or the bound of one that what was still to come could have changed."""
        return self.margin_within(None)

    def margin_within(self, error: float | None) -> str:
        """As `margin_text`, with the error that it may have, if that is known."""
        if self.margin is None:
            return "—"
        bound = "" if self.settled else "≥ " if self.holds else "≤ "
        return f"{bound}{format_with_error(self.margin, error)}"

    @property
    def place(self) -> str:
        """When, and by whom, it is nearest to being violated, or most violated; why it is undecided."""
        if self.time is None:
            return self.reason
        return f"t = {self.time:g} s{f', {self.where}' if self.where else ''}"

    def as_json(self) -> dict[str, Any]:
        """Its fields."""
        return asdict(self)


def verdict(name: str, formula: str, robustness: Robustness) -> Verdict:
    """What a robustness says of a requirement."""
    found, moment = robustness.margin, robustness.moment
    margin = 0.0 if found is not None and abs(found) <= NO_MARGIN else found
    return Verdict(
        name=name,
        formula=formula,
        holds=robustness.holds,
        margin=margin,
        unit=robustness.unit,
        settled=robustness.settled,
        time=moment.time if moment and not math.isnan(moment.time) else None,
        where=_where(moment.element, moment.fleets) if moment else "",
        reason=robustness.reason,
    )


def change(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """What changed from one verdict to another: another word, or another margin."""
    if first["holds"] is not second["holds"]:
        return f"{WORDS[first['holds']]} → {WORDS[second['holds']]}"
    return format_change(second["margin"], {"margin": first["margin"]}, "margin")


def _where(element: tuple[int, ...], fleets: tuple[str | None, ...]) -> str:
    """The member and the element, numbers from 1."""
    members = [f"{fleet} {k + 1}" for k, fleet in zip(element, fleets, strict=True) if fleet]
    own = [str(k + 1) for k, fleet in zip(element, fleets, strict=True) if not fleet]
    return ", ".join([*members, *([f"element {', '.join(own)}"] if own else [])])
