"""How a metric is distributed over random draws: the share of runs up to each value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim.plot import style


@dataclass
class Distribution:
    """metric: its name. threshold: a value worth a line, with its name."""

    metric: str
    label: str = ""
    limits: tuple[float, float] | None = None
    thresholds: Mapping[str, float] = field(default_factory=dict)


def draw(layout: Distribution, groups: Mapping[str, np.ndarray], output: Path) -> None:
    """A line for each group of runs; its values (count,) are the metric's, NaN where there is none."""
    with style.style() as pyplot:
        figure, axis = pyplot.subplots(figsize=(style.WIDTH * 0.75, 2.7))
        for k, (name, group) in enumerate(groups.items()):
            values = np.sort(group[~np.isnan(group)])
            if values.size:
                axis.step(
                    values, np.arange(1, values.size + 1) / values.size, where="post", label=name, **style.line(k)
                )
        for name, value in layout.thresholds.items():
            axis.axvline(value, color="#505050", linewidth=0.8, linestyle=(0, (1, 1.5)))
            axis.annotate(
                name, (value, 1), (3, -9), xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=7
            )
        if layout.limits:
            axis.set_xlim(*layout.limits)
        axis.set_xlabel(layout.label or layout.metric)
        axis.set_ylabel("share of runs")
        axis.set_ylim(0, 1)
        figure.legend(loc="outside right upper")
        style.save(figure, output)
