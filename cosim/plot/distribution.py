"""How a metric is distributed over random draws: the share of runs up to each value."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.plot import style

LETTERS = 90
"""Of titles side by side over all panels."""


@dataclass
class Distribution:
    """metric: its name. threshold: a value worth a line, with its name."""

    metric: str
    label: str = ""
    limits: tuple[float, float] | None = None
    thresholds: Mapping[str, float] = field(default_factory=dict)


def draw(layout: Distribution, panels: Mapping[str, Mapping[str, np.ndarray]], output: Path) -> None:
    """A panel for each title, with a line for each group of runs: values (count,) of the metric, NaN where none."""
    with style.style():
        size = (style.WIDTH, 2.6) if len(panels) > 1 else (style.COLUMN * 1.35, 2.6)
        figure, axes = style.subplots(1, len(panels), size, sharex=True, sharey=True)
        for axis, (title, groups) in zip(axes.flat, panels.items(), strict=True):
            _panel(axis, layout, groups)
            axis.set_title(textwrap.fill(title, max(LETTERS // len(panels), 8)))
        axes.flat[0].set_ylabel("share of runs")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        if len(labels) > 1:
            figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6))
        style.save(figure, output)


def _panel(axis: Any, layout: Distribution, groups: Mapping[str, np.ndarray]) -> None:
    for k, (name, group) in enumerate(groups.items()):
        values = np.sort(group[~np.isnan(group)])
        if values.size:
            shares = np.arange(values.size + 1) / values.size
            axis.step(values[[0, *range(values.size)]], shares, where="post", label=name, **style.line(k))
    for name, value in layout.thresholds.items():
        axis.axvline(value, color="#505050", linewidth=0.8, linestyle=(0, (1, 1.5)))
        place = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "rotation": 90}
        axis.annotate(name, (value, 0.98), (-2, 0), ha="right", va="top", fontsize=7, color="#505050", **place)
    if layout.limits:
        axis.set_xlim(*layout.limits)
    axis.set_xlabel(layout.label or layout.metric)
    axis.set_ylim(0, 1)
