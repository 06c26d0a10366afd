"""What runs are called in a picture: their files, what their diagrams say otherwise, how they ended."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cosim.plot.lines import Shades
from cosim.plot.signals import Drawable
from cosim.results import diagram_differences
from cosim.results.diagram_differences import Difference

SETTINGS_SHOWN = 2
"""A legend has room for so many settings of each run."""
LONGEST = 60
"""Letters of a run's name with its settings."""
SHADED_FROM = 9
"""So many runs that differ in one number have shades of colour instead of names."""


def labels(runs: Mapping[str, Drawable]) -> dict[str, str]:
    """For each run its name, with the settings in which it differs if they are few, and how it ended before its end."""
    found = _differences(runs)
    told = {}
    for k, (name, run) in enumerate(runs.items()):
        settings = ", ".join(f"{short(item.key)} = {item.texts[k]}" for item in found)
        label = f"{name}: {settings}" if settings and len(found) <= SETTINGS_SHOWN else name
        told[name] = (label if len(label) <= LONGEST else name) + ending(run)
    return told


def ending(run: Drawable) -> str:
    """How a run ended, where that was before its end."""
    status = str(run.attrs.get("status", "completed"))
    if status == "completed":
        return ""
    words = {"running": "no end"}.get(status, status)
    return f" ({words} at {float(run.times[-1]):.4g} s)" if len(run.times) else f" ({words})"


def shades(runs: Mapping[str, Drawable]) -> Shades | None:
    """Colours by the one number in which many runs differ; None where they are few, or differ in something else."""
    found = _differences(runs) if len(runs) >= SHADED_FROM else []
    if len(found) != 1:
        return None
    values = found[0].values
    if not all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in values):
        return None
    return Shades(short(found[0].key), tuple(float(value) for value in values))


def short(key: str) -> str:
    """A key as a study calls its axis: `plant.mass` for `blocks.plant.parameters.mass`."""
    parts = key.split(".")
    is_value = len(parts) > 3 and parts[0] == "blocks" and parts[2] in ("parameters", "start")
    return ".".join([parts[1], *parts[3:]] if is_value else parts[1:] if parts[0] == "blocks" else parts)


def _differences(runs: Mapping[str, Drawable]) -> list[Difference]:
    diagrams: list[Any] = [diagram_differences.read(run) for run in runs.values()]
    if any(diagram is None for diagram in diagrams):
        return []
    return [found for found in diagram_differences.differences(diagrams) if found.changes_run]
