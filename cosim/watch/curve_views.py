"""Recorded signals as lines of a plot: no more points than it has pixels, of each pixel the least and the largest."""

from __future__ import annotations

import base64
from math import prod
from typing import Any

import numpy as np

from cosim.plot.signals import units_of
from cosim.results.recorded import Recorded
from cosim.watch.orders import View
from cosim.watch.spool import Track

MOST_LINES = 12
"""Of a signal, in one plot."""


def layout(signal: Recorded) -> View:
    """What lines a signal has: one for each member of a fleet, of one of its channels; else one for each element.

    lines: how many; word: what each is one of. channels: their names, where there are several.
    """
    own = signal.shape[1:] if signal.fleet else signal.shape
    lines = signal.shape[0] if signal.fleet else prod(own)
    channels = prod(own) if signal.fleet else 1
    named = len(own) == 1 and len(signal.components) == own[0]
    names = list(signal.components) if named else [str(k + 1) for k in range(prod(own))]
    units = units_of(signal)
    several = units if len(units) == prod(own) else units[:1] * max(prod(own), 1)
    return {
        "name": signal.name,
        "block": signal.name.rpartition(".")[0],
        "about": signal.description,
        "lines": lines,
        "word": signal.fleet or ("" if lines == 1 else "element"),
        "names": names if not signal.fleet else [],
        "channels": names if channels > 1 else [],
        "units": ["" if unit == "1" else unit for unit in several],
        "output": signal.causality == "output",
        "whole": np.dtype(signal.dtype).kind in "iub",
    }


def window(track: Track, wanted: View, span: tuple[float, float], width: int) -> View | None:
    """The lines of a signal between two times (s), for a plot so many pixels wide; None where it is not recorded.

    wanted: the signal's `name`, of a fleet the `channel`, the `first` line, and the `count` of lines. Numbers are
    base64 of little-endian doubles: `t` (p,); `low`, `high` (lines, p), the same where each point is one sample.
    """
    signal = track.signals.get(wanted["name"])
    if signal is None or not len(track.times):
        return None
    times = track.times
    first = max(0, int(np.searchsorted(times, span[0], "right")) - 1)
    last = min(len(times), int(np.searchsorted(times, span[1], "left")) + 1)
    values = _lines(track.read(signal.name)[first:last], signal, wanted)
    low = high = values
    times = np.asarray(times[first:last])
    if len(times) > 2 * width:
        edges = np.unique(np.searchsorted(times, np.linspace(times[0], times[-1], width, endpoint=False)))
        times, low, high = times[edges], np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
    return {"t": _packed(times), "low": _packed(low.T), "high": _packed(high.T), "lines": values.shape[1]}


def _lines(values: np.ndarray, signal: Recorded, wanted: View) -> np.ndarray:
    """The samples (k, lines) of those that are wanted."""
    begin, end = wanted["first"], wanted["first"] + min(wanted["count"], MOST_LINES)
    if signal.fleet:
        flat = values.reshape(*values.shape[:2], prod(signal.shape[1:]))
        found: np.ndarray = flat[:, begin:end, wanted["channel"]]
    else:
        found = values.reshape(len(values), prod(signal.shape))[:, begin:end]
    return np.asarray(found, float)


def _packed(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array, "<f8").tobytes()).decode()


def span_of(track: Track) -> Any:
    """The times (s) of the first and the last sample; nothing where there are none."""
    return [float(track.times[0]), float(track.times[-1])] if len(track.times) else None
