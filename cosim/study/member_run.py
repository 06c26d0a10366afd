"""Runs one member of a study to a row: one small dictionary, as JSON has it, with everything that is kept of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from cosim.engine.outcome import Outcome
from cosim.engine.run import Run
from cosim.errors import CosimError, ResultError
from cosim.machine.supervision import never
from cosim.results.metrics import for_json
from cosim.results.result_file import open_result
from cosim.study.plan import Member
from cosim.study.variants import Prepared, Variants
from cosim.wiring.network import Finding

Row = dict[str, Any]
UNFINISHED = ("running", "interrupted")
"""What the file of a run says that is not at its end, or never came there."""
MARK = "member"
"""The attribute of a member's file that has its key."""


def run(
    variants: Variants,
    member: Member,
    file: Path | None,
    stopped: Callable[[], bool] = never,
    prepared: Prepared | None = None,
) -> Row:
    """Run a member; what goes wrong is in the row. file: where its signals are recorded, if they are.

    stopped: whether somebody wants it to stop, which interrupts it. Raises: ResultError if that file cannot be written.
    """
    row: Row = {"variant": member.variant, "grid": list(member.grid), "draw": member.draw}
    try:
        prepared = prepared or variants.prepared(member)
        run = _run(variants, member, file, prepared)
    except CosimError as error:
        return {**row, **lost(error.message)}
    outcome = run.execute(stopped=stopped)
    if isinstance(outcome.error, ResultError):
        raise outcome.error
    row |= _kept(outcome)
    if member.until is not None:
        whole = run.steps == prepared.network.diagram.run.steps
        row["bounds"] = {name: for_json(one.bound(whole)) for name, one in run.reductions.monitors.items()}
    if variants.study.sighting and run.samples:
        row["observed"] = variants.study.sighting.of(*run.samples.flat())
    return row


def lost(reason: str) -> Row:
    """What is kept of a member that could not begin."""
    return {
        "status": "failed",
        "reason": reason,
        "steps": 0,
        "seconds": 0.0,
        "metrics": {},
        "events": {},
        "conditions": {},
        "requirements": {},
    }


def _run(variants: Variants, member: Member, file: Path | None, prepared: Prepared) -> Run:
    if file:  # through all layers, so that the file says exactly which diagram it comes from
        network = variants.wire(member.variant, member.settings)
        _remove_damaged(file)
        return Run(network, output=file, attributes={MARK: prepared.key})
    until = math.inf if member.until is None else member.until
    kept = variants.study.sighting is not None
    made = prepared.program, prepared.kernels
    return Run(prepared.network, prepared=made, kept=kept, until=until, margins=member.until is not None)


def _remove_damaged(file: Path) -> None:
    """A member's file is the study's own: one that a crash has left, and nobody can read, makes way for the new one."""
    if file.is_file():
        try:
            open_result(file).close()
        except ResultError:
            file.unlink(missing_ok=True)


def holds(file: Path, key: str) -> bool:
    """Whether a file has the signals of the member with that key, whole, and of no other that had its name."""
    try:
        with open_result(file) as result:
            return result.attrs.get(MARK) == key and result.attrs["status"] not in UNFINISHED
    except ResultError:
        return False


def _kept(outcome: Outcome) -> Row:
    firsts = {str(e.signal): e.times if isinstance(e.times, float) else e.times[0]["time"] for e in outcome.events}
    return {
        "status": outcome.status,
        "reason": outcome.reason,
        "steps": outcome.steps,
        "seconds": outcome.seconds["solve"],
        "metrics": for_json({**outcome.metrics, **{v.name: v.margin for v in outcome.requirements.values()}}),
        "events": firsts,
        "conditions": _verdicts(outcome.conditions),
        "requirements": {v.name: [v.holds, v.place] for v in outcome.requirements.values()},
    }


def _verdicts(findings: Iterable[Finding]) -> dict[str, bool | None]:
    """By each condition's name whether it holds, for the whole fleet: what fails for one member fails."""
    found: dict[str, bool | None] = {}
    for finding in findings:
        both = (found.get(finding.name, True), finding.holds)
        found[finding.name] = False if False in both else None if None in both else True
    return found
