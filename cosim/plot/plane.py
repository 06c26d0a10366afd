"""Bodies in the plane: their paths, the circle that they should form, and themselves to scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from cosim.errors import PlotError, Position
from cosim.plot import style
from cosim.plot.signals import Drawable, read

_BESIDE = {"references": (2, 2), "radii": (1, 0), "neighbours": (2, 1), "weights": (2, 1)}
"""What goes with bodies: how many axes it has, and how many elements along the second one at least."""

MOST_NUMBERED = 60
"""Of more bodies, none has its number."""
HEADING = (0.5, 1.0)
"""From where to where a body's heading is drawn, in radii: its number stands before that."""


@dataclass
class Plane:
    """positions, references: signals (bodies, at least 2). radii: a signal (bodies,), in the unit of positions.

    at: times (s) at which bodies are drawn. places: where each of these is written, by its name.
    """

    positions: str
    references: str = ""
    radii: str = ""
    at: Sequence[float] = ()
    title: str = ""
    unit: str = "m"
    places: Mapping[str, Position] = field(default_factory=dict)


def read_positions(result: Drawable, name: str, place: Position | None = None) -> np.ndarray:
    """Where bodies are (k, bodies, at least 2), NaN where that is not finite. Raises: PlotError, ResultError."""
    _, x = read(result, name)
    if x.ndim != 3 or x.shape[2] < 2:
        raise PlotError(f"`{name}` is no list of positions", place, fix="name a signal of shape (bodies, 2 or more)")
    if not len(x):
        raise PlotError(f"{result.path} has no samples", place, fix="run the diagram again")
    x = np.where(np.isfinite(x), x, np.nan)  # matplotlib leaves out what is nowhere, but for its axes
    if not np.isfinite(x[:, :, :2]).all(axis=2).any():
        raise PlotError(f"no position in `{name}` is finite", place, fix="name another signal, or record a longer run")
    return x


def read_beside(
    result: Drawable, part: str, name: str | None, count: int, place: Position | None = None
) -> np.ndarray | None:
    """What goes with so many bodies: references, radii, neighbours or weights. Raises: PlotError, ResultError."""
    if not name:
        return None
    _, values = read(result, name)
    axes, least = _BESIDE[part]
    if values.ndim != axes + 1 or values.shape[1] != count or (axes > 1 and values.shape[2] < least):
        message = f"`{name}` has the shape {values.shape[1:]}, and cannot be the {part} of {count} bodies"
        wanted = f"({count},)" if axes == 1 else f"({count}, {least} or more)"
        raise PlotError(message, place, fix=f"name a signal of shape {wanted}")
    return values


def draw(result: Drawable, plane: Plane) -> Any:
    """A figure of one run; must be called within `style.style()`.

    All times are in one picture, unless bodies of different times would cover each other: then each has its own.
    """
    paths = _Paths(result, plane)
    shown = [int(np.searchsorted(result.times, t - 1e-9)) for t in plane.at or (result.times[0], result.times[-1])]
    shown = list(dict.fromkeys(min(k, len(result.times) - 1) for k in shown))
    if not paths.cover_each_other(shown):
        size = (style.WIDTH, min(max(style.WIDTH * paths.ratio() + 0.6, 2.5), 6.5))
        figure, grid = style.subplots(1, 1, size)
        axis = grid[0, 0]
        paths.draw(axis, shown)
        axis.set_title(plane.title)
        axis.margins(0.04)
        axes: list[Any] = [axis]
    else:
        rows = -(-len(shown) // 2)
        figure, grid = style.subplots(rows, 2, (style.WIDTH, rows * style.COLUMN + 0.4))
        axes = list(grid.flat)
        half = max(paths.reach(k) for k in shown)
        for axis, since, k in zip(axes, [0, *shown], shown, strict=False):
            paths.draw(axis, [k], since)
            centre = paths.centre(k)
            axis.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
        for axis in axes[len(shown) :]:
            axis.set_axis_off()
        figure.suptitle(plane.title)
    for axis in axes[: len(shown)]:
        axis.set_aspect("equal", adjustable="datalim" if len(axes) == 1 else "box")
        axis.set_xlabel(f"$p_x$ ({plane.unit})")
        axis.set_ylabel(f"$p_y$ ({plane.unit})")
    handles, labels = axes[0].get_legend_handles_labels()
    title = "robot" if paths.count <= 8 else None
    figure.legend(handles, labels, loc="outside upper center", ncols=min(paths.count, 8) + 1, title=title)
    return figure


class _Paths:
    """The ways of some bodies through the plane, those that they should take, and the bodies themselves."""

    def __init__(self, result: Drawable, plane: Plane) -> None:
        places = plane.places
        self.x = read_positions(result, plane.positions, places.get("positions"))
        self.times = result.times
        self.count = self.x.shape[1]
        self.wanted = read_beside(result, "references", plane.references, self.count, places.get("references"))
        radii = read_beside(result, "radii", plane.radii, self.count, places.get("radii"))
        self.radius = np.zeros(self.count) if radii is None else radii[0]

    def cover_each_other(self, shown: Sequence[int]) -> bool:
        """Whether a body at one time covers one at another."""
        least = self.radius[:, None] + self.radius
        pairs = combinations(shown, 2)
        return any(np.any(_distances(self.x[a, :, :2], self.x[b, :, :2]) < least) for a, b in pairs)

    def ratio(self) -> float:
        """Height over width of all ways."""
        width, height = (np.ptp(self.x[:, :, q]) + 2 * self.radius.max() for q in range(2))
        return float(height / max(width, 1e-9))

    def centre(self, k: int) -> np.ndarray:
        """The middle of the bodies and of their references at one time."""
        points = self._points(k)
        middle: np.ndarray = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle

    def reach(self, k: int) -> float:
        """Half the side of a square around them."""
        return float(1.1 * (np.ptp(self._points(k), axis=0).max() / 2 + self.radius.max()))

    def _points(self, k: int) -> np.ndarray:
        points = self.x[k, :, :2]
        if self.wanted is None:
            return points
        centre, radii = _spread(self.wanted[k, :, :2])
        return np.concatenate([points, centre + radii.max(), centre - radii.max()], axis=None).reshape(-1, 2)

    def draw(self, axis: Any, shown: Sequence[int], since: int = 0) -> None:
        """The ways from one sample to the last one that is shown, or to the end, and the bodies at those shown."""
        until = shown[-1] + 1 if since or len(shown) == 1 else len(self.times)
        for i in range(self.count):
            way = self.x[since:until, i]
            axis.plot(way[:, 0], way[:, 1], label=f"{i + 1}", color=style.COLOURS[i % 8], linewidth=0.8, zorder=3)
        dots: Any = {"linestyle": (0, (1, 1.5)), "color": "#808080", "linewidth": 0.7}
        if self.wanted is not None:
            for i in range(self.count):
                axis.plot(*self.wanted[since:until, i, :2].T, zorder=2, **dots)
            axis.plot([], [], label="reference", **dots)
            _circles(axis, self.wanted, shown)
        for k in shown:
            bodies(axis, self.x[k], self.radius)
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
            place = _below((self.x if self.wanted is None else self.wanted)[k, :, :2])
            words: Any = {"ha": "center", "va": "center", "style": "italic", "bbox": box, "zorder": 7}
            axis.text(place[0], place[1], f"{self.times[k]:g} s", **words)


def _distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Between every point of one set and every one of another."""
    distances: np.ndarray = np.linalg.norm(a[:, None] - b, axis=2)
    return distances


class Body:
    """A disc to scale, with its number, and its heading if its positions have a third channel."""

    def __init__(self, axis: Any, name: str, x: np.ndarray, radius: float, colour: str) -> None:
        from matplotlib.patches import Circle

        self._radius = max(radius, 1e-9)
        look: Any = {"facecolor": "white", "edgecolor": colour, "linewidth": 1.0, "zorder": 4}
        self._disc = axis.add_patch(Circle(tuple(x[:2]), self._radius, **look))
        self._heading = axis.plot([], [], color=colour, linewidth=1.0, zorder=5)
        self._number = axis.text(*x[:2], name, ha="center", va="center", fontsize=6.5, zorder=6)
        self.artists = [self._disc, *self._heading, self._number]
        self.move(x)

    def move(self, x: np.ndarray) -> None:
        """Put it at a position: (x, y) or (x, y, heading)."""
        self._disc.center = tuple(x[:2])
        self._number.set_position(tuple(x[:2]))
        if len(x) > 2:
            ends = np.outer(HEADING, self._radius * np.array([np.cos(x[2]), np.sin(x[2])])) + x[:2]
            self._heading[0].set_data(*ends.T)


def bodies(axis: Any, x: np.ndarray, radius: np.ndarray) -> list[Body]:
    """Each body (bodies, at least 2) on the axes."""
    colours = [style.COLOURS[i % len(style.COLOURS)] for i in range(len(x))]
    names = [str(i + 1) if len(x) <= MOST_NUMBERED else "" for i in range(len(x))]
    return [Body(axis, names[i], x[i], radius[i], colours[i]) for i in range(len(x))]


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
    place: np.ndarray = centre - np.array([0.0, radii.max()])
    return place


def _spread(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middle of some points, and their distances from it."""
    centre = points.mean(axis=0)
    return centre, np.linalg.norm(points - centre, axis=1)
