"""What a frame of a moving picture shows: a few bodies with all that is known of them, or a crowd, drawn as one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cosim.plot import style
from cosim.plot.motion import Bodies
from cosim.plot.plane import MOST_NUMBERED, Body, bodies

TRAIL = 3.0
"""Seconds of the way that a body came which are shown behind it."""


SMALLEST = 0.004
"""Of a body in a crowd, as a part of the picture: smaller ones would not be seen."""


def scene(moving: Bodies) -> Scene:
    """The frames of some bodies."""
    return Crowd(moving) if moving.x.shape[1] > MOST_NUMBERED else Scene(moving)


class Scene:
    """All that is drawn of a few bodies, frame by frame."""

    def __init__(self, moving: Bodies) -> None:
        self.moving = moving
        self.times, self.x = moving.times, moving.x
        self.references, self.neighbours, self.weights = moving.references, moving.neighbours, moving.weights
        self.low, self.high = moving.box()
        dot = 0.006 * float(np.max(self.high - self.low))
        self.radii = np.full(self.x.shape[1], dot) if moving.radii is None else moving.radii
        self.trails: list[Any] = []
        self.ranges: list[Any] = []
        self.crosses: list[Any] = []
        self.bodies: list[Body] = []
        self.arrows: dict[tuple[int, int], Any] = {}
        self.points = 0.93 * 72 * style.WIDTH / (self.high[0] - self.low[0])  # of print for a unit of length, about

    def size(self) -> tuple[float, float]:
        """Inches; as wide as a page, as high as the bodies' way needs."""
        width, height = self.high - self.low
        return style.WIDTH, float(np.clip(style.WIDTH * height / width + 0.5, 2.5, 7.0))

    def time(self, k: int) -> str:
        """The title of a frame."""
        return f"t = {self.times[k]:5.2f} s"

    def frame(self, axis: Any) -> Any:
        """Prepare the axes, with all that moves; returns the title."""
        from matplotlib.patches import Circle

        for i, radius in enumerate(self.radii):
            look: Any = {"color": style.COLOURS[i % len(style.COLOURS)], "animated": True}
            self.trails += axis.plot([], [], linewidth=0.8, alpha=0.6, **look)
            self.ranges.append(Circle((0, 0), self.moving.outer * radius, alpha=0.08, linewidth=0, **look))
            axis.add_artist(self.ranges[-1])
            if self.references is not None:
                self.crosses += axis.plot([], [], "+", markersize=5, markeredgewidth=0.8, **look)
        self.bodies = bodies(axis, self.x[0], self.radii)
        for artist in (artist for body in self.bodies for artist in body.artists):
            artist.set_animated(True)
        return self.place(axis)

    def place(self, axis: Any) -> Any:
        """The axes without what moves; returns the title."""
        axis.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), aspect="equal")
        unit = style.unit_text(self.moving.unit)
        axis.set_xlabel(f"$p_x$ ({unit})" if unit else "$p_x$")
        axis.set_ylabel(f"$p_y$ ({unit})" if unit else "$p_y$")
        return axis.set_title(self.time(0), loc="left")

    def move(self, axis: Any, k: int) -> list[Any]:
        """What moves, as it is in one frame, from the lowest to the topmost."""
        since = np.searchsorted(self.times, self.times[k] - TRAIL)
        for i, trail in enumerate(self.trails):
            trail.set_data(*self.x[since : k + 1, i, :2].T)
            self.ranges[i].center = tuple(self.x[k, i, :2])
            self.bodies[i].move(self.x[k, i])
        for i, cross in enumerate(self.crosses):
            assert self.references is not None
            cross.set_data(*self.references[k, i, :2, None])
        shown = [*self.ranges, *self.trails, *self.crosses, *self._edges(axis, k)]
        shown += [artist for body in self.bodies for artist in body.artists]
        return sorted(shown, key=lambda artist: artist.get_zorder())

    def _edges(self, axis: Any, k: int) -> Iterator[Any]:
        """An arrow from each body to those that hear it; the stronger the edge, the darker."""
        from matplotlib.patches import FancyArrowPatch

        if self.neighbours is None:
            return
        for i, heard in enumerate(self.neighbours[k]):
            for slot, j in enumerate(heard):
                weight = 1.0 if self.weights is None else float(self.weights[k, i, slot])
                if j < 0 or weight < 1e-3:
                    continue
                start, end = tuple(self.x[k, j, :2]), tuple(self.x[k, i, :2])
                shrink: Any = {"shrinkA": self.points * self.radii[j], "shrinkB": self.points * self.radii[i]}
                if (i, j) not in self.arrows:
                    look: Any = {"arrowstyle": "-|>", "mutation_scale": 7, "color": "#404040", "linewidth": 0.8}
                    self.arrows[i, j] = FancyArrowPatch(start, end, animated=True, zorder=2, **look, **shrink)
                    axis.add_artist(self.arrows[i, j])
                arrow = self.arrows[i, j]
                arrow.set_positions(start, end)
                arrow.set(alpha=min(1.0, 0.25 + weight), linestyle="-" if weight >= 1.0 else "--")
                yield arrow


class Crowd(Scene):
    """Many bodies: discs, ways and edges, each kind at once, without numbers, ranges, references and arrowheads."""

    def frame(self, axis: Any) -> Any:
        """Prepare the axes, with all that moves; returns the title."""
        from matplotlib.collections import EllipseCollection, LineCollection

        count = self.x.shape[1]
        colours = [style.COLOURS[i % len(style.COLOURS)] for i in range(count)]
        wide = np.maximum(2 * self.radii, SMALLEST * float(np.max(self.high - self.low)))
        place: Any = {"offsets": self.x[0, :, :2], "offset_transform": axis.transData}
        self.discs = EllipseCollection(
            wide, wide, np.zeros(count), units="xy", facecolors=colours, linewidths=0, animated=True, **place
        )
        self.ways = LineCollection([], colors=colours, linewidths=0.5, alpha=0.5, animated=True)
        self.edges = LineCollection([], colors="#404040", linewidths=0.3, alpha=0.4, animated=True)
        for artist in (self.edges, self.ways, self.discs):
            axis.add_collection(artist, autolim=False)
        return self.place(axis)

    def move(self, axis: Any, k: int) -> list[Any]:
        """What moves, as it is in one frame, from the lowest to the topmost."""
        since = np.searchsorted(self.times, self.times[k] - TRAIL)
        points = self.x[k, :, :2]
        self.discs.set_offsets(points)
        step = max(1, (k - since) // 50)
        self.ways.set_segments(list(np.moveaxis(self.x[since : k + 1 : step, :, :2], 1, 0)))
        if self.neighbours is not None:
            heard = self.neighbours[k]
            hears, slot = np.nonzero(heard >= 0)
            if self.weights is not None:
                strong = self.weights[k, hears, slot] >= 1e-3
                hears, slot = hears[strong], slot[strong]
            self.edges.set_segments(list(np.stack([points[heard[hears, slot]], points[hears]], axis=1)))
        return [self.edges, self.ways, self.discs]
