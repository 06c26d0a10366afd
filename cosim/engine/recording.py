"""From a run to its result file: what is recorded, and what the file says of the run."""

from __future__ import annotations

from typing import Any

from cosim.engine.outcome import Outcome
from cosim.engine.probes import Probes, Samples
from cosim.engine.reductions import Reductions
from cosim.errors import ResultError
from cosim.language.keys import INTEGRATION
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.wiring.network import Network, Signal

_SETTINGS = ("stop", "step", "method", "extrapolation", "coupling_tolerance", *INTEGRATION)


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
    """Record a batch."""
    writer.append(samples.times, {str(signal): array for signal, array in samples.values.items()})


def close(writer: ResultWriter, outcome: Outcome) -> None:
    """Write how the run ended; a result that cannot be written makes a failure of it, which loses no figure."""
    try:
        figures = outcome.metrics, outcome.steps, outcome.seconds, outcome.verdicts, outcome.inner_steps
        writer.close(outcome.status, outcome.reason, *figures, end=outcome.time)
    except ResultError as full:
        if outcome.error is None:
            outcome.status, outcome.error = "failed", full


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
