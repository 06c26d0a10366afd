"""Bodies moving in the plane: with the edges of a network, their ranges, and the way they came; as GIF or HTML."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import PlotError
from cosim.plot import style
from cosim.plot.plane import bodies
from cosim.plot.signals import read
from cosim.results import Result

FORMATS = ("gif", "html")
DOTS = 90
"""Dots an inch: a frame is looked at for a moment."""
TRAIL = 3.0
"""Seconds of the way that a body came which are shown behind it."""


@dataclass
class Motion:
    """What moves: signals by name; an empty name is not shown.

    positions, references: (bodies, at least 2). radii: (bodies,). neighbours: (bodies, capacity), numbers from 0 and
    -1 for none, weights beside them. outer: how many sums of two radii apart two bodies begin to repel each other.
    """

    positions: str = "plant.x"
    references: str = "reference.x_d"
    radii: str = "plant.radius"
    neighbours: str = "topology.neighbours"
    weights: str = "topology.weights"
    outer: float = 2.0


def animate(result: Result, motion: Motion, output: Path, seconds: float = 10.0, frames: int = 150) -> None:
    """Write a moving picture of a run. seconds: how long it plays. Raises: PlotError, ResultError."""
    kind = output.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise PlotError(f"`{output}`: animations are {', '.join(FORMATS)}", fix="such as -o robots.gif")
    _, x = read(result, motion.positions)
    if x.ndim != 3 or x.shape[2] < 2:
        raise PlotError(
            f"`{motion.positions}` is no list of positions", fix="name a signal of shape (bodies, 2 or more)"
        )
    scene = _Scene(result, motion, x)
    shown = np.unique(np.linspace(0, len(x) - 1, min(frames, len(x))).astype(int))
    with style.style() as pyplot:
        from matplotlib.animation import FuncAnimation, HTMLWriter, PillowWriter

        figure, axis = pyplot.subplots(figsize=scene.size())
        moving = FuncAnimation(figure, lambda k: scene.draw(axis, k), list(shown), blit=False, repeat=False)
        rate = max(round(len(shown) / seconds), 1)
        output.parent.mkdir(parents=True, exist_ok=True)
        writer: Any = PillowWriter(rate) if kind == "gif" else HTMLWriter(rate, embed_frames=True, default_mode="loop")
        moving.save(output, writer=writer, dpi=DOTS)


class _Scene:
    """All that is drawn of a run, frame by frame."""

    def __init__(self, result: Result, motion: Motion, x: np.ndarray) -> None:
        self.times = result.times
        self.x = x
        self.outer = motion.outer
        self.references = self._optional(result, motion.references)
        self.neighbours = self._optional(result, motion.neighbours)
        self.weights = self._optional(result, motion.weights)
        radii = self._optional(result, motion.radii)
        self.radii = np.zeros(x.shape[1]) if radii is None else radii[0]
        margin = 0.3 + 2 * self.radii.max()
        self.low = np.nanmin(x[:, :, :2], axis=(0, 1)) - margin
        self.high = np.nanmax(x[:, :, :2], axis=(0, 1)) + margin
        self.points = 0.93 * 72 * style.WIDTH / (self.high[0] - self.low[0])  # of print for a unit of length, about

    def _optional(self, result: Result, name: str) -> np.ndarray | None:
        return read(result, name)[1] if name in result.signals else None

    def size(self) -> tuple[float, float]:
        """Inches; as wide as a page, as high as the bodies' way needs."""
        width, height = self.high - self.low
        return style.WIDTH, float(np.clip(style.WIDTH * height / width + 0.5, 2.5, 7.0))

    def draw(self, axis: Any, k: int) -> list[Any]:
        """Draw one frame anew."""
        from matplotlib.patches import Circle

        axis.clear()
        axis.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), aspect="equal")
        axis.set_xlabel("$p_x$ (m)")
        axis.set_ylabel("$p_y$ (m)")
        axis.set_title(f"t = {self.times[k]:5.2f} s", loc="left")
        since = np.searchsorted(self.times, self.times[k] - TRAIL)
        for i in range(self.x.shape[1]):
            colour = style.COLOURS[i % len(style.COLOURS)]
            axis.plot(*self.x[since : k + 1, i, :2].T, color=colour, linewidth=0.8, alpha=0.6)
            if self.references is not None:
                axis.plot(*self.references[k, i, :2], "+", color=colour, markersize=5, markeredgewidth=0.8)
            range_ = Circle(
                tuple(self.x[k, i, :2]), self.outer * self.radii[i], facecolor=colour, alpha=0.08, linewidth=0
            )
            axis.add_patch(range_)
        self._edges(axis, k)
        bodies(axis, self.x[k], self.radii)
        return []

    def _edges(self, axis: Any, k: int) -> None:
        """An arrow from each body to those that hear it; the stronger the edge, the darker."""
        if self.neighbours is None:
            return
        for i, heard in enumerate(self.neighbours[k]):
            for slot, j in enumerate(heard):
                weight = 1.0 if self.weights is None else float(self.weights[k, i, slot])
                if j < 0 or weight < 1e-3:
                    continue
                arrow = {"arrowstyle": "-|>", "color": "#404040", "linewidth": 0.8, "alpha": min(1.0, 0.25 + weight)}
                arrow |= {"linestyle": "-" if weight >= 1.0 else "--", "mutation_scale": 7}
                arrow |= {"shrinkA": self.points * self.radii[j], "shrinkB": self.points * self.radii[i]}
                axis.annotate("", self.x[k, i, :2], self.x[k, j, :2], arrowprops=arrow, zorder=2)
