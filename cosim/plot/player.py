"""Bodies that move in a page: drawn by the browser, played, stopped and scrubbed, without anything from the network.

Positions are whole numbers of 16 bits across the box in which bodies move: 1 part in 65,000 of the picture.
"""

from __future__ import annotations

import base64
import json
from html import escape
from importlib import resources
from itertools import count
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from cosim.machine import files
from cosim.plot import style
from cosim.plot.motion import Bodies

MOST_FRAMES = 600
MOST_BYTES = 6_000_000
"""Of what moves, before it is written as text; longer runs have fewer frames."""
NOWHERE = 65535
_NUMBERS = count()


def write(output: Path, moving: Bodies, title: str) -> None:
    """A page of one player, in the place of one of ours and of nothing else. Raises: PlotError, ResultError."""
    files.refuse_foreign(output, "a page of this program", is_ours)
    page = Template(_text("animation.html")).substitute(title=escape(title), player=fragment(moving, title) + script())
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(output) as new:
            new.write_text(page, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise style.cannot_write(output, error) from None


def is_ours(path: Path) -> bool:
    """Whether a file is a page that this program wrote."""
    with path.open("rb") as file:
        return b'<meta name="generator" content="cosim">' in file.read(4096)


def fragment(moving: Bodies, title: str) -> str:
    """A player as a piece of a page, which also needs `script`, once."""
    data = json.dumps(packed(moving)).replace("</", "<\\/")
    name = f"player{next(_NUMBERS)}"
    parts = {"name": name, "title": escape(title, quote=True), "data": data}
    return Template(_text("player.html")).substitute(parts)


def script() -> str:
    """What makes the players of a page play."""
    return f"<script>\n{_text('player.js')}</script>"


def _text(name: str) -> str:
    return resources.files("cosim.plot").joinpath(name).read_text(encoding="utf-8")


def packed(moving: Bodies) -> dict[str, Any]:
    """What the browser draws: arrays as base64 of little-endian numbers, frame by frame."""
    low, high = moving.box()
    shown = _frames(moving)
    scale = float(np.max(high - low))
    x = moving.x[shown]
    content: dict[str, Any] = {
        "times": [float(f"{t:.9g}") for t in moving.times[shown]],
        "low": low.tolist(),
        "high": high.tolist(),
        "scale": scale,
        "count": x.shape[1],
        "unit": "" if moving.unit == "1" else moving.unit,
        "name": moving.name or "body",
        "colours": style.COLOURS,
        "radii": None if moving.radii is None else [float(f"{r:.6g}") for r in moving.radii],
        "outer": moving.outer,
        "x": _base64(_whole(x[:, :, :2], low, scale)),
    }
    if x.shape[2] > 2:
        turns = np.mod(x[:, :, 2], 2 * np.pi) / (2 * np.pi)
        content["headings"] = _base64(np.where(np.isfinite(turns), turns * (NOWHERE - 1), NOWHERE).astype("<u2"))
    if moving.references is not None:
        content["references"] = _base64(_whole(moving.references[shown][:, :, :2], low, scale))
    if moving.neighbours is not None:
        content["capacity"] = moving.neighbours.shape[2]
        content["neighbours"] = _base64(moving.neighbours[shown].astype("<i2"))
        if moving.weights is not None:
            weights = np.clip(np.nan_to_num(moving.weights[shown]), 0.0, 1.0)
            content["weights"] = _base64(np.round(255 * weights).astype("u1"))
    return content


def _frames(moving: Bodies) -> np.ndarray:
    """The samples that are shown, evenly spread over time."""
    of_one = 2 * 2 * moving.x.shape[1] * (1 + (moving.references is not None))
    of_one += 3 * moving.neighbours[0].size if moving.neighbours is not None else 0
    most = int(np.clip(MOST_BYTES // of_one, 2, min(MOST_FRAMES, max(len(moving.times), 2))))
    wanted = np.linspace(moving.times[0], moving.times[-1], most)
    found: np.ndarray = np.unique(np.clip(np.searchsorted(moving.times, wanted - 1e-12), 0, len(moving.times) - 1))
    return found


def _whole(points: np.ndarray, low: np.ndarray, scale: float) -> np.ndarray:
    """Places as whole numbers of a square's side; NOWHERE for what is not there, or outside of the picture."""
    with np.errstate(invalid="ignore"):
        parts = np.round((points - low) / scale * (NOWHERE - 1))
        inside = np.isfinite(parts) & (parts >= 0) & (parts < NOWHERE)
    return np.where(inside, parts, NOWHERE).astype("<u2")


def _base64(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
