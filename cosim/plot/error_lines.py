"""How errors fall with the step: a line for each figure, both axes logarithmic, so that its slope is the order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim.plot import style


def draw(steps: Sequence[float], errors: Mapping[str, Sequence[float]], output: Path) -> None:
    """Draw each figure's relative errors at the steps (s); zeros and infinities have no place. Raises: PlotError."""
    with style.style():
        figure, axes = style.subplots(1, 1, (style.COLUMN * 1.35, 3.2))
        axis = axes[0, 0]
        for k, (name, found) in enumerate(errors.items()):
            points = [(step, error) for step, error in zip(steps, found, strict=True) if 0.0 < error < math.inf]
            axis.loglog(
                [step for step, _ in points],
                [error for _, error in points],
                marker="o",
                markersize=3,
                label=name,
                **style.line(k),
            )
        axis.set_xlabel("step (s)")
        axis.set_ylabel("error, relative to the figure")
        axis.set_xticks(steps, [f"{step:g}" for step in steps])
        axis.minorticks_off()
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        style.save(figure, output)
