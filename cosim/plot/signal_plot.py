"""The picture of any runs that nobody has described: which signals, in which panels, over what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cosim.errors import PlotError, Position, ResultError, nearest
from cosim.language import source
from cosim.language.source import Node
from cosim.machine import notices
from cosim.plot import legends, lines, run_labels, signals, style
from cosim.plot.lines import Panel
from cosim.plot.signals import Drawable
from cosim.results import result_names
from cosim.results.result_file import Result

MOST_PANELS = 12
"""Of a picture of which nobody says what it shows."""
DASHED = len(style.DASHES)
"""Of more runs the dash does not tell one, and each element has a panel of its own."""
MOST_CHANNELS = 6
"""A signal of more channels is no vector in space, and is drawn in one panel."""
FLAT, SQUARE = 1.75, 3.4
"""Inches of a panel's height: over time, and to scale."""
Results = Drawable | str | Path | Sequence[Drawable | str | Path] | Mapping[str, Drawable | str | Path]


@dataclass(frozen=True)
class View:
    """How it is drawn. log: None where the values choose. window: of time (s). columns: None for as many as fit."""

    log: bool | None = None
    log_x: bool = False
    window: tuple[float, float] | None = None
    columns: int | None = None


def plot(results: Results, shown: str | Sequence[str] = (), view: View = View()) -> Any:
    """Draw signals of one run, or of several over each other; returns matplotlib's Figure, whose label says which.

    results: result files or their paths; a mapping also says what they are called. shown: panels, each a text or all
    with commas between: `plant.x`, some elements of it as of `cosim.plot.signals`, several signals `a.b + c.d` in one
    panel, or one over another, `plant.x[:,2] over plant.x[:,1]`; without any, what the metrics reduce.
    Raises: PlotError, ResultError.
    """
    with ExitStack() as stack:
        runs = _with_samples({name: _opened(one, stack) for name, one in _named(results).items()})
        made = _panels(runs, [shown] if isinstance(shown, str) else list(shown), view)
        stack.enter_context(style.style())
        named = run_labels.labels(runs) if len(runs) > 1 else dict.fromkeys(runs, "run")
        shades = run_labels.shades(runs) if all(_lines_of(runs, panel) == 1 for panel in made) else None
        columns = view.columns or (2 if len(made) > 4 else 1)
        height = FLAT if all(not panel.to_scale for panel in made) else SQUARE
        told = {named[name]: run for name, run in runs.items()}
        drawn = lines.draw(told, made, min(columns, len(made)), height, shades)
        if len(runs) == 1 and (end := run_labels.ending(next(iter(runs.values())))):
            drawn.suptitle(end.strip(" ()"), fontsize=8, color=lines.GREY)
        drawn.set_label(", ".join(_text(panel) for panel in made))
        return drawn


def default_signals(result: Drawable) -> list[str]:
    """What a run's picture shows if nobody says: the recorded signals that its metrics reduce, else all of them.

    Where those are too many for one picture, it shows the outputs among them.
    """
    try:
        tree = source.parse_value(str(result.attrs.get("diagram", "")), Position(str(result.path)))
        metrics = tree.value.get("metrics", Node({}, tree.position)).plain() if isinstance(tree.value, dict) else {}
    except Exception:  # noqa: BLE001  # a result of another version: its diagram is no longer understood
        metrics = {}
    measured = dict.fromkeys(metric["signal"] for metric in metrics.values() if isinstance(metric, dict))
    chosen = [name for name in measured if name in result.signals] or list(result.signals)
    outputs = [name for name in chosen if result.signals[name].causality == "output"]
    return outputs if outputs and len(chosen) > MOST_PANELS else chosen


def _named(results: Results) -> dict[str, Drawable | str | Path]:
    if isinstance(results, Mapping):
        return dict(results)
    every = list(results) if isinstance(results, Sequence) and not isinstance(results, str) else [results]
    if not every:
        raise PlotError("there is no run to be drawn", fix="name a result")
    paths = [Path(one) if isinstance(one, str | Path) else one.path for one in every]
    return dict(zip(result_names.names(paths), every, strict=True))


def _opened(one: Drawable | str | Path, stack: ExitStack) -> Drawable:
    return stack.enter_context(Result(one)) if isinstance(one, str | Path) else one


def _with_samples(runs: dict[str, Drawable]) -> dict[str, Drawable]:
    """The runs that have samples; of the others it is told. Raises: PlotError if none has."""
    empty = [run.path for run in runs.values() if not len(run.times)]
    if len(empty) == len(runs):
        raise PlotError(f"{empty[0]} has no samples", fix="its run ended before the first one; run it again")
    if empty:
        notices.warn(f"without samples, and not drawn: {', '.join(map(str, empty))}")
    return {name: run for name, run in runs.items() if len(run.times)}


def _panels(runs: Mapping[str, Drawable], shown: Sequence[str], view: View) -> list[Panel]:
    known = {name: None for run in runs.values() for name in run.signals}
    texts = [part for text in shown for part in signals.split(text, ",", known)]
    if any(text.strip() for text in shown) and not texts:
        raise PlotError(f"`{shown[0]}` names no signal", fix="names joined by commas, such as plant.x,plant.v")
    first = next(iter(runs.values()))
    texts = texts or [name for name in default_signals(first) if all(name in run.signals for run in runs.values())]
    if not texts and len(runs) > 1 and first.signals:
        raise PlotError(f"{first.path} and the others have no signal in common", fix="compare runs of one diagram")
    if not texts:
        raise PlotError(f"{first.path} holds no signals", fix="add `record:` to the diagram")
    base = Panel([], log=view.log, log_x=view.log_x, window=_window(runs, view.window))
    return [panel for text in texts for panel in _panels_of(runs, text, known, base)]


def _window(runs: Mapping[str, Drawable], window: tuple[float, float] | None) -> tuple[float, float] | None:
    """A window whose ends are times of the runs. Raises: PlotError where there is nothing in it."""
    if window is None:
        return None
    first, last = min(float(run.times[0]) for run in runs.values()), max(float(run.times[-1]) for run in runs.values())
    cut = max(window[0], first), min(window[1], last)
    if not cut[0] < cut[1]:
        message = f"there is nothing to draw from {window[0]:g} to {window[1]:g} s"
        raise PlotError(message, fix=f"the samples are from {first:g} to {last:g} s")
    return cut


def _panels_of(runs: Mapping[str, Drawable], text: str, known: Mapping[str, None], base: Panel) -> list[Panel]:
    """The panels of one text: of a signal of many members one for each channel, else one."""
    parts = list(signals.split(text, " over ", known))
    if len(parts) > 2:
        raise PlotError(
            f"`{text}` has two `over`", fix="one signal over one other, such as plant.x[:,2] over plant.x[:,1]"
        )
    named = list(signals.split(parts[0], " + ", known))
    for name in (*named, *parts[1:]):
        _check(runs, name, known)
    if len(parts) == 2:
        return [replace(base, signals=named, over=parts[1], to_scale=_to_scale(runs, named, parts[1]))]
    if len(named) > 1:
        return [replace(base, signals=named)]
    return [replace(base, signals=[part]) for part in _channels(list(runs.values()), named[0])]


def _check(runs: Mapping[str, Drawable], text: str, known: Mapping[str, None]) -> None:
    """Every run has what a text names. Raises: PlotError, ResultError, with the nearest name of all."""
    for run in runs.values():
        if signals.chosen(run, text) is None:
            signal = text.partition("[")[0].strip()
            others = ", which others have" if signal in known else ""
            raise ResultError(f"{run.path} has no signal `{signal}`{others}", fix=nearest(signal, run.signals))
        signals.curves(run, text)


def _channels(runs: Sequence[Drawable], text: str) -> list[str]:
    """One text for each channel where a signal has several of many members, in the largest fleet; else the text."""
    shapes = [run.signals[text].shape for run in runs if text in run.signals]
    shape = max(shapes, default=())
    if len(runs) > DASHED and len(every := signals.curves(runs[0], text)) > 1 and len(set(shapes)) < 2:
        return [curve.label for curve in every[:MOST_PANELS]] if len(every) <= MOST_PANELS else [text]
    few = len(shape) != 2 or shape[0] * shape[1] * len(runs) <= legends.NAMED or shape[1] > MOST_CHANNELS
    if few or any(other[1:] != shape[1:] for other in shapes):
        return [text]
    return [f"{text}[:,{j + 1}]" for j in range(shape[1])]


def _to_scale(runs: Mapping[str, Drawable], named: Sequence[str], over: str) -> bool:
    """Whether both axes show lengths: then a picture of them is to scale."""
    first = next(iter(runs.values()))
    units = {curve.unit for text in (*named, over) for curve in signals.curves(first, text)}
    return units in ({"m"}, {"mm"}, {"km"})


def _text(panel: Panel) -> str:
    """A panel as it is asked for."""
    return " + ".join(panel.signals) + (f" over {panel.over}" if panel.over else "")


def _lines_of(runs: Mapping[str, Drawable], panel: Panel) -> int:
    return max(sum(len(signals.curves(run, text)) for text in panel.signals) for run in runs.values())
