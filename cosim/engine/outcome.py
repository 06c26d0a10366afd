"""How a run ended: its figures, what happened along it, what failed, what to be warned of."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from cosim.errors import CosimError
from cosim.results import metrics as reductions
from cosim.wiring.network import Finding, Signal

if TYPE_CHECKING:
    from cosim.requirements.verdict import Verdict


@dataclass
class Event:
    """A boolean output that says something happened: what, and when each member saw it first."""

    signal: Signal
    text: str
    times: Any


@dataclass
class Stepping:
    """The communication steps that a tolerance chose: the shortest and the longest (s), how many were done anew.

    coarse: how many were longer than the tolerance allows, as there is no smaller step or none is done anew.
    """

    shortest: float
    longest: float
    rejected: int
    coarse: int

    def __str__(self) -> str:
        return f"steps from {self.shortest:.3g} to {self.longest:.3g} s, {self.rejected} done anew"


@dataclass
class Outcome:
    """How a run ended. status: completed, terminated, diverged, interrupted or failed.

    completed: the end was reached, or where a block ended the run, which `termination` then says, with the last sample.
    terminated: a block ended it within a step, which could not be repeated to there, so that the samples end before.
    time: the simulated time reached (s). seconds: wall-clock time of each part. inner_steps: how many were taken and
    how many rejected of what is integrated within a tolerance, by block, or of all as "joint". signal: the number of
    the signal that interrupted it, or 0. resumed: from which time (s) it went on, where it did; checkpoint: the one
    that it leaves, and of which time (s).
    """

    diagram: str
    status: str
    steps: int
    time: float
    method: str
    engine: str
    kernels_compiled: int
    seconds: dict[str, float]
    metrics: dict[str, Any]
    results: str | None
    inner_steps: dict[str, dict[str, int]] = field(default_factory=dict)
    error: CosimError | None = None
    signal: int = 0
    termination: CosimError | None = None  # who ended a completed run
    events: list[Event] = field(default_factory=list)
    warnings: list[CosimError] = field(default_factory=list)  # what FMUs make different, and conditions that failed
    conditions: list[Finding] = field(default_factory=list)  # those that are judged along a run
    requirements: dict[str, Verdict] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    windows: dict[str, str] = field(default_factory=dict)
    accuracy: dict[str, Any] = field(default_factory=dict)  # of metrics, where somebody has asked for it
    swaps: list[str] = field(default_factory=list)  # what each block keeps and drops whose type a layer replaces
    stepping: Stepping | None = None  # where a tolerance chose the steps
    profile: dict[str, Any] = field(default_factory=dict)  # what the time went to, where somebody has asked for it
    resumed: float | None = None
    checkpoint: tuple[str, float] | None = None

    @property
    def reason(self) -> str:
        """Why the run ended before its time, or nothing."""
        ended = self.error or self.termination
        return ended.message if ended else ""

    @property
    def verdicts(self) -> list[dict[str, Any]]:
        """The conditions as JSON has them."""
        return [asdict(finding) for finding in self.conditions]

    @property
    def margins(self) -> list[dict[str, Any]]:
        """The verdicts on requirements as JSON has them."""
        return [verdict.as_json() for verdict in self.requirements.values()]

    @property
    def kept(self) -> bool | None:
        """Whether all requirements are kept; None where that is undecided of one, and none is violated."""
        found = [verdict.holds for verdict in self.requirements.values()]
        return False if False in found else None if None in found else True

    def as_json(self) -> str:
        """One JSON object, as of `for_json`."""
        names = ["diagram", "status", "steps", "time", "method", "engine", "kernels_compiled", "seconds", "metrics"]
        names.append("results")
        content = {name: getattr(self, name) for name in names}
        if self.error:
            content["error"] = str(self.error)
        if self.termination:
            content["ended"] = str(self.termination)
        if self.warnings:
            content["warnings"] = [str(warning) for warning in self.warnings]
        if self.inner_steps:
            content["inner_steps"] = self.inner_steps
        if self.conditions:
            content["conditions"] = self.verdicts
        if self.requirements:
            content["requirements"] = self.margins
        if self.accuracy:
            content["accuracy"] = self.accuracy
        if self.profile:
            content["profile"] = self.profile
        if self.swaps:
            content["swaps"] = self.swaps
        if self.stepping:
            content["stepping"] = asdict(self.stepping)
        if self.resumed is not None:
            content["resumed"] = self.resumed
        if self.checkpoint:
            content["checkpoint"] = dict(zip(("file", "time"), self.checkpoint, strict=True))
        return json.dumps(reductions.for_json(content), ensure_ascii=False)
