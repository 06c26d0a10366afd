"""Bodies moving in the plane: with the edges of a network, their ranges, and the way they came; as GIF or HTML."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from cosim.errors import PlotError
from cosim.language.reader import endpoint
from cosim.plot import style
from cosim.plot.plane import Body, bodies, read_beside, read_positions
from cosim.results.result_file import Result

FORMATS = ("gif", "html")
DOTS = 90
"""Dots an inch: a frame is looked at for a moment."""
TRAIL = 3.0
"""Seconds of the way that a body came which are shown behind it."""
PORTS = {
    "positions": "x",
    "references": "x_d",
    "radii": "radius",
    "neighbours": "neighbours",
    "weights": "weights",
}
"""What a port that plays a part in a motion is called in the library's blocks."""


@dataclass(frozen=True)
class Motion:
    """What moves: signals by name; None is found by its port's name, "" is not shown.

    positions, references: (bodies, at least 2). radii: (bodies,). neighbours: (bodies, capacity), numbers from 0 and
    -1 for none, weights beside them. outer: how many sums of two radii apart two bodies begin to repel each other.
    """

    positions: str | None = None
    references: str | None = None
    radii: str | None = None
    neighbours: str | None = None
    weights: str | None = None
    outer: float = 2.0

    @property
    def signals(self) -> dict[str, str]:
        """The signals that are shown, by the part that they play."""
        return {part: name for part in PORTS if (name := getattr(self, part))}


def find(result: Result, motion: Motion) -> Motion:
    """The motion with the recorded signals for what it leaves open, and nothing where there is none.

    Raises: PlotError if there are several, or no positions.
    """
    for part, port in PORTS.items():
        if getattr(motion, part) is not None:
            continue
        fits = _fits(result, part, motion)
        named = [name for name in result.signals if endpoint(name)[1] == port and fits(name)]
        if len(named) > 1:
            message = f"{' and '.join(named)} could be the {part}"
            raise PlotError(message, fix=f"say which: --{part} {named[0]}")
        found: Any = {part: named[0] if named else ""}
        motion = replace(motion, **found)
    if not motion.positions:
        lists = [name for name in result.signals if _fits(result, "positions", motion)(name)]
        fix = f"say which: --positions {lists[0]}" if lists else "record a signal of shape (bodies, 2 or more)"
        raise PlotError("no recorded signal is known to be positions", fix=fix)
    return motion


def _fits(result: Result, part: str, motion: Motion) -> Callable[[str], bool]:
    """Whether a signal has the shape of a part: that of positions, or one that goes with them."""

    def fits(name: str) -> bool:
        shape = result.signals[name].shape
        if part == "positions":
            return len(shape) == 2 and shape[1] >= 2
        bodies_ = result.signals[motion.positions].shape[0] if motion.positions in result.signals else 0
        return shape[:1] == (bodies_,) and len(shape) == (1 if part == "radii" else 2)

    return fits


def animate(result: Result, motion: Motion, output: Path, seconds: float = 10.0, frames: int = 150) -> Motion:
    """Write a moving picture of a run; returns the signals that it shows. seconds: how long it plays.

    Raises: PlotError, ResultError.
    """
    kind = output.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise PlotError(f"`{output}`: animations are {', '.join(FORMATS)}", fix="such as -o robots.gif")
    motion = find(result, motion)
    scene = _Scene(result, motion)
    shown = np.unique(np.linspace(0, len(scene.x) - 1, min(frames, len(scene.x))).astype(int))
    pictures = list(_pictures(scene, shown))
    pause = round(1000 * seconds / len(shown))
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        if kind == "gif":
            more: Any = {"save_all": True, "append_images": pictures[1:], "duration": pause, "loop": 0}
            pictures[0].save(output, **more)
        else:
            output.write_text(_page(pictures, pause, output.stem), encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        message = f"cannot write {output}: {error.strerror or error}"
        raise PlotError(message, fix="choose a folder that you may write to") from None
    return motion


def _pictures(scene: _Scene, shown: np.ndarray) -> Iterator[Any]:
    """Each frame as an image of few colours. What does not move is drawn once, and copied."""
    with style.style() as pyplot:
        from PIL import Image

        axis: Any
        figure: Any
        figure, axis = pyplot.subplots(figsize=scene.size(), dpi=DOTS)
        title = scene.frame(axis)
        canvas = figure.canvas
        canvas.draw()
        figure.set_layout_engine("none")
        title.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        palette = None
        for k in shown:
            canvas.restore_region(still)
            title.set_text(scene.time(k))
            axis.draw_artist(title)
            for artist in scene.move(axis, k):
                axis.draw_artist(artist)
            image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
            if palette is None:
                palette = image.quantize(256)
            yield image.quantize(palette=palette, dither=Image.Dither.NONE)


def _page(pictures: list[Any], pause: int, title: str) -> str:
    """A page that plays the frames, and needs nothing else."""
    frames = []
    for picture in pictures:
        file = io.BytesIO()
        picture.save(file, "PNG")
        frames.append(f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}")
    page = Template(resources.files("cosim.plot").joinpath("animation.html").read_text(encoding="utf-8"))
    return page.substitute(title=escape(title), frames=json.dumps(frames), last=len(frames) - 1, pause=pause)


def _edges_of(
    motion: Motion, neighbours: np.ndarray | None, weights: np.ndarray | None, count: int
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Both, if they fit each other and so many bodies. Raises: PlotError."""
    if neighbours is not None and (neighbours.dtype.kind not in "iu" or neighbours.max(initial=-1) >= count):
        message = f"`{motion.neighbours}` has no numbers of {count} bodies"
        raise PlotError(message, fix=f"name a signal of whole numbers from 0 to {count - 1}, and -1 for none")
    if neighbours is not None and weights is not None and weights.shape != neighbours.shape:
        message = f"`{motion.weights}` has the shape {weights.shape[1:]}, and `{motion.neighbours}` has"
        raise PlotError(f"{message} {neighbours.shape[1:]}", fix="name a weight for each neighbour")
    return neighbours, weights


class _Scene:
    """All that is drawn of a run, frame by frame."""

    def __init__(self, result: Result, motion: Motion) -> None:
        x = read_positions(result, motion.positions or "")
        parts = {
            part: read_beside(result, part, getattr(motion, part), x.shape[1]) for part in PORTS if part != "positions"
        }
        self.times = result.times
        self.x = x
        self.outer = motion.outer
        self.references = parts["references"]
        self.neighbours, self.weights = _edges_of(motion, parts["neighbours"], parts["weights"], x.shape[1])
        radii = parts["radii"]
        self.radii = np.zeros(x.shape[1]) if radii is None else radii[0]
        self.trails: list[Any] = []
        self.ranges: list[Any] = []
        self.crosses: list[Any] = []
        self.bodies: list[Body] = []
        self.arrows: dict[tuple[int, int], Any] = {}
        margin = 0.3 + 2 * self.radii.max()
        self.low = np.nanmin(x[:, :, :2], axis=(0, 1)) - margin
        self.high = np.nanmax(x[:, :, :2], axis=(0, 1)) + margin
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

        axis.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), aspect="equal")
        axis.set_xlabel("$p_x$ (m)")
        axis.set_ylabel("$p_y$ (m)")
        for i, radius in enumerate(self.radii):
            look: Any = {"color": style.COLOURS[i % len(style.COLOURS)], "animated": True}
            self.trails += axis.plot([], [], linewidth=0.8, alpha=0.6, **look)
            self.ranges.append(Circle((0, 0), self.outer * radius, alpha=0.08, linewidth=0, **look))
            axis.add_artist(self.ranges[-1])
            if self.references is not None:
                self.crosses += axis.plot([], [], "+", markersize=5, markeredgewidth=0.8, **look)
        self.bodies = bodies(axis, self.x[0], self.radii)
        for artist in (artist for body in self.bodies for artist in body.artists):
            artist.set_animated(True)
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
