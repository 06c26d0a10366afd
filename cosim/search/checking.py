"""Whether a violation is the system's own, or one of the numerical method: the same run with smaller steps, and others.

A violation is *real* where it is there at every step, and larger than what the margin still changes by; *numerical*
where it is gone with smaller steps, by more than that; else *undecided*.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.accuracy import refinement
from cosim.accuracy.refinement import Refinement
from cosim.engine import run as engine
from cosim.engine.outcome import Outcome
from cosim.engine.run import Run
from cosim.errors import CosimError
from cosim.study.running import FAILED
from cosim.wiring.network import Network

HALF, TENTH = Refinement(steps=2), Refinement(steps=10)
REAL, NUMERICAL, UNDECIDED = "real", "numerical", "undecided"


@dataclass(frozen=True)
class Rerun:
    """The same run done otherwise. how: in words; margin: None where it has none.

    ended: how the run ended where it did not come to its end.
    """

    how: str
    margin: float | None
    ended: str

    @property
    def violates(self) -> bool | None:
        """Whether it violates the requirement too; None where nobody can say."""
        if self.ended:
            return True
        return None if self.margin is None else self.margin <= 0.0


@dataclass(frozen=True)
class Check:
    """What was found. reruns: as the diagram says, with half and a tenth of its steps, by another method.

    error: by how much the margin at the smallest step may be off; None where nobody can tell. why: of the verdict.
    """

    verdict: str
    why: str
    error: float | None
    reruns: tuple[Rerun, ...]


def check(
    overlay: Path, requirement: str, margin: float | None, tell: Callable[[str], None] = lambda how: None
) -> Check:
    """Run an overlay as it is, and otherwise. margin: that of the search. tell: told what is being run.

    Raises: DiagramErrors of the overlay itself, KeyboardInterrupt.
    """
    network = engine.load(overlay)
    reruns = [_rerun(network, "as it is", requirement, tell)]
    if reruns[0].margin != margin and not reruns[0].ended:
        return Check(UNDECIDED, "the search's own run is not reproduced by its overlay", None, tuple(reruns))
    for finer, how in ((HALF, "half the step"), (TENTH, "a tenth of the step")):
        reruns += _others(overlay, refinement.settings(network, finer), how, requirement, tell)
    half = refinement.settings(network, HALF)
    method = "gauss-seidel" if network.diagram.run.method == "jacobi" else "jacobi"
    if network.diagram.run.method != "joint":
        reruns += _others(overlay, [*half, f"run.method={method}"], f"{method}, half the step", requirement, tell)
    sampled = refinement.sampled_by_the_step(network)
    return _judged(reruns, sampled)


def _others(
    overlay: Path, settings: Sequence[str], how: str, requirement: str, tell: Callable[[str], None]
) -> list[Rerun]:
    """The run with other settings; none where the diagram cannot be run so."""
    try:
        return [_rerun(engine.load(overlay, settings), how, requirement, tell)]
    except CosimError:
        return []


def _rerun(network: Network, how: str, requirement: str, tell: Callable[[str], None]) -> Rerun:
    tell(how)
    outcome: Outcome = Run(network).execute()
    if outcome.status == "interrupted":
        raise KeyboardInterrupt
    ended = f"{outcome.status}: {outcome.reason}" if outcome.status in FAILED else ""
    return Rerun(how, outcome.requirements[requirement].margin, ended)


def _judged(reruns: Sequence[Rerun], sampled: dict[str, str]) -> Check:
    named = {rerun.how: rerun for rerun in reruns}
    half, tenth = named.get("half the step"), named.get("a tenth of the step")
    if sampled:
        why = f"{', '.join(sorted(set(sampled.values())))} is sampled at every step: a smaller one makes another system"
        return Check(UNDECIDED, why, None, tuple(reruns))
    if half is None or tenth is None:
        return Check(UNDECIDED, "it cannot be run with smaller steps", None, tuple(reruns))
    verdicts = [rerun.violates for rerun in reruns]
    if None in verdicts or half.margin is None or tenth.margin is None:
        every = all(verdicts) and None not in verdicts
        return Check(REAL if every else UNDECIDED, "by how each run ends", None, tuple(reruns))
    error = abs(half.margin - tenth.margin) if math.isfinite(half.margin - tenth.margin) else 0.0
    if all(verdicts) and tenth.margin < -error:
        return Check(REAL, "it is there at every step, by more than the margin changes", error, tuple(reruns))
    if not tenth.violates and tenth.margin > error:
        return Check(NUMERICAL, "it is gone with smaller steps", error, tuple(reruns))
    return Check(UNDECIDED, "the margin changes with the step by more than its size", error, tuple(reruns))
