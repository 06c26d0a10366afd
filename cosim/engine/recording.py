"""From a run to its result file: what is recorded, and what the file says of the run."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.engine.outcome import Outcome
from cosim.engine.probes import Probes, Samples
from cosim.engine.reductions import Reductions
from cosim.errors import ResultError
from cosim.language.keys import INTEGRATION
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.wiring import sizes
from cosim.wiring.network import Network, Signal

FLUSH_SECONDS = 1.0
_SETTINGS = ("stop", "step", "method", "extrapolation", "coupling_tolerance", *INTEGRATION)


class Kept:
    """Recorded samples in memory, batch by batch."""

    def __init__(self, network: Network, probes: Probes) -> None:
        """Raises: TooLarge where there is no memory for all of them."""
        self.signals = {recorded.name: recorded for recorded in described(network, probes)}
        run, record = network.diagram.run, network.diagram.record
        words = 1 + sum(math.prod(recorded.shape) for recorded in self.signals.values())
        if record and self.signals:
            rows = round(run.stop / record.period) + 1
            fix = "a longer `record.period`, or fewer signals"
            sizes.require(2 * 8 * words * rows, f"{rows} samples of what is recorded", record.position, fix)
        self._times: list[np.ndarray] = []
        self._values: dict[str, list[np.ndarray]] = {name: [] for name in self.signals}

    def append(self, samples: Samples) -> None:
        """Keep a batch."""
        self._times.append(samples.times)
        for signal, array in samples.values.items():
            self._values[str(signal)].append(array.copy())

    def flat(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The times (k,) in s, and the samples (k, *shape) of each signal, which are not kept any longer."""
        none = {name: np.empty((0, *recorded.shape), recorded.dtype) for name, recorded in self.signals.items()}
        parts = self._values
        joined = {name: np.concatenate([none[name], *parts.pop(name)], dtype=none[name].dtype) for name in [*parts]}
        return np.concatenate([np.empty(0), *self._times]), joined


def about(network: Network, engine: str, reductions: Reductions) -> dict[str, Any]:
    """What is known of a run when it begins."""
    diagram = network.diagram
    return {
        "title": diagram.title,
        "diagram": diagram.resolved(),
        "settings": {k: getattr(diagram.run, k) for k in _SETTINGS if getattr(diagram.run, k) is not None},
        "method": diagram.run.method,
        "engine": engine,
        "reductions": reductions.meanings,
    }


def described(network: Network, probes: Probes) -> list[Recorded]:
    """What is recorded of the signals that are probed."""
    return [_described(network, signal) for signal in probes.signals]


def append(writer: ResultWriter, samples: Samples) -> None:
    """Record a batch; who looks into the file meanwhile finds what is no older than FLUSH_SECONDS and a batch."""
    writer.append(samples.times, {str(signal): array for signal, array in samples.values.items()})
    if clock.perf_counter() - writer.flushed > FLUSH_SECONDS:
        writer.flush()


def write(
    path: Path,
    signals: Sequence[Recorded],
    times: np.ndarray,
    values: Mapping[str, np.ndarray],
    network: Network,
    reductions: Reductions,
    outcome: Outcome,
) -> None:
    """Write the result of a run that is over and whose samples are in memory. Raises: ResultError."""
    with ResultWriter(path, signals, about(network, outcome.engine, reductions)) as writer:
        writer.append(times, values)
        _close(writer, outcome)


def close(writer: ResultWriter, outcome: Outcome) -> None:
    """Write how the run ended; a result that cannot be written makes a failure of it, which loses no figure."""
    try:
        _close(writer, outcome)
    except ResultError as full:
        if outcome.error is None:
            outcome.status, outcome.error = "failed", full


def _close(writer: ResultWriter, outcome: Outcome) -> None:
    figures = outcome.metrics, outcome.steps, outcome.seconds, outcome.verdicts, outcome.inner_steps
    writer.close(outcome.status, outcome.reason, *figures, end=outcome.time, requirements=outcome.margins)


def _described(network: Network, signal: Signal) -> Recorded:
    component, variable = network.components[signal.component], network.variable(signal)
    axes = component.signal_axes(variable) or ()
    return Recorded(
        name=str(signal),
        shape=network.shape(signal),
        dtype=variable.dtype,
        fleet=(axes[0].fleet if axes else None) or "",
        unit=variable.unit,
        description=variable.description,
        causality=variable.causality,
        components=variable.components,
    )
