"""Signals of results by name: `plant.x` is all of a signal, `plant.x[1,2]` one element, counting from 1 as CSV does.

`plant.x[:,2]` is the second element of every member.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from cosim.errors import PlotError
from cosim.results.recorded import Recorded
from cosim.results.result_file import Result

_ELEMENT = re.compile(r"(?P<name>[^\[\]]+)(\[(?P<index>[\d,\s:]+)\])?")


@dataclass(frozen=True)
class Curve:
    """One number over time, with what to call it."""

    label: str
    times: np.ndarray
    values: np.ndarray
    unit: str


def read(result: Result, text: str) -> tuple[Recorded, np.ndarray]:
    """A signal, or some of its elements, (k, *rest). Raises: PlotError, ResultError."""
    name, index = _parsed(result, text)
    values = result.read(name)
    chosen: list[Any] = [slice(None), *(slice(None) if i is None else i for i in index)]
    return result.signals[name], values[tuple(chosen)]


def curves(result: Result, text: str) -> list[Curve]:
    """Each element of a signal as a curve. Raises: PlotError, ResultError."""
    name, index = _parsed(result, text)
    signal, values = result.signals[name], result.read(name)
    units = [part.strip() for part in str(signal.unit or "").split(",")]
    axes = [[i] if isinstance(i, int) else range(n) for i, n in zip(index, signal.shape, strict=True)]
    found = []
    by_channel = bool(signal.shape) and len(units) == signal.shape[-1] > 1
    for element in product(*axes):
        chosen: tuple[Any, ...] = (slice(None), *element)
        place = f"[{','.join(str(i + 1) for i in element)}]" if element else ""
        unit = units[element[-1]] if by_channel else units[0]
        found.append(Curve(f"{name}{place}", result.times, values[chosen].astype(float), unit))
    return found


def _parsed(result: Result, text: str) -> tuple[str, tuple[int | None, ...]]:
    """A signal's name, and for each of its axes an index from 0, or None for all of it.

    Raises: PlotError, ResultError.
    """
    if text in result.signals:  # which may end in brackets where they belong to the name of an FMU's variable
        return text, (None,) * len(result.signals[text].shape)
    match = _ELEMENT.fullmatch(text.strip())
    if match is None:
        raise PlotError(f"`{text}` names no signal", fix="such as plant.x, plant.x[1,2] or plant.x[:,2]")
    name = match["name"].strip()
    if name not in result.signals:
        result.read(name)  # raises
    shape = result.signals[name].shape
    written = [part.strip() for part in match["index"].split(",")] if match["index"] else []
    index = tuple(None if part == ":" else int(part) - 1 if part.isdecimal() else -1 for part in written)
    if len(index) > len(shape) or any(i is not None and not 0 <= i < n for i, n in zip(index, shape, strict=False)):
        sizes = ", ".join(f"1–{n}" for n in shape)
        raise PlotError(f"`{text}`: no such element", fix=f"its indices are {sizes or 'none'}, or : for all")
    return name, (*index, *[None] * (len(shape) - len(index)))
