"""What a study knows of the probabilities that it draws for until they are known."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from cosim.results.formatting import format_value
from cosim.results.text_table import TextTable
from cosim.study import sequential
from cosim.study.definition import Study
from cosim.study.row_figures import Row, label
from cosim.study.sequential import Trials


def as_json(study: Study, rows: Iterable[Row]) -> list[dict[str, Any]]:
    """What is known of each probability, as JSON has it."""
    return [
        {
            "name": one.until.name,
            "variant": one.group[0],
            "grid": list(one.group[1]),
            "draws": draws,
            "violated": one.outcomes[:draws].count(True),
            "undecided": one.outcomes[:draws].count(None),
            "probability": list(one.interval(draws)),
            "confidence": one.until.confidence,
            "verdict": verdict,
        }
        for one, draws, verdict in _judged(study, rows)
    ]


def table(study: Study, rows: Sequence[Row]) -> TextTable | None:
    """A line for each probability of each group; None where the study does not draw until one is known."""
    if not study.until:
        return None
    lines = []
    firsts = {(row["variant"], tuple(row["grid"])): row for row in reversed(rows)}
    dimensions = [d for d in study.dimensions if d != "draw" and (d != "variant" or len(study.variants) > 1)]
    for one, draws, verdict in _judged(study, rows):
        seen = one.outcomes[:draws]
        open_ = f", {seen.count(None)} undecided" if None in seen else ""
        low, high = (100.0 * end for end in one.interval(draws))
        where = [label(study, firsts[one.group], dimension) for dimension in dimensions]
        interval_ = f"{low:.3g} … {high:.3g} %, {100 * one.until.confidence:g} %"
        lines.append([*where, one.until.name, f"{seen.count(True)} of {draws}{open_}", interval_, verdict])
    head = [*dimensions, "until", "violated", "probability, confidence", "it is"]
    return TextTable("known at any number of draws", head, lines) if lines else None


def _judged(study: Study, rows: Iterable[Row]) -> Iterator[tuple[Trials, int, str]]:
    """Each probability with the number of draws after which it is known, or all, and what is known."""
    for one in sequential.trials(study, rows):
        known = one.known_after()
        draws = known or len(one.outcomes)
        p = f"{format_value(100.0 * one.until.probability)} %"
        below = one.interval(draws)[1] <= one.until.probability * (1.0 + 1e-9)
        yield one, draws, "not known yet" if known is None else f"below {p}" if below else f"above {p}"
