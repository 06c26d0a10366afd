"""The reductions that a diagram's metrics ask for, and what of their windows the run does not reach."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from cosim.authoring.variables import State
from cosim.errors import CosimError, DiagramErrors, MetricError, Problems, WrongValue, nearest
from cosim.language.diagram import Diagram, MetricEntry
from cosim.results import metrics as reductions
from cosim.results.metrics import Events, Reduction
from cosim.results.step_figures import reduced_by
from cosim.wiring.network import Network, Signal


def reduced(network: Network) -> tuple[dict[str, tuple[Signal, Reduction]], list[CosimError]]:
    """Each metric's signal and reduction, and warnings.

    The warnings are of windows that end after the run, or stay empty as --stop or --step shortened it.

    Raises: DiagramErrors with every MetricError.
    """
    problems, found = Problems(), {}
    for name, metric in network.diagram.metrics.items():
        if name not in network.reduced:  # its block is not checked, or a mistake that is told
            continue
        signal = network.reduced[name]
        variable = network.variable(signal)
        start, stop = metric.start or None, metric.stop if math.isfinite(metric.stop) else None
        try:
            reduction = reduced_by(metric.reduce, metric.options, start, stop, variable.dtype, network.shape(signal))
            if isinstance(reduction, Events) and not _keeps_events(network, signal):
                message = f"`events` needs a table that starts as NaN, which `{signal}` does not"
                raise MetricError(message, fix="use the output of a block that records events, or reduce with `final`")
            found[name] = signal, reduction
        except MetricError as error:
            problems.add(named(metric, error))
    empty = list(_empty(network.diagram, found))
    nodes = network.diagram.run.nodes
    shortened = any(not nodes[key].position.line for key in ("stop", "step") if key in nodes)
    if not shortened:
        problems.add(DiagramErrors(empty))
    problems.raise_if_any()
    return found, [*(empty if shortened else ()), *_cut(network, found)]


def named(metric: MetricEntry, error: MetricError) -> MetricError:
    """The error with the metric's name and place."""
    return MetricError(f"metric {metric.name}: {error.message}", metric.position, error.fix)


def _keeps_events(network: Network, signal: Signal) -> bool:
    """Whether rows of a signal may be events: unused ones are NaN from the start, in a state or what is made of it.

    Of an FMU, only values tell.
    """
    variable, declaration = network.variable(signal), network.components[signal.component].declaration
    writer = declaration.writer(signal.variable)
    made_of = [declaration.variables.get(name) for name in writer.reads] if writer else [variable]
    return declaration.foreign is not None or any(
        isinstance(v, State) and v.shape == variable.shape and isinstance(v.start, float) and math.isnan(v.start)
        for v in made_of
    )


def _empty(diagram: Diagram, found: Mapping[str, tuple[Signal, Reduction]]) -> Iterator[CosimError]:
    """The metrics whose window has no sample in it, and a recording of nothing but the start."""
    run = diagram.run
    for name, (_, reduction) in found.items():
        if not reduction.holds_sample(run.step, run.steps):
            metric = diagram.metrics[name]
            times = f"the times of this run are 0, {run.step:g}, … {run.stop:g} s"
            yield MetricError(f"metric {name}: no sample lies in its window ({reduction})", metric.position, times)
    record = diagram.record
    if record and record.signals and record.period > run.stop * (1 + 1e-9):
        message = f"`record.period` of {record.period:g} s is longer than the run: only the start would be recorded"
        yield WrongValue(message, record.position, f"such as {run.stop:g}, the run's end, or less")


def _cut(network: Network, found: Mapping[str, tuple[Signal, Reduction]]) -> Iterator[CosimError]:
    """Warnings of windows and periods that the run's end cuts, and of fleets that no block is mapped over."""
    diagram, run = network.diagram, network.diagram.run
    for name, (_, reduction) in found.items():
        cut = reduction.stop is not None and reduction.stop > run.stop * (1 + reductions.WINDOW_TOLERANCE)
        if cut and reduction.holds_sample(run.step, run.steps):
            message = f"metric {name}: its window ({reduction}) ends after the run, at {run.stop:g} s"
            yield MetricError(message, diagram.metrics[name].position, "leave `to` out, or let the run last as long")
    used = {component.fleet for component in network.components.values() if component.fleet}
    for name in diagram.fleets if used else ():
        if name in used:
            continue
        yield WrongValue(f"no block is `per: {name}`, so the fleet `{name}` changes nothing", None, nearest(name, used))
    for component in network.components.values():
        period = component.entry.settings.get("period")
        if period and float(period.value) > run.stop * (1 + 1e-9):
            message = (
                f"block {component.name}: its period of {period.value:g} s is longer than the run: it is sampled once"
            )
            yield WrongValue(message, period.position, f"periods are in seconds; this run lasts {run.stop:g} s")
        offset = component.entry.settings.get("offset")
        if offset and float(offset.value) > run.stop * (1 + 1e-9):
            message = (
                f"block {component.name}: its offset of {offset.value:g} s is longer than the run: it is never due"
            )
            yield WrongValue(message, offset.position, f"offsets are in seconds; this run lasts {run.stop:g} s")
