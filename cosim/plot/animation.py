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
from cosim.plot import scene as scenes
from cosim.plot.motion import Motion
from cosim.plot.scene import Scene
from cosim.results.result_file import Result

FORMATS = ("mp4", "gif", "html")
DOTS = {"gif": 90, "mp4": 140}
"""Dots an inch: a frame is looked at for a moment."""
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
        pictures = _pictures(scenes.scene(moving), shown, DOTS[kind])
        with files.fresh(output) as new:
            (_film if kind == "mp4" else _gif)(new, pictures, seconds / len(shown))
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


def _pictures(scene: Scene, shown: np.ndarray, dots: int = 90) -> Iterator[Any]:
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
