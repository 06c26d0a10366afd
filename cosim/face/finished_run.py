"""A run that is over, as data: its figures, how it ended, and the signals that it recorded."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.engine import recording
from cosim.engine.outcome import Event, Outcome
from cosim.engine.run import Run
from cosim.errors import CosimError, PlotError, UnknownPort
from cosim.face import run_tables
from cosim.face.datasets import dataset_of_signals
from cosim.face.pictures import Picture
from cosim.machine import files
from cosim.requirements.verdict import Verdict
from cosim.wiring.network import Finding

if TYPE_CHECKING:
    import xarray


class FinishedRun:
    """A run that is over. `run["plant.x"]` is a recorded signal as an array ``(k, *shape)``, over `times` (k,) in s.

    The axis of a fleet's members comes first in a signal's shape. `signals` has all of them as an xarray Dataset.
    """

    def __init__(self, run: Run, outcome: Outcome) -> None:
        assert run.samples
        self.outcome: Outcome = outcome
        """Everything that the command line's JSON has."""
        self._network = run.network
        self._reductions = run.reductions
        self._recorded = run.samples.signals
        self.times, self._values = run.samples.flat()
        for array in (self.times, *self._values.values()):
            array.flags.writeable = False

    # ---- figures ----

    @property
    def status(self) -> str:
        """completed, terminated, diverged, interrupted or failed, as of `cosim.Outcome`."""
        return self.outcome.status

    @property
    def ended(self) -> str:
        """Why the run ended before its time, in words; "" where it did not."""
        return self.outcome.reason

    @property
    def error(self) -> CosimError | None:
        """What ended it, where that was a failure."""
        return self.outcome.error

    @property
    def metrics(self) -> dict[str, Any]:
        """The diagram's figures by name: numbers, lists, or None where its window held no sample."""
        return self.outcome.metrics

    @property
    def units(self) -> dict[str, str]:
        """The unit of each metric."""
        return self.outcome.units

    @property
    def warnings(self) -> list[CosimError]:
        """What the command line would warn of."""
        return self.outcome.warnings

    @property
    def events(self) -> list[Event]:
        """What happened along it, and when first."""
        return self.outcome.events

    @property
    def conditions(self) -> list[Finding]:
        """The conditions that are judged along a run, with their numbers."""
        return self.outcome.conditions

    @property
    def requirements(self) -> dict[str, Verdict]:
        """How the run keeps each requirement, by name: `holds`, `margin`, `unit`, `time`, `where`."""
        return self.outcome.requirements

    @property
    def time(self) -> float:
        """The simulated time that was reached (s)."""
        return self.outcome.time

    @property
    def steps(self) -> int:
        """How many communication steps were done."""
        return self.outcome.steps

    @property
    def seconds(self) -> dict[str, float]:
        """Wall-clock time of its parts (s): setup, compile, solve."""
        return self.outcome.seconds

    # ---- signals ----

    def __getitem__(self, name: str) -> np.ndarray:
        """The samples ``(k, *shape)`` of a recorded signal, `block.port`. Raises: UnknownBlock, UnknownPort."""
        if name not in self._values:
            self._network.find(name, None)
            fix = f'.set({{"record.signals": [{", ".join(map(repr, [*self._values, name]))}]}})'
            raise UnknownPort(f"`{name}` is not recorded", fix=fix)
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, name: object) -> bool:
        return name in self._values

    @cached_property
    def signals(self) -> xarray.Dataset:
        """All recorded signals, as `xarray.open_dataset` has them of the result file. Raises: MissingPackage."""
        return dataset_of_signals(self._recorded.values(), self.times, self._values, self._about)

    @property
    def _about(self) -> dict[str, Any]:
        return {"title": self._network.diagram.title, "status": self.status, "method": self.outcome.method}

    # ---- files and pictures ----

    def save(self, path: str | Path) -> None:
        """Write the result file that `cosim run` writes. Raises: ResultError."""
        files.require_ending(Path(path), "a result", "nc")
        signals = list(self._recorded.values())
        about = self._network, self._reductions, self.outcome
        recording.write(Path(path), signals, self.times, self._values, *about)

    def plot(self, *signals: str, output: str | Path | None = None) -> Picture:
        """Draw signals as `cosim plot` does: those that the metrics reduce, unless some are named.

        output: a .png, .svg or .pdf where the picture is written too. Raises: PlotError, UnknownPort.
        """
        from cosim.plot import signal_plot, style

        if not self._values:
            raise PlotError("this run recorded no signals", fix='.set({"record.signals": ["block.port"]})')
        for name in re.split(r"\bover\b|[+,]", re.sub(r"\[.*?\]", "", ",".join(signals))) if signals else ():
            self[name.strip()]
        with tempfile.TemporaryDirectory() as folder:
            result = Path(folder) / f"{run_tables.file_name(self._network.diagram)}.nc"
            self.save(result)
            made, drawn = signal_plot.plot(result, signals), result.with_suffix(".svg")
            for path in (drawn, *(() if output is None else (Path(output),))):
                style.save(made, path)
            return Picture(drawn.read_text(encoding="utf-8"))

    # ---- words ----

    def __repr__(self) -> str:
        return run_tables.text_of(self.outcome)

    def _repr_html_(self) -> str:
        return run_tables.html_of(self.outcome)
