"""Runs one member of a study to a row: one small dictionary with everything that is kept of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from cosim import table
from cosim.adapters import fingerprint
from cosim.errors import CosimError
from cosim.metrics import for_json
from cosim.run import Outcome, Run
from cosim.study.plan import Member
from cosim.study.variants import Prepared, Variants

Row = dict[str, Any]


def key(prepared: Prepared) -> str:
    """What a member's result depends on, as a digest: the program, all values, the kernels, the metrics, the recording.

    Titles, names of files and comments are not in it.
    """
    made, diagram = prepared.table, prepared.network.diagram
    digest = hashlib.sha256(_version().encode())
    for array in (made.operations, made.banks, made.arena):
        digest.update(array.tobytes())
    record = diagram.record
    text: list[Any] = [made.initial, made.point, made.between, made.states, made.vectors]
    text += [diagram.run.step, diagram.run.stop, [_identity(prepared, call) for call in made.calls]]
    text += [(name, metric.plain(), _place(prepared, metric)) for name, metric in diagram.metrics.items()]
    text += [record.period, [node.value for node in record.signals]] if record else []
    digest.update(json.dumps(text).encode())
    return digest.hexdigest()[:32]


@cache
def _content(path: Path, modified: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _version() -> str:
    return metadata.version("cosim")


def _identity(prepared: Prepared, call: table.Call) -> list[Any]:
    """What stands behind a call: the compiled module, the Python function as it is now, an FMU's content."""
    module = prepared.kernels.modules[call.slave]
    entry = prepared.network.slaves[call.slave].entry
    if entry.kind == "fmu":
        return [_content(entry.path, entry.path.stat().st_mtime_ns), call.function.name, call.count]
    return [module.key if module else fingerprint(call.function.python), call.function.name, call.count]


def _place(prepared: Prepared, metric: Any) -> list[Any]:
    place = prepared.table.places[prepared.network.find(str(metric.signal.value), metric.signal.position)]
    return [place.offset, place.stride, place.shape, str(place.dtype)]


def run(
    variants: Variants,
    member: Member,
    file: Path | None,
    watch: Callable[[float], None],
    prepared: Prepared | None = None,
) -> Row:
    """Run a member; what goes wrong is in the row. file: where its signals are recorded, if they are.

    Raises: ResultError if that file cannot be written, and what `watch` raises.
    """
    row: Row = {"variant": member.variant, "grid": list(member.grid), "draw": member.draw}
    try:
        run = _run(variants, member, file, prepared)
    except CosimError as error:
        return {**row, "status": "failed", "reason": error.message, "steps": 0, "seconds": 0.0, "metrics": {}}
    outcome = run.execute(watch)
    return {**row, **_kept(outcome)}


def _run(variants: Variants, member: Member, file: Path | None, prepared: Prepared | None) -> Run:
    if file:  # through all layers, so that the file says exactly which diagram it comes from
        return Run(variants.wire(member.variant, member.settings), output=file)
    prepared = prepared or variants.prepared(member)
    return Run(prepared.network, prepared=(prepared.table, prepared.kernels))


def _kept(outcome: Outcome) -> Row:
    firsts = {str(e.signal): e.times if isinstance(e.times, float) else e.times[0]["time"] for e in outcome.events}
    return {
        "status": outcome.status,
        "reason": outcome.error.message if outcome.error else "",
        "steps": outcome.steps,
        "seconds": outcome.seconds["solve"],
        "metrics": for_json(outcome.metrics),
        "events": firsts,
    }
