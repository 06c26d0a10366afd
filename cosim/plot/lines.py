"""Figures of lines: panels, each with one or several signals of one or several runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.errors import PlotError, Position
from cosim.plot import legends, style
from cosim.plot.legends import CORNER, NAMED, Legend
from cosim.plot.scales import is_wide, scale
from cosim.plot.signals import Curve, Drawable, curves
from cosim.plot.thinning import thinned

GREY = "#505050"


@dataclass
class Panel:
    """One pair of axes. signals: names as of `cosim.plot.signals`; over: the signal on the horizontal axis, else time.

    over may have as many elements as the signals, which are drawn pair by pair. derivative: draw d signal / d over
    instead. log: of the vertical axis, None where the values choose. limits, span: of the axes; window: the times (s)
    that are drawn. to_scale: whether a unit is as long on both axes. thresholds: horizontal lines with their names.
    places: where each of these is written, by its name.
    """

    signals: Sequence[str]
    label: str = ""
    title: str = ""
    over: str = ""
    over_label: str = ""
    names: Sequence[str] = ()
    log: bool | None = None
    log_x: bool = False
    derivative: bool = False
    limits: tuple[float, float] | None = None
    span: tuple[float, float] | None = None
    window: tuple[float, float] | None = None
    to_scale: bool = False
    thresholds: Mapping[str, float] = field(default_factory=dict)
    places: Mapping[str, Position] = field(default_factory=dict)


@dataclass(frozen=True)
class Shades:
    """Colours for many runs that differ in one number: what it is called, and each run's value."""

    label: str
    values: tuple[float, ...]

    def mappable(self) -> Any:
        """Values to colours, dark to light, also for those who do not see all of them."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LogNorm, Normalize

        low, high = min(self.values), max(self.values)
        wide = low > 0 and high / low >= 100
        return ScalarMappable((LogNorm if wide else Normalize)(low, high), "cividis")


@dataclass(frozen=True)
class _Line:
    """A line of a panel. number: which of its run's, from 0; runs of other fleets have other numbers of lines."""

    run: str
    number: int
    curve: Curve


def draw(
    runs: Mapping[str, Drawable],
    panels: Sequence[Panel],
    columns: int = 1,
    height: float = 1.75,
    shades: Shades | None = None,
) -> Any:
    """A figure of all panels, each with the lines of all runs; must be called within `style.style()`.

    runs: by what they are called. shades: where the colour tells a run's number instead of its name.
    """
    rows = -(-len(panels) // columns)
    width = style.WIDTH if columns > 1 else style.COLUMN * 1.35
    figure, axes = style.subplots(rows, columns, (width, height * rows + 0.35))
    found = []
    for axis, panel in zip(axes.flat, panels, strict=False):
        found.append(_panel(axis, runs, panel, shades))
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    _share(axes, panels)
    if shades:
        figure.colorbar(shades.mappable(), ax=list(axes.flat), label=style.plain(shades.label), aspect=40 * rows)
        return figure
    legends.place(figure, found, len(runs))
    return figure


def _panel(axis: Any, runs: Mapping[str, Drawable], panel: Panel, shades: Shades | None) -> Legend:
    read = [_Line(run, k, c) for run, result in runs.items() for k, c in enumerate(_curves(result, panel))]
    first = {line.curve.label: line.curve for line in reversed(read)}
    found = [replace(line, curve=_named_as(first[line.curve.label], line.curve)) for line in read]
    each = max((line.number + 1 for line in found), default=0)
    _refuse_unused(panel, each, [line.curve for line in found])
    legend = _draw_lines(axis, runs, panel, found, each, shades)
    for name, value in panel.thresholds.items():
        axis.axhline(value, color=GREY, linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1)
        axis.annotate(
            name, (1, value), (-3, 2), xycoords=("axes fraction", "data"), textcoords="offset points",
            ha="right", va="bottom", fontsize=7, color=GREY,
        )  # fmt: skip
    _scale(axis, panel, [line.curve for line in found])
    units = {line.curve.unit for line in found}
    unit = style.unit_text(units.pop()) if len(units) == 1 and not panel.derivative else ""
    label = panel.label or style.plain(legends.common([line.curve for line in found]))
    axis.set_ylabel(f"{label} ({unit})" if unit and label else label or unit)
    axis.set_xlabel(_x_label(panel, runs))
    axis.set_title(panel.title)
    return legend


def _named_as(first: Curve, curve: Curve) -> Curve:
    """With the names of the first run's: one element has one name, also where another version has recorded it."""
    return replace(curve, member=first.member, component=first.component)


def _draw_lines(
    axis: Any, runs: Mapping[str, Drawable], panel: Panel, found: Sequence[_Line], each: int, shades: Shades | None
) -> Legend:
    """The lines themselves. Several lines of several runs: the colour tells which line it is, the dash which run."""
    legend, own = Legend(axis, len(found)), _names(panel, found)
    thin = {"linewidth": 0.7} if len(found) > NAMED else {}
    paired = each > 1 and len(runs) > 1
    for k, (line, name) in enumerate(zip(found, own, strict=True)):
        at = list(runs).index(line.run)
        look = style.line(line.number, at) if paired else style.line(k)
        if shades:
            look = {"color": shades.mappable().to_rgba(shades.values[at]), "linestyle": "-"}
        shown = name if len(runs) == 1 else style.plain(line.run) if each == 1 else f"{style.plain(line.run)}: {name}"
        dot = {"marker": "o", "markersize": 3} if np.isfinite(line.curve.values).sum() == 1 else {}
        points = (line.curve.times, line.curve.values) if panel.over else thinned(line.curve.times, line.curve.values)
        axis.plot(*points, label=shown, **look | thin | dot)
        if panel.over and len(found) <= legends.LISTED and line.curve.times.size:
            axis.scatter(line.curve.times[:1], line.curve.values[:1], 9, color=look["color"], zorder=3)
        if not paired:
            legend.add(shown, **look | dot)
    if paired:
        first = {line.number: (name, style.line(line.number, 0)) for line, name in zip(found, own, strict=True)}
        for number in sorted(first):
            legend.add(first[number][0], color=first[number][1]["color"])
        for at, run in enumerate(runs):
            legend.add(style.plain(run), color=GREY, linestyle=style.line(0, at)["linestyle"])
    return legend


def _scale(axis: Any, panel: Panel, found: Sequence[Curve]) -> None:
    """The axes' scales and limits. Raises: PlotError where a logarithmic axis has nothing to show."""
    for curve, numbers, log in ((c, n, w) for c in found for n, w in ((c.values, panel.log), (c.times, panel.log_x))):
        if log and not (numbers > 0).any() and np.isfinite(numbers).any():
            message = f"a logarithmic axis shows what is above zero, and `{curve.label}` never is"
            raise PlotError(message, panel.places.get("log"), fix="draw it on a linear axis: --log none, or log: false")
    values = [curve.values for curve in found]
    reaches_zero = panel.limits is not None and panel.limits[0] <= 0
    log = panel.log if panel.log is not None else is_wide(values) and not reaches_zero
    scale(axis, "y", values, log, panel.limits is None)
    scale(axis, "x", [curve.times for curve in found], panel.log_x, bool(panel.over) and panel.span is None)
    lost = sum(int((v <= 0).sum()) for v in values) if panel.log else 0
    if lost:
        axis.annotate(f"{lost} samples at or below 0 are not shown", (1, 1), (-3, -3), color=GREY, **CORNER)
    if panel.limits:
        axis.set_ylim(*panel.limits)
    if panel.span or (panel.window and not panel.over):
        axis.set_xlim(*(panel.span or panel.window or ()))
    elif not panel.over:
        axis.margins(x=0)
    elif panel.to_scale:
        axis.set_aspect("equal", adjustable="datalim")


def _x_label(panel: Panel, runs: Mapping[str, Drawable]) -> str:
    """What the horizontal axis shows, with its unit."""
    if not panel.over or panel.over_label:
        return panel.over_label or "time (s)"
    over = curves(next(iter(runs.values())), panel.over)
    units = {curve.unit for curve in over}
    unit = style.unit_text(units.pop()) if len(units) == 1 else ""
    label = style.plain(legends.common(over) or panel.over)
    return f"{label} ({unit})" if unit else label


def _curves(result: Drawable, panel: Panel) -> list[Curve]:
    """The lines of a run: over time, or over another signal; those that lie in the window, and what they come from."""
    found = [curve for text in panel.signals for curve in curves(result, text)]
    over = curves(result, panel.over) if panel.over else []
    if panel.over and len(over) not in (1, len(found)):
        many = f"there are {len(found)} lines" if len(found) > 1 else "there is 1 line"
        message = f"`{panel.over}` has {len(over)} elements, and {many} to be drawn over them"
        fix = f"choose one, such as {over[0].label}, or one for each line"
        raise PlotError(message, panel.places.get("over"), fix)
    inside = _inside(result.times, panel.window, bool(panel.over))
    lines = []
    for k, curve in enumerate(found):
        x = over[k if len(over) > 1 else 0].values if over else result.times
        values = _slope(x, curve.values) if panel.derivative else curve.values
        lines.append(replace(curve, times=x[inside], values=values[inside]))
    return lines


def _inside(times: np.ndarray, window: tuple[float, float] | None, strict: bool) -> slice:
    """The samples in a window of time; strict: without the ones before and after it, from which lines come in."""
    if window is None:
        return slice(None)
    if not len(times) or window[0] > times[-1] or window[1] < times[0]:
        return slice(0, 0)
    slack = 1e-9 * (window[1] - window[0])
    first, last = (int(k) for k in np.searchsorted(times, (window[0] - slack, window[1] + slack)))
    return slice(first, last) if strict else slice(max(first - 1, 0), last + 1)


def _refuse_unused(panel: Panel, each: int, found: Sequence[Curve]) -> None:
    """Raises: PlotError for more names than a run has lines, and for a span without a sample."""
    if len(panel.names) > each:
        message = f"there are {len(panel.names)} names for {each} line{'s' if each != 1 else ''}"
        raise PlotError(message, panel.places.get("names"), fix="one name for each line, in the order of the signals")
    every = np.concatenate([curve.times for curve in found]) if found else np.zeros(0)
    if panel.window and not every.size:
        message = f"there is no sample from {panel.window[0]:g} to {panel.window[1]:g} s"
        raise PlotError(message, panel.places.get("window"), fix="choose a window within the run")
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


def _names(panel: Panel, found: Sequence[_Line]) -> list[str]:
    """What each line is called within its run; units where they differ."""
    own = legends.distinct([line.curve for line in found])
    return [panel.names[n] if (n := line.number) < len(panel.names) else own[k] for k, line in enumerate(found)]


def _share(axes: Any, panels: Sequence[Panel]) -> None:
    """Within a column of panels over time, one range of time, which only the lowest panel numbers and names."""
    columns = axes.shape[1]
    for column in range(columns):
        own = [(axes.flat[k], panels[k]) for k in range(column, len(panels), columns)]
        if len(own) < 2 or len({axis.get_xlabel() for axis, _ in own}) > 1 or any(panel.over for _, panel in own):
            continue
        if len({panel.span for _, panel in own}) == 1 and len({panel.log_x for _, panel in own}) == 1:
            limits = [axis.get_xlim() for axis, _ in own]
            for axis, _ in own:
                axis.set_xlim(min(low for low, _ in limits), max(high for _, high in limits))
                axis.tick_params(labelbottom=axis is own[-1][0])
        for axis, _ in own[:-1]:
            axis.set_xlabel("")
