"""Figures of lines: panels, each with one or several signals of one or several runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.errors import PlotError, Position
from cosim.plot import style
from cosim.plot.signals import Curve, curves
from cosim.results.result_file import Result

DECADES = 2.5
"""A positive curve that spans more decades than this is drawn on a logarithmic axis, if nothing else is said."""
NAMED = 8
"""More lines than this in a panel are drawn thin, with the legend above them."""
LISTED = 24
"""More lines than this have no names but their number."""


@dataclass
class Panel:
    """One pair of axes. signals: names as of `cosim.plot.signals`; over: the signal on the horizontal axis, else time.

    derivative: draw d signal / d over instead. thresholds: horizontal lines with their names. places: where each of
    these is written, by its name.
    """

    signals: Sequence[str]
    label: str = ""
    title: str = ""
    over: str = ""
    over_label: str = ""
    names: Sequence[str] = ()
    log: bool | None = None
    derivative: bool = False
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None
    thresholds: Mapping[str, float] = field(default_factory=dict)
    places: Mapping[str, Position] = field(default_factory=dict)


def draw(runs: Mapping[str, Result], panels: Sequence[Panel], columns: int = 1, height: float = 1.75) -> Any:
    """A figure of all panels, each with the lines of all runs; must be called within `style.style()`."""
    from matplotlib import pyplot

    rows = -(-len(panels) // columns)
    width = style.WIDTH if columns > 1 else style.COLUMN * 1.35
    figure, axes = pyplot.subplots(rows, columns, figsize=(width, height * rows + 0.35), squeeze=False)
    for k, axis in enumerate(axes.flat):
        if k >= len(panels):
            axis.set_axis_off()
            continue
        _panel(axis, runs, panels[k])
    _share_labels(axes)
    _legends(figure, [axis for axis in axes.flat if axis.axison], len(runs), columns)
    return figure


def _legends(figure: Any, axes: Sequence[Any], runs: int, columns: int) -> None:
    """Say which line is which: once for all panels if they have the same lines, else in each."""
    names = [tuple(axis.get_legend_handles_labels()[1]) for axis in axes]
    if len(axes) > 1 and len(set(names)) == 1 and 1 < len(names[0]) <= LISTED:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 8 if columns > 1 else 5))
        return
    beside = 5 if columns == 1 else 3
    for axis, own in zip(axes, names, strict=True):
        if len(own) > LISTED:
            axis.annotate(f"{len(own)} lines", (1, 1), (-3, -3), **CORNER)
        elif len(own) > NAMED:
            rows = -(-len(own) // beside)
            axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=beside, fontsize=7)
            figure.set_figheight(figure.get_figheight() + 0.18 * rows / columns + 0.1)
        elif len(own) > 1 or runs > 1:
            axis.legend(loc="best")


@dataclass(frozen=True)
class _Line:
    """A line of a panel. number: which of its run's, from 0; runs of other fleets have other numbers of lines."""

    run: str
    number: int
    curve: Curve


def _panel(axis: Any, runs: Mapping[str, Result], panel: Panel) -> None:
    from matplotlib.ticker import NullFormatter

    found = [_Line(run, k, c) for run, result in runs.items() for k, c in enumerate(_curves(result, panel))]
    each = max((line.number + 1 for line in found), default=0)
    _refuse_unused(panel, each, [line.curve for line in found])
    many = len(found) > NAMED
    for k, (line, name) in enumerate(zip(found, _names(runs, panel, found, each), strict=True)):
        # Several lines of several runs: the colour tells which line it is, the dash which run.
        alike = each == 1 or len(runs) == 1
        look = style.line(k) if alike else style.line(line.number, list(runs).index(line.run))
        thin = {"linewidth": 0.7} if many else {}
        axis.plot(line.curve.times, line.curve.values, label=name, **look | thin)
    for name, value in panel.thresholds.items():
        axis.axhline(value, color="#505050", linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1)
        axis.annotate(
            name, (1, value), (-3, 2), xycoords=("axes fraction", "data"), textcoords="offset points",
            ha="right", va="bottom", fontsize=7, color="#505050",
        )  # fmt: skip
    values = [line.curve.values for line in found]
    reaches_zero = panel.limits is not None and panel.limits[0] <= 0
    if panel.log if panel.log is not None else _is_wide(values) and not reaches_zero:
        axis.set_yscale("log", nonpositive="mask")
        axis.yaxis.set_minor_formatter(NullFormatter())
        _limit_decades(axis, values)
    units = {line.curve.unit for line in found}
    unit = style.unit_text(units.pop()) if len(units) == 1 and not panel.derivative else ""
    label = panel.label or (panel.signals[0] if len(panel.signals) == 1 else "")
    axis.set_ylabel(f"{label} ({unit})" if unit else label)
    axis.set_xlabel(panel.over_label or panel.over or "time (s)")
    axis.set_title(panel.title)
    if panel.limits:
        axis.set_ylim(*panel.limits)
    if panel.span:
        axis.set_xlim(*panel.span)
    else:
        axis.margins(x=0)


def _curves(result: Result, panel: Panel) -> list[Curve]:
    found = [curve for text in panel.signals for curve in curves(result, text)]
    x = result.times
    if panel.over:
        over = curves(result, panel.over)
        if len(over) != 1:
            message = f"`{panel.over}` has {len(over)} elements, and lines are drawn over one"
            raise PlotError(message, panel.places.get("over"), fix=f"choose one, such as {over[0].label}")
        x = over[0].values
    return [Curve(c.label, x, _slope(x, c.values) if panel.derivative else c.values, c.unit) for c in found]


def _refuse_unused(panel: Panel, each: int, found: Sequence[Curve]) -> None:
    """Raises: PlotError for more names than a run has lines, and for a span without a sample."""
    if len(panel.names) > each:
        message = f"there are {len(panel.names)} names for {each} line{'s' if each != 1 else ''}"
        raise PlotError(message, panel.places.get("names"), fix="one name for each line, in the order of the signals")
    every = np.concatenate([curve.times for curve in found]) if found else np.zeros(0)
    every = every[np.isfinite(every)]
    if panel.span and panel.over and every.size and not (panel.span[0] < every.max() and every.min() < panel.span[1]):
        message = f"`{panel.over}` is never from {panel.span[0]:g} to {panel.span[1]:g}"
        fix = f"it is from {every.min():g} to {every.max():g}"
        raise PlotError(message, panel.places.get("span"), fix)


def _slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """dy/dx; NaN at a jump of y between two samples, which is left out, and where x stands still."""
    if len(x) < 2:
        return np.full(len(x), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope: np.ndarray = np.gradient(y, x)
    slope[~np.isfinite(slope)] = np.nan
    steps = np.abs(np.diff(y))
    beside = np.maximum(np.concatenate(([np.inf], steps[:-1])), np.concatenate((steps[1:], [np.inf])))
    jumps = np.flatnonzero((steps > 5 * beside) & (steps > 1e-3 * np.ptp(y)))
    slope[np.union1d(jumps, jumps + 1)] = np.nan
    return slope


def _names(runs: Mapping[str, Result], panel: Panel, found: Sequence[_Line], each: int) -> list[str]:
    """What each line is called: the run, the signal, or both, whatever tells them apart; units where they differ."""
    own = [panel.names[n] if (n := line.number) < len(panel.names) else line.curve.label for line in found]
    if len({line.curve.unit for line in found}) > 1:
        units = [style.unit_text(line.curve.unit) for line in found]
        own = [f"{name} ({unit})" if unit else name for name, unit in zip(own, units, strict=True)]
    if each <= 1 and len(runs) > 1:
        return [line.run for line in found]
    return own if len(runs) == 1 else [f"{line.run}: {name}" for line, name in zip(found, own, strict=True)]


def _is_wide(values: Sequence[np.ndarray]) -> bool:
    """Whether curves fit a logarithmic axis only: all of them together, or one alone, and none is negative."""
    if len(values) > 1 and any(np.any(v < 0) for v in values):
        return False
    return _spans_decades(values) or any(_spans_decades([v]) for v in values)


def _spans_decades(values: Sequence[np.ndarray]) -> bool:
    every = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    positive = every[every > 0]
    if not positive.size or every.min() < 0:
        return False
    return bool(np.log10(positive.max() / np.median(positive)) > DECADES)


def _limit_decades(axis: Any, values: Sequence[np.ndarray]) -> None:
    """Leave out the few samples that dip far below all others."""
    lows = [np.quantile(v[v > 0], 0.002) for v in values if np.any(v > 0)]
    if lows:
        axis.set_ylim(bottom=10 ** np.floor(np.log10(min(lows))))


CORNER: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "right", "va": "top", "fontsize": 7}
"""How a note stands in the upper right corner of a panel."""


def _share_labels(axes: Any) -> None:
    """Within a column of panels over the same quantity only the lowest says which."""
    for column in axes.T:
        shown = [axis for axis in column if axis.axison]
        if len({axis.get_xlabel() for axis in shown}) == 1:
            for axis in shown[:-1]:
                axis.set_xlabel("")
