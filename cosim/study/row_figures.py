"""A row of a study: its figures as single numbers, which of them lie beyond a limit, and where it stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.requirements.margins import NO_MARGIN
from cosim.study.definition import STEP_TIME, Study

Row = Mapping[str, Any]
"""As of `member_run`."""


def scalar(value: Any) -> float | None:
    """A metric as one number: events are counted; None where there is none."""
    if isinstance(value, bool | int | float):
        return float(value)
    return float(len(value)) if is_events(value) else None


def is_events(value: Any) -> bool:
    """Whether a metric's value is a list of events."""
    return isinstance(value, list) and all(isinstance(item, dict) for item in value)


def figure(row: Row, name: str) -> float | None:
    """A figure of a run, if it has that and it is no array; STEP_TIME is the wall-clock time of a step (us)."""
    if name == STEP_TIME:
        return 1e6 * row["seconds"] / row["steps"] if row["steps"] else None
    return scalar(row["metrics"].get(name))


def number(row: Row, name: str) -> float | None:
    """As `figure`; a margin of zero is on the side that its verdict says."""
    found = figure(row, name)
    holds, _ = row.get("requirements", {}).get(name, (None, ""))
    return (NO_MARGIN if holds else -NO_MARGIN) if found == 0.0 and holds is not None else found


def satisfies(numbers: np.ndarray, above: float | None, below: float | None) -> np.ndarray:
    """Which numbers are above and below the limits; NaN is not."""
    result: np.ndarray = ~np.isnan(numbers)
    if above is not None:
        result &= numbers > above
    if below is not None:
        result &= numbers < below
    return result


def label(study: Study, row: Row, dimension: str) -> str:
    """Where a member stands on one of the study's dimensions, as text."""
    at = place_on(study, row, dimension)
    axis = next((axis for axis in study.grid if axis.name == dimension), None)
    return axis.labels[at] if axis else str(at)


def place_on(study: Study, row: Row, dimension: str) -> Any:
    """Where a member stands on a dimension: a variant's name, or a number from 0."""
    if dimension in ("variant", "draw"):
        return row[dimension]
    return row["grid"][[axis.name for axis in study.grid].index(dimension)]
