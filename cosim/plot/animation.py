"""Bodies moving in the plane, with the edges of a network, their ranges, and the way they came: GIF, MP4 or a page."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import PlotError
from cosim.machine import files
from cosim.plot import motion as motions
from cosim.plot import player, style
from cosim.plot.motion import Bodies, Motion
from cosim.plot.plane import Body, bodies
from cosim.results.result_file import Result

FORMATS = ("mp4", "gif", "html")
DOTS = {"gif": 90, "mp4": 140}
"""Dots an inch: a frame is looked at for a moment."""
TRAIL = 3.0
"""Seconds of the way that a body came which are shown behind it."""
SECONDS = 10.0
"""How long a film plays."""
FRAMES = {"gif": 150, "mp4": 300}


def animate(
    result: Result, motion: Motion, output: Path, seconds: float = SECONDS, frames: int | None = None
) -> Motion:
    """Write a moving picture of a run; returns the signals that it shows. seconds: how long it plays.

    It takes the place of one of ours, and of nothing else. Raises: PlotError, ResultError.
    """
    kind = style.kind_of(output, FORMATS, "animations")
    if kind == "mp4" and not has_ffmpeg():
        message = f"{output} needs ffmpeg, which is not installed"
        raise PlotError(message, fix=f"install ffmpeg, or -o {output.with_suffix('.gif')}")
    motion = motions.find(result, motion)
    moving = motions.read(result, motion)
    if kind == "html":
        player.write(output, moving, result.attrs.get("title") or output.stem)
        return motion
    files.refuse_foreign(output, "an animation of this program", style.is_ours)
    count = min(frames or FRAMES[kind], len(moving.times))
    shown = np.unique(np.searchsorted(moving.times, np.linspace(moving.times[0], moving.times[-1], count)))
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(output) as new:
            (_film if kind == "mp4" else _gif)(new, _pictures(_Scene(moving), shown, DOTS[kind]), seconds / len(shown))
    except OSError as error:
        raise style.cannot_write(output, error) from None
    return motion


def film() -> str:
    """The kind of film that can be made here."""
    return "mp4" if has_ffmpeg() else "gif"


def has_ffmpeg() -> bool:
    """Whether films can be written."""
    return shutil.which("ffmpeg") is not None


def _gif(path: Path, frames: Iterator[Any], pause: float) -> None:
    """Frames of few colours, all of the first one's palette."""
    from PIL import Image

    pictures: list[Any] = []
    for frame in frames:
        image = Image.fromarray(frame)
        palette = {"palette": pictures[0], "dither": Image.Dither.NONE} if pictures else {"colors": 256}
        pictures.append(image.quantize(**palette))
    more: Any = {"save_all": True, "append_images": pictures[1:], "duration": round(1000 * pause), "loop": 0}
    pictures[0].save(path, "GIF", comment=style.MARK.encode(), **more)


def _film(path: Path, frames: Iterator[Any], pause: float) -> None:
    """Frames through ffmpeg, as every browser and slide show plays them. Raises: PlotError."""
    first = next(frames)
    height, width = (size - size % 2 for size in first.shape[:2])  # as its colours are of every second dot
    command = ["ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    command += ["-r", f"{1 / pause:.6g}", "-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command += ["-metadata", f"comment={style.MARK}", "-f", "mp4", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as program:  # noqa: S603  # no shell
        assert program.stdin
        assert program.stderr
        try:
            for frame in chain([first], frames):
                program.stdin.write(np.ascontiguousarray(frame[:height, :width]).tobytes())
            program.stdin.close()
        except BrokenPipeError:
            pass
        said = program.stderr.read().decode(errors="replace").strip()
        if program.wait():
            raise PlotError(f"ffmpeg failed: {said[-300:]}", fix="write a GIF: -o robots.gif")


def _pictures(scene: _Scene, shown: np.ndarray, dots: int = 90) -> Iterator[Any]:
    """Each frame (height, width, 3). What does not move is drawn once, and copied."""
    with style.style():
        figure, axes = style.subplots(1, 1, scene.size())
        figure.set_dpi(dots)
        axis = axes[0, 0]
        title = scene.frame(axis)
        canvas = figure.canvas
        canvas.draw()
        figure.set_layout_engine("none")
        title.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        for k in shown:
            canvas.restore_region(still)
            title.set_text(scene.time(k))
            axis.draw_artist(title)
            for artist in scene.move(axis, k):
                axis.draw_artist(artist)
            yield np.array(canvas.buffer_rgba())[:, :, :3]


class _Scene:
    """All that is drawn of a run, frame by frame."""

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

        axis.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), aspect="equal")
        unit = style.unit_text(self.moving.unit)
        axis.set_xlabel(f"$p_x$ ({unit})" if unit else "$p_x$")
        axis.set_ylabel(f"$p_y$ ({unit})" if unit else "$p_y$")
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
