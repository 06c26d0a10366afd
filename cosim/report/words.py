"""What the numbers of a study say, in plain words. Everything here is computed from its rows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.results.formatting import format_value
from cosim.study import kept
from cosim.study.definition import Question, Study, TableColumn
from cosim.study.member_run import Row
from cosim.study.row_figures import number, satisfies
from cosim.study.running import FAILED
from cosim.study.text_tables import cell, heading, with_statistic

AGREES = 0.1
"""Relative difference up to which two figures are called the same."""
NAMED = 12
Outcomes = dict[tuple[Any, ...], bool]
EVENTS_OF = 12
"""Studies with at most so many members have their events listed."""


@dataclass(frozen=True)
class Compared:
    """One figure of ours, None if there is none, beside one from elsewhere.

    metric: its name, with the statistic if it is of several runs.
    """

    variant: str
    metric: str
    ours: float | None
    theirs: dict[str, float]


def compared(study: Study, rows: list[Row], reductions: Mapping[str, str]) -> list[Compared]:
    """Every figure that the study's references name, beside ours, reduced over all members of the variant."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    columns: dict[str, TableColumn] = {}
    for item in study.references:
        metric = str(item.metric.value)
        columns[metric] = with_statistic(TableColumn(metric, item.metric), reductions)
        found.setdefault((item.variant, metric), {})[item.origin] = item.value
    members = {variant: [row for row in rows if row["variant"] == variant] for variant, _ in found}
    return [
        Compared(v, heading(columns[m]) if len(members[v]) > 1 else m, cell(columns[m], members[v]), theirs)
        for (v, m), theirs in found.items()
    ]


def differences(study: Study, rows: list[Row], reductions: Mapping[str, str]) -> Iterator[str]:
    """For each source of references: how many figures agree, how many are lower, and each one that differs."""
    items = compared(study, rows, reductions)
    for origin in study.origins:
        own = [item for item in items if origin in item.theirs]
        agree = [item for item in own if _agree(item.ours, item.theirs[origin])]
        lower = [item for item in own if item.ours is not None and item.ours <= item.theirs[origin]]
        yield (
            f"{len(own)} figures beside {origin}: {len(agree)} agree within {100 * AGREES:.0f} %, "
            f"{len(lower)} are at or below."
        )
        for item in own:
            if item not in agree:
                yield difference(f"{item.variant}, {item.metric}", item.ours, origin, item.theirs[origin])


def difference(name: str, ours: float | None, origin: str, theirs: float) -> str:
    """How our figure lies to one from elsewhere that it does not agree with."""
    if ours is None:
        return f"{name}: no value here, {theirs:.3g} in {origin}."
    text = f"{name}: {ours:.3g} here, {theirs:.3g} in {origin}"
    ratio = ours / theirs if theirs else 0.0
    if not 0 < ratio < math.inf:
        return f"{text}."
    size = f"{max(ratio, 1 / ratio):.3g} times" if max(ratio, 1 / ratio) >= 2 else f"{100 * abs(ratio - 1):.0f} %"
    return f"{text}: {size} {'smaller' if ratio < 1 else 'larger'}{' in size' if ours < 0 else ''}."


def _agree(ours: float | None, theirs: float) -> bool:
    return ours is not None and abs(ours - theirs) <= AGREES * abs(theirs)


def events(rows: list[Row]) -> Iterator[str]:
    """What happened when, or in studies of many members, how often."""
    if len(rows) > EVENTS_OF:
        yield from _often(rows)
        return
    for row in rows:
        for name, value in row["metrics"].items():
            if isinstance(value, list) and all(isinstance(item, dict) for item in value):
                text = format_value(value).replace("\n", ", ") if value else "none"
                yield f"{row['name']}, {name}: {text}."
        for signal, first in row.get("events", {}).items():
            yield f"{row['name']}: {signal} first became true at t = {first:.4g} s."


def _often(rows: list[Row]) -> Iterator[str]:
    for signal in dict.fromkeys(signal for row in rows for signal in row.get("events", {})):
        counts = {row["variant"]: [0, 0] for row in rows}
        for row in rows:
            counts[row["variant"]][0] += signal in row.get("events", {})
            counts[row["variant"]][1] += 1
        shares = ", ".join(f"{name} {seen} of {count}" for name, (seen, count) in counts.items())
        yield f"Runs in which {signal} became true: {shares}."


def failures(rows: list[Row]) -> Iterator[str]:
    """Which members did not come to their end, and why."""
    lost = [row for row in rows if row["status"] in FAILED]
    if not lost:
        yield f"All {len(rows)} runs came to their end."
        return
    yield f"{len(lost)} of {len(rows)} runs did not come to their end:"
    for reason in dict.fromkeys(row["reason"] for row in lost):
        names = [row["name"] for row in lost if row["reason"] == reason]
        yield f"{len(names)} × {reason} ({_listed(names)})."


def explanation(study: Study, rows: list[Row]) -> Iterator[str]:
    """The answer to the study's `explain`: how often its condition holds, and what makes the difference."""
    question = study.question
    if question is None:
        return
    metric = str(question.metric.value)
    limits = [f"above {question.above:g}"] if question.above is not None else []
    limits += [f"below {question.below:g}"] if question.below is not None else []
    wanted = f"{metric} {' and '.join(limits)}"
    outcome = {(r["variant"], *r["grid"], r["draw"]): _holds(question, r) for r in rows}
    names = {(r["variant"], *r["grid"], r["draw"]): r["name"] for r in rows}
    base = {key[1:]: holds for key, holds in outcome.items() if key[0] == question.baseline}
    yield _share(question.baseline, study, list(base.values()), wanted)
    lost = [names[question.baseline, *key] for key, holds in base.items() if not holds]
    if lost:
        yield f"It fails in {_listed(lost)}. {_replay(study, lost[0])}"
    else:
        yield f"{question.baseline} has no failure to explain; the variants say what it owes this to."
    for variant in study.variants:
        own = {key[1:]: holds for key, holds in outcome.items() if key[0] == variant}
        if variant == question.baseline or not own:
            continue
        yield _share(variant, study, list(own.values()), wanted)
        yield from _contrast(study, variant, question, base, own, names)


def _contrast(
    study: Study, variant: str, question: Question, base: Outcomes, own: Outcomes, names: dict[Any, str]
) -> Iterator[str]:
    """Runs from the same start whose outcome differs from the baseline's."""
    both = [key for key in own if key in base]
    worse = [key for key in both if base[key] and not own[key]]
    better = [key for key in both if own[key] and not base[key]]
    if worse:
        first = names[(variant, *worse[0])]
        yield (
            f"{len(worse)} of the runs that succeed in {question.baseline} fail in {variant}, "
            f"{_listed([names[(variant, *key)] for key in worse])}: what differs is the reason. {_replay(study, first)}"
        )
    if better:
        yield f"{len(better)} of the failures of {question.baseline} do not happen in {variant}."


def _share(variant: str, study: Study, holds: list[bool], wanted: str) -> str:
    count, good = len(holds), sum(holds)
    low, high = kept.interval(good, count)
    about = study.variants[variant].description
    return (
        f"{variant}{f' ({about})' if about else ''}: {wanted} in {good} of {count} runs, {100 * good / count:.1f} % "
        f"(with 95 % confidence between {100 * low:.1f} % and {100 * high:.1f} %)."
    )


def _holds(question: Question, row: Row) -> bool:
    figure = number(row, str(question.metric.value))
    complete = row["status"] == "completed" and figure is not None
    return complete and bool(satisfies(np.array(figure), question.above, question.below))


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _replay(study: Study, name: str) -> str:
    return f"Replay the first: cosim study {study.path} --member {name}"
