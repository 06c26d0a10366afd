"""What is kept of a run to judge its figures by: extremes between samples, and the courses of signals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cosim.engine.probes import Samples
from cosim.engine.reductions import Reductions
from cosim.errors import CosimError
from cosim.results.metrics import Array, Maximum, Minimum, Reduction
from cosim.wiring.network import Network, Signal

INSTANTS = 1000
"""How many instants of a course are kept, and of large signals so many that they have no more words than these."""
WORDS = 500_000
SMOOTH = 0.6
"""A second difference falls to 1/4 at half the spacing where a signal is smooth, to 1/2 at a kink, not at a jump."""


class Crest(Maximum):
    """The largest value of a signal, also between samples: where it bends, the crest of the parabola through three.

    Without it, the error of a maximum would be that of where samples happen to lie, which has no order.
    """

    sign = 1.0

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._tail: Array = np.empty((0, math.prod(self.shape)))
        self._crest = -math.inf

    def _take(self, times: Array, samples: Array) -> None:
        super()._take(times, samples)
        rows = np.concatenate([self._tail, self.sign * samples.reshape(-1, math.prod(self.shape))])
        self._tail = rows[-4:].copy()
        if len(rows) < 5:
            return
        before, here, after = rows[1:-3], rows[2:-2], rows[3:-1]
        near = 2.0 * here - before - after
        candidates = (here >= before) & (here >= after) & (near > 0.0) & (here + near / 8.0 > self._crest)
        if candidates.any():
            far = 2.0 * here - rows[:-4] - rows[4:]
            smooth = candidates & (near <= SMOOTH * far)
            slope = (after - before)[smooth]
            self._crest = float(np.max(here[smooth] + slope**2 / (8.0 * near[smooth]), initial=self._crest))

    def value(self) -> float | None:
        """As of `Reduction`."""
        largest = super().value()
        return largest if largest is None else self.sign * max(self._crest, self.sign * largest)


class Trough(Crest, Minimum):
    """The smallest value of a signal, also between samples."""

    sign = -1.0


class CourseOf(Reduction):
    """A signal at the instants that runs with other steps have too: those at every so many steps."""

    name = "course"

    def __init__(self, step: float, every: int, *signal: Any) -> None:
        super().__init__(*signal)
        self._step, self._every = step, every
        self._parts: list[Array] = []

    def _take(self, times: Array, samples: Array) -> None:
        chosen = np.rint(times / self._step).astype(np.int64) % self._every == 0
        self._parts.append(samples[chosen].reshape(-1, math.prod(self.shape)).astype(float))

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return {"course": self.value()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._parts = [state["course"]]

    def value(self) -> Array:
        """An array (instants, elements)."""
        return np.concatenate(self._parts) if self._parts else np.empty((0, math.prod(self.shape)))


class Observed(Reductions):
    """The figures of a run, and what they are judged by.

    divisor: how many steps of this run are one of the run that it is compared with.
    """

    def __init__(self, network: Network, divisor: int = 1) -> None:
        super().__init__(network)
        self.figures: dict[str, Any] = {}
        self._beside: dict[str, tuple[Signal, list[Reduction]]] = {}
        for name, (signal, reduction) in self.metrics.items():
            if reduction.dtype.kind == "f" and reduction.unit is None:
                about = reduction.start, reduction.stop, reduction.dtype, reduction.shape
                every = divisor * _stride(network, math.prod(reduction.shape), divisor)
                beside: list[Reduction] = [CourseOf(network.diagram.run.step, every, *about)]
                beside += [kind(*about) for base, kind in EXTREMES.items() if type(reduction) is base]
                self._beside[name] = signal, beside

    @property
    def signals(self) -> tuple[Signal, ...]:
        """As of `Reductions`, and those of all courses."""
        return tuple(dict.fromkeys([*super().signals, *(signal for signal, _ in self._beside.values())]))

    def update(self, samples: Samples) -> None:
        """As of `Reductions`."""
        super().update(samples)
        for signal, beside in self._beside.values():
            for reduction in beside:
                with np.errstate(invalid="ignore", over="ignore"):
                    reduction.update(samples.times, samples.values[signal])

    def values(self, time: float, value: Callable[[Signal], np.ndarray]) -> tuple[dict[str, Any], CosimError | None]:
        """As of `Reductions`."""
        self.figures, wrong = super().values(time, value)
        return self.figures, wrong

    def course(self, name: str) -> Array:
        """The course of a metric's signal in its window, as of `CourseOf`; empty for what is counted."""
        return self._beside[name][1][0].value() if name in self._beside else np.empty((0, 0))

    def smooth(self, name: str) -> Any:
        """A metric's value, that of an extreme between the samples."""
        beside = self._beside[name][1][1:] if name in self._beside else []
        return beside[0].value() if beside else self.figures[name]


EXTREMES: dict[type[Reduction], type[Reduction]] = {Maximum: Crest, Minimum: Trough}


def _stride(network: Network, size: int, divisor: int) -> int:
    """At every how many steps of the coarsest run a course is kept."""
    steps = network.diagram.run.steps // divisor
    return max(1, math.ceil(steps / max(16, min(INSTANTS, WORDS // max(size, 1)))))
