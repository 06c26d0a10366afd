"""What the page's process and the one that runs diagrams tell each other. All of it can be pickled."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.results.recorded import Recorded

View = dict[str, Any]
"""Something for the page, as JSON has it."""


@dataclass(frozen=True, eq=False)
class Order:
    """A run that is wanted.

    save: how often the files had changed before; began: when it was wanted (time.time()). settings, swaps: as of --set
    and --swap. sliders: values by dotted path, on top. shown: signals to be recorded that the diagram does not record.
    folder: for the samples.
    """

    number: int
    save: int
    began: float
    path: Path
    settings: tuple[str, ...]
    swaps: tuple[str, ...]
    sliders: dict[str, float]
    shown: tuple[str, ...]
    folder: Path


@dataclass(frozen=True)
class GiveUp:
    """Nobody wants this order any more."""

    number: int


@dataclass(frozen=True)
class Advance:
    """How far an order is: in words, and as a part of the whole where that is known."""

    number: int
    text: str
    part: float | None = None


@dataclass(frozen=True)
class Sketch:
    """What a diagram is that can run. files: all that it is made from. blocks: more about each, by name."""

    number: int
    files: tuple[Path, ...]
    view: View
    drawing: str
    blocks: dict[str, View]
    sliders: list[View]


@dataclass(frozen=True)
class Mistaken:
    """Why an order has no run. files: all that the diagram is made from, as far as it can be told."""

    number: int
    files: tuple[Path, ...]
    mistakes: list[View]


@dataclass(frozen=True, eq=False)
class Figures:
    """How a run ended. track: where its samples are. values: each signal at its end, as text.

    reduced: the signals of metrics. metrics, requirements: by name, as of `Outcome`; the rest is of metrics.
    """

    number: int
    view: View
    reduced: list[str]
    metrics: dict[str, Any]
    requirements: dict[str, dict[str, Any]]
    units: dict[str, str]
    windows: dict[str, str]
    meanings: dict[str, str]
    values: dict[str, str]
    track: TrackPlace

    @property
    def completed(self) -> bool:
        """Whether the run came to its end."""
        return bool(self.view["status"] == "completed")


@dataclass(frozen=True)
class TrackPlace:
    """Samples in files of a folder. animation: the signals that move, as of a diagram's section."""

    folder: Path
    count: int
    signals: dict[str, Recorded] = field(default_factory=dict)
    animation: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class GivenUp:
    """A order that was not done, as nobody wanted it."""

    number: int


@dataclass(frozen=True)
class Died:
    """The process that did an order is gone; how: in words."""

    number: int
    how: str


Answer = Advance | Sketch | Mistaken | Figures | GivenUp | Died
