"""Which signals of a run are bodies that move, and what goes with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.errors import PlotError
from cosim.language.reader import endpoint
from cosim.plot.plane import read_beside, read_positions
from cosim.plot.signals import Drawable, units_of
from cosim.results import diagram_differences

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
    """What moves: signals by name; None is what the diagram or a port's name says, "" is not shown.

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


def find(result: Drawable, motion: Motion) -> Motion:
    """The motion with the recorded signals for what it leaves open, and nothing where there is none.

    They are those that the diagram names in its section `animation`; where it has none, those of the ports in PORTS.
    Raises: PlotError if there are several, or no positions.
    """
    declared = _declared(result)
    for part, port in PORTS.items():
        if getattr(motion, part) is not None:
            continue
        if declared:
            found: Any = {part: _recorded(result, part, declared.get(part, ""))}
            motion = replace(motion, **found)
            continue
        fits = _fits(result, part, motion)
        named = [name for name in result.signals if endpoint(name)[1] == port and fits(name)]
        if len(named) > 1:
            message = f"{' and '.join(named)} could be the {part}"
            raise PlotError(message, fix=f"say which: --{part} {named[0]}")
        found = {part: named[0] if named else ""}
        motion = replace(motion, **found)
    if not motion.positions:
        lists = [name for name in result.signals if _fits(result, "positions", motion)(name)]
        fix = f"say which: --positions {lists[0]}" if lists else "record a signal of shape (bodies, 2 or more)"
        raise PlotError("no recorded signal is known to be positions", fix=fix)
    return motion


def _declared(result: Drawable) -> dict[str, str]:
    """What the diagram of a result says of its animation."""
    said = (diagram_differences.read(result) or {}).get("animation", {})
    return {part: str(name) for part, name in said.items() if part in PORTS} if isinstance(said, dict) else {}


def _recorded(result: Drawable, part: str, name: str) -> str:
    if name and name not in result.signals:
        message = f"{result.path} has not recorded `{name}`, which its diagram names as `animation.{part}`"
        raise PlotError(message, fix=f"add {name} to `record.signals`, or say which: --{part} a.b")
    return name


def _fits(result: Drawable, part: str, motion: Motion) -> Callable[[str], bool]:
    """Whether a signal has the shape of a part: that of positions, or one that goes with them."""

    def fits(name: str) -> bool:
        shape = result.signals[name].shape
        if part == "positions":
            return len(shape) == 2 and shape[1] >= 2
        bodies_ = result.signals[motion.positions].shape[0] if motion.positions in result.signals else 0
        return shape[:1] == (bodies_,) and len(shape) == (1 if part == "radii" else 2)

    return fits


@dataclass(frozen=True)
class Bodies:
    """What moves, as numbers: positions x and references (k, bodies, at least 2), radii (bodies,) or None, edges.

    neighbours, weights: (k, bodies, capacity) or None. unit: of lengths. name: of the fleet, such as `robot`.
    """

    times: np.ndarray
    x: np.ndarray
    radii: np.ndarray | None
    references: np.ndarray | None
    neighbours: np.ndarray | None
    weights: np.ndarray | None
    unit: str
    name: str
    outer: float

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The lower and the upper corner of where bodies come, with a margin."""
        points = self.x[:, :, :2]
        low, high = np.nanmin(points, axis=(0, 1)), np.nanmax(points, axis=(0, 1))
        largest = 0.0 if self.radii is None else float(np.nanmax(self.radii, initial=0.0))
        margin = 2 * largest + 0.04 * float(np.max(high - low)) or 1.0
        return low - margin, high + margin


def read(result: Drawable, motion: Motion) -> Bodies:
    """What moves in a run, by a motion that `find` has completed. Raises: PlotError, ResultError."""
    name = motion.positions or ""
    x = read_positions(result, name)
    parts = {p: read_beside(result, p, getattr(motion, p), x.shape[1]) for p in PORTS if p != "positions"}
    neighbours, weights = _edges_of(motion, parts["neighbours"], parts["weights"], x.shape[1])
    radii = parts["radii"]
    first = None if radii is None else np.where(np.isfinite(radii[0]), radii[0], 0.0)
    signal = result.signals.get(name.partition("[")[0])
    unit, fleet = (units_of(signal)[0], signal.fleet) if signal else ("", "")
    return Bodies(result.times, x, first, parts["references"], neighbours, weights, unit, fleet, motion.outer)


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
