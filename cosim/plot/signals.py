"""Signals of results by name: `plant.x` is all of a signal, `plant.x[1,2]` one element, counting from 1 as CSV does.

`plant.x[:,2]` is the second element of every member.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from cosim.errors import PlotError
from cosim.results.recorded import Array, Recorded

_ELEMENT = re.compile(r"(?P<name>[^\[\]]+)(\[(?P<index>[\d,\s:]+)\])?")


class Drawable(Protocol):
    """What can be drawn: a `cosim.results.result_file.Result`, or whatever else has a run's samples."""

    path: Path
    attrs: dict[str, Any]
    times: Array
    signals: dict[str, Recorded]

    def read(self, name: str) -> Array:
        """All samples of a signal, (k, *shape). Raises: ResultError."""


@dataclass(frozen=True)
class Curve:
    """One number over time, with what to call it.

    label: as it is typed. member, component: which element it is in words, such as `robot 3` and `y`; "" where the
    signal has no such axis.
    """

    label: str
    times: np.ndarray
    values: np.ndarray
    unit: str
    signal: str = ""
    member: str = ""
    component: str = ""

    @property
    def element(self) -> str:
        """Which element of its signal it is, in words."""
        return ", ".join(part for part in (self.member, self.component) if part)


def read(result: Drawable, text: str) -> tuple[Recorded, np.ndarray]:
    """A signal, or some of its elements, (k, *rest). Raises: PlotError, ResultError."""
    name, index = _parsed(result, text)
    values = result.read(name)
    chosen: list[Any] = [slice(None), *(slice(None) if i is None else i for i in index)]
    return result.signals[name], values[tuple(chosen)]


def curves(result: Drawable, text: str) -> list[Curve]:
    """Each element of a signal as a curve. Raises: PlotError, ResultError."""
    name, index = _parsed(result, text)
    signal, values = result.signals[name], result.read(name)
    units = units_of(signal)
    axes = [[i] if isinstance(i, int) else range(n) for i, n in zip(index, signal.shape, strict=True)]
    found = []
    by_channel = bool(signal.shape) and len(units) == signal.shape[-1] > 1
    for element in product(*axes):
        chosen: tuple[Any, ...] = (slice(None), *element)
        place = f"[{','.join(str(i + 1) for i in element)}]" if element else ""
        unit = units[element[-1]] if by_channel else units[0]
        words = _words(signal, element)
        found.append(Curve(f"{name}{place}", result.times, values[chosen].astype(float), unit, name, *words))
    return found


def units_of(signal: Recorded) -> list[str]:
    """The units of a signal's channels, or one for all; "" where none is declared."""
    given = signal.unit if isinstance(signal.unit, tuple) else str(signal.unit or "").split(",")
    return [str(part).strip() for part in given]


def _words(signal: Recorded, element: tuple[int, ...]) -> tuple[str, str]:
    """What an element is called: the member of its fleet, and the component."""
    member = f"{signal.fleet} {element[0] + 1}" if signal.fleet and element else ""
    own = element[1:] if member else element
    if not own:
        return member, ""
    if len(own) == 1 and own[0] < len(signal.components):
        return member, signal.components[own[0]]
    return member, f"component {','.join(str(i + 1) for i in own)}"


def chosen(result: Drawable, text: str) -> str | None:
    """The recorded signal that a text names, whole or some of its elements; None if there is none of that name."""
    if text in result.signals:
        return text
    match = _ELEMENT.fullmatch(text.strip())
    name = match["name"].strip() if match else ""
    return name if name in result.signals else None


def _parsed(result: Drawable, text: str) -> tuple[str, tuple[int | None, ...]]:
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


def split(text: str, separator: str, known: Mapping[str, Any]) -> Iterator[str]:
    """The parts of a text between separators that are not inside brackets; a known signal's name is one part."""
    parts, depth, k = [""], 0, 0
    if text.strip() in known:
        parts, k = [text], len(text)
    while k < len(text):
        depth += {"[": 1, "]": -1}.get(text[k], 0)
        if depth <= 0 and text.startswith(separator, k):
            parts.append("")
            k += len(separator)
        else:
            parts[-1] += text[k]
            k += 1
    return (part.strip() for part in parts if part.strip())
