"""Bodies in the plane: their paths, the circle that they should form, and themselves to scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.plot import style
from cosim.plot.signals import read
from cosim.results import Result


@dataclass
class Plane:
    """positions, references: signals (bodies, at least 2). radii: a signal (bodies,), in the unit of positions.

    at: times (s) at which bodies are drawn.
    """

    positions: str
    references: str = ""
    radii: str = ""
    at: Sequence[float] = ()
    title: str = ""
    unit: str = "m"


def draw(result: Result, plane: Plane) -> Any:
    """A figure of one run; must be called within `style.style()`."""
    from matplotlib import pyplot

    _, x = read(result, plane.positions)
    wanted = read(result, plane.references)[1] if plane.references else None
    radius = read(result, plane.radii)[1][0] if plane.radii else np.zeros(x.shape[1])
    shown = [int(np.searchsorted(result.times, t - 1e-9)) for t in plane.at or (result.times[0], result.times[-1])]
    shown = [min(k, len(result.times) - 1) for k in shown]
    span = [np.ptp(x[:, :, q]) + 2 * radius.max() for q in range(2)]
    height = min(max(style.WIDTH * span[1] / span[0] + 0.6, 2.5), 6.5)
    figure, axis = pyplot.subplots(figsize=(style.WIDTH, height))
    for i in range(x.shape[1]):
        axis.plot(x[:, i, 0], x[:, i, 1], label=f"{i + 1}", color=style.COLOURS[i % 8], zorder=3)
        if wanted is not None:
            axis.plot(
                wanted[:, i, 0], wanted[:, i, 1], linestyle=(0, (1, 1.5)), color="#808080", linewidth=0.7, zorder=2
            )
    if wanted is not None:
        _circles(axis, wanted, shown)
        axis.plot([], [], linestyle=(0, (1, 1.5)), color="#808080", linewidth=0.7, label="reference")
    for k in shown:
        bodies(axis, x[k], radius)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
        place = _below((x if wanted is None else wanted)[k, :, :2])
        axis.text(
            place[0], place[1], f"{result.times[k]:g} s", ha="center", va="center", style="italic", bbox=box, zorder=7
        )
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.04)
    axis.set_xlabel(f"$p_x$ ({plane.unit})")
    axis.set_ylabel(f"$p_y$ ({plane.unit})")
    axis.set_title(plane.title)
    figure.legend(loc="outside upper center", ncols=x.shape[1] + 1, title="robot" if x.shape[1] <= 8 else None)
    return figure


def bodies(axis: Any, x: np.ndarray, radius: np.ndarray) -> list[Any]:
    """Each body as a disc to scale, with its number, and its heading if the positions have a third channel."""
    from matplotlib.patches import Circle

    made = []
    for i in range(len(x)):
        colour = style.COLOURS[i % len(style.COLOURS)]
        disc = Circle(
            tuple(x[i, :2]), max(radius[i], 1e-9), facecolor="white", edgecolor=colour, linewidth=1.0, zorder=4
        )
        axis.add_patch(disc)
        made.append(disc)
        if x.shape[1] > 2:
            tip = x[i, :2] + radius[i] * np.array([np.cos(x[i, 2]), np.sin(x[i, 2])])
            made += axis.plot(*zip(x[i, :2], tip, strict=True), color=colour, linewidth=1.0, zorder=5)
        made.append(axis.text(*x[i, :2], str(i + 1), ha="center", va="center", fontsize=6.5, zorder=6))
    return made


def _circles(axis: Any, wanted: np.ndarray, shown: Sequence[int]) -> None:
    """The circle through the references at each time that is shown, if they are on one."""
    from matplotlib.patches import Circle

    for k in shown:
        centre, radii = _spread(wanted[k, :, :2])
        if np.ptp(radii) < 1e-6 * radii.max():
            axis.add_patch(Circle(tuple(centre), radii[0], fill=False, edgecolor="#9a9a9a", linewidth=0.9, zorder=1))


def _below(points: np.ndarray) -> np.ndarray:
    """A place under the middle of some points, on the circle if they are on one."""
    centre, radii = _spread(points)
    return centre - np.array([0.0, radii.max()])


def _spread(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middle of some points, and their distances from it."""
    centre = points.mean(axis=0)
    return centre, np.linalg.norm(points - centre, axis=1)
