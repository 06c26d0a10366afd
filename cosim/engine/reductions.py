"""What a run makes of its trajectories as they come: metrics, events, what conditions are judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.authoring.variables import Local, Output
from cosim.engine.courses import Courses
from cosim.engine.outcome import Event
from cosim.engine.probes import Samples
from cosim.errors import CosimError, FormulaError, MetricError
from cosim.language.requirement import told
from cosim.machine.stopwatch import Stopwatch
from cosim.results import metrics
from cosim.results.metrics import Events, Final, Reduction
from cosim.wiring import conditions, windows
from cosim.wiring.network import Finding, Network, Signal

if TYPE_CHECKING:
    from cosim.requirements.monitor import Monitor
    from cosim.requirements.verdict import Verdict


class Reductions:
    """The figures of one run. metrics: signal and reduction, by name; warnings: of windows that the run does not reach.

    native: whether compiled code does what is dear. margins: whether nothing but the requirements is looked at.
    Raises: DiagramErrors with every MetricError and FormulaError.
    """

    def __init__(self, network: Network, native: bool = True, margins: bool = False) -> None:
        self.network = network
        self.margins = margins
        self.metrics, self.warnings = ({}, []) if margins else windows.reduced(network)
        self.monitors = _monitors(network, native)
        self.enders = [name for name, entry in network.diagram.requirements.items() if entry.ends]
        self.violated: Verdict | None = None  # of these
        self._events = {} if margins else _events(network)
        self._courses = {} if margins else _courses(network)
        self.stopwatch = Stopwatch()

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What has to be seen at every step."""
        reduced = [s for s, r in (*self.metrics.values(), *self._events.values()) if not self._at_end(r)]
        watched = [signal for monitor in self.monitors.values() for signal in monitor.keys]
        return tuple(dict.fromkeys([*reduced, *watched, *self._courses]))

    def _at_end(self, reduction: Reduction) -> bool:
        """Whether a reduction looks at the signal's last value alone."""
        last = isinstance(reduction, Final) and reduction.reaches(self.network.diagram.run.stop)
        return last or isinstance(reduction, Events)

    @property
    def meanings(self) -> dict[str, str]:
        """What each metric is, in words: two of one name that differ here are not to be compared."""
        return {name: f"{reduction} of {signal}" for name, (signal, reduction) in self.metrics.items()}

    @property
    def units(self) -> dict[str, str]:
        """The unit of each metric."""
        return {name: _unit(self.network, *pair) for name, pair in self.metrics.items()}

    @property
    def windows(self) -> dict[str, str]:
        """The reduction of each metric and its window, in words."""
        return {name: str(reduction) for name, (_, reduction) in self.metrics.items()}

    def update(self, samples: Samples) -> None:
        """Take a batch of `signals`."""
        with self.stopwatch.lap("metrics and conditions"):
            for signal, reduction in (*self.metrics.values(), *self._events.values()):
                if not self._at_end(reduction):
                    reduction.update(samples.times, samples.values[signal])
            for signal, courses in self._courses.items():
                courses.update(samples.times, samples.values[signal])
        if self.monitors:
            with self.stopwatch.lap("requirements"):
                self._judge(samples)

    def _judge(self, samples: Samples) -> None:
        for name, monitor in self.monitors.items():
            try:
                monitor.update(samples.times, {key: samples.values[key] for key in monitor.keys})
            except FormulaError as error:
                error.position = self.network.diagram.requirements[name].place(0)
                raise told(name, error) from None

    def state(self) -> dict[str, Any]:
        """What all have made of the run so far: arrays, to the bit."""
        return {
            "metrics": {name: reduction.state() for name, (_, reduction) in self.metrics.items()},
            "events": {str(signal): reduction.state() for signal, reduction in self._events.values()},
            "courses": {str(signal): courses.state() for signal, courses in self._courses.items()},
            "requirements": {name: monitor.state() for name, monitor in self.monitors.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of the same network's."""
        for name, (_, reduction) in self.metrics.items():
            reduction.restore(state["metrics"][name])
        for signal, reduction in self._events.values():
            reduction.restore(state["events"][str(signal)])
        for signal, courses in self._courses.items():
            courses.restore(state["courses"][str(signal)])
        for name, monitor in self.monitors.items():
            monitor.restore(state["requirements"][name])

    def values(self, time: float, value: Callable[[Signal], np.ndarray]) -> tuple[dict[str, Any], CosimError | None]:
        """The metrics' values, and why one of them has none where that is a mistake."""
        now, wrong = np.array([time]), None
        values: dict[str, Any] = dict.fromkeys(self.metrics)
        for name, (signal, reduction) in self.metrics.items():
            if self._at_end(reduction):
                reduction.update(now, value(signal)[None])
            try:
                values[name] = reduction.value()
            except MetricError as error:
                wrong = wrong or windows.named(self.network.diagram.metrics[name], error)
        return values, wrong

    def events(self) -> list[Event]:
        """What happened so far."""
        return [
            Event(signal, _event_text(self.network, signal), times)
            for signal, reduction in self._events.values()
            if (times := reduction.value())
        ]

    def verdicts(self, ended: bool) -> dict[str, Verdict]:
        """By how much each requirement is kept; ended: whether the run has come to its end, if none was to end it."""
        return {name: self._verdict(name, ended and not self.violated) for name in self.monitors}

    def _verdict(self, name: str, ended: bool) -> Verdict:
        from cosim.requirements.verdict import verdict

        return verdict(name, self.network.diagram.requirements[name].text, self.monitors[name].robustness(ended))

    def ends(self) -> bool:
        """Whether a requirement is `violated` that ends the run."""
        judged = (self._verdict(name, False) for name in self.enders)
        self.violated = next((one for one in judged if one.holds is False), None)
        return self.violated is not None

    def conditions(self) -> list[Finding]:
        """The conditions along the run so far; none if it has seen nothing."""
        if self.margins or not all(courses.seen for courses in self._courses.values()):
            return []
        seen = {signal: courses.of_members() for signal, courses in self._courses.items()}
        return conditions.judge_run(self.network, seen)


def _monitors(network: Network, native: bool) -> Mapping[str, Monitor]:
    """What follows the requirements, which most runs have none of. Raises: DiagramErrors."""
    if not network.diagram.requirements:
        return {}
    from cosim.wiring import required

    return required.monitors(network, native)


def _courses(network: Network) -> dict[Signal, Courses]:
    """What the conditions that are judged after the run have to know of it."""
    signals = {signal for _, _, signals in conditions.along(network) for signal in signals}
    return {signal: Courses(network.components[signal.component].count) for signal in signals}


def _events(network: Network) -> dict[Signal, tuple[Signal, Reduction]]:
    """The boolean outputs that report something, with the times at which they first do."""
    found = {}
    for component in network.components.values():
        for name, variable in component.declaration.variables.items():
            if isinstance(variable, (Output, Local)) and variable.event:
                signal = Signal(component.name, name)
                found[signal] = signal, metrics.reduction("first", dtype=bool, shape=network.shape(signal))
    return found


def _event_text(network: Network, signal: Signal) -> str:
    variable = network.variable(signal)
    return variable.event if isinstance(variable, (Output, Local)) else ""


def _unit(network: Network, signal: Signal, reduction: Reduction) -> str:
    own = network.variable(signal).unit
    plain = own if isinstance(own, str) else ""
    return reduction.unit_from(plain)
