"""Signals of results by name: `plant.x` is all of a signal, `plant.x[1,2]` one element, counting from 1 as CSV does."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from cosim.errors import PlotError
from cosim.results import Result, Signal

_ELEMENT = re.compile(r"(?P<name>[^\[\]]+)(\[(?P<index>[\d,\s]+)\])?")


@dataclass(frozen=True)
class Curve:
    """One number over time, with what to call it."""

    label: str
    times: np.ndarray
    values: np.ndarray
    unit: str


def read(result: Result, text: str) -> tuple[Signal, np.ndarray]:
    """A signal, or some of its elements, (k, *rest). Raises: PlotError, ResultError."""
    match = _ELEMENT.fullmatch(text.strip())
    if match is None:
        raise PlotError(f"`{text}` names no signal", fix="such as plant.x or plant.x[1,2]")
    values = result.read(match["name"].strip())
    signal = result.signals[match["name"].strip()]
    if match["index"]:
        index = tuple(int(part) - 1 for part in match["index"].split(","))
        inside = len(index) <= values.ndim - 1 and all(
            0 <= i < n for i, n in zip(index, values.shape[1:], strict=False)
        )
        if not inside:
            sizes = ", ".join(f"1–{n}" for n in values.shape[1:])
            raise PlotError(f"`{text}`: no such element", fix=f"its indices are {sizes or 'none'}")
        for i in index:
            values = values[:, i]
    return signal, values


def curves(result: Result, text: str) -> list[Curve]:
    """Each element of a signal as a curve."""
    signal, values = read(result, text)
    units = [part.strip() for part in str(signal.unit or "").split(",")]
    found = []
    for index in np.ndindex(values.shape[1:]):
        place = f"[{','.join(str(i + 1) for i in index)}]" if index else ""
        unit = units[index[-1]] if index and len(units) == values.shape[-1] and len(units) > 1 else units[0]
        found.append(Curve(f"{text}{place}", result.times, values[(slice(None), *index)].astype(float), unit))
    return found
