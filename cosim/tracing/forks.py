"""The first communication point at which two runs do not publish the same, and what differs there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.authoring.variables import Parameter
from cosim.engine import compilation, program
from cosim.engine.probes import Probes, Samples
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError
from cosim.wiring.clocks import exact
from cosim.wiring.network import Network, Signal


@dataclass(frozen=True)
class Branch:
    """A signal of which two runs have other values. element: the first that differs, indices from 1; values: both."""

    element: tuple[int, ...]
    values: tuple[object, object]


@dataclass
class Fork:
    """Where two runs part. step: of the first run; time (s), or else that up to which they are the same.

    branches: all signals that differ there.

    same: how many signals are compared; alone: those that one run alone has; unlike: those that have another shape or
    type in each. ends: how each run ended where it did not come to its end, and nothing differed before; failed:
    whether one did so by a failure.
    """

    step: int = 0
    time: float = math.nan
    branches: dict[Signal, Branch] = field(default_factory=dict)
    same: int = 0
    alone: list[Signal] = field(default_factory=list)
    unlike: dict[Signal, tuple[str, str]] = field(default_factory=dict)
    ends: tuple[str, str] = ("", "")
    failed: bool = False

    @property
    def is_one(self) -> bool:
        """Whether the runs part anywhere, or have nothing in common."""
        return bool(self.branches or self.unlike) or self.ends[0] != self.ends[1] or not self.same


def fork(a: Network, b: Network) -> Fork:
    """Run both side by side until they part, at the times that both have. Raises: DiagramErrors.

    Parameters are no part of that: what is told is where they have an effect.
    """
    first, second = _computed(a), _computed(b)
    kinds = {s: (_kind(a, s), _kind(b, s)) for s in first if s in second}
    common = [s for s, (one, other) in kinds.items() if one == other]
    alone = [s for s in (*first, *second) if s not in kinds]
    found = Fork(same=len(common), alone=alone, unlike={s: pair for s, pair in kinds.items() if s not in common})
    steps = [exact(network.diagram.run.step) for network in (a, b)]
    together = math.lcm(steps[0].numerator * steps[1].denominator, steps[1].numerator * steps[0].denominator)
    period = [together // (s.numerator * o.denominator) for s, o in zip(steps, reversed(steps), strict=True)]
    runs = [_Course(network, common, every) for network, every in zip((a, b), period, strict=True)]
    before = 0
    while not found.branches:
        blocks = [run.ahead() for run in runs]
        size = min(map(len, blocks))
        if not size:
            found.ends, found.failed = (runs[0].ended, runs[1].ended), any(run.failed for run in runs)
            return found
        rows = [run.take(size) for run in runs]
        differ = {s: _differences(rows[0].values[s], rows[1].values[s]) for s in common}
        where = [int(np.argmax(mask.reshape(size, -1).any(axis=1))) for mask in differ.values() if mask.any()]
        if where:
            row = min(where)
            found.step, found.time = (before + row) * period[0], float(rows[0].times[row])
            found.branches = {
                s: _branch(mask[row], rows[0].values[s][row], rows[1].values[s][row])
                for s, mask in differ.items()
                if mask[row].any()
            }
        before, found.time = before + size, found.time if where else float(rows[0].times[-1])
    return found


class _Course:
    """The samples of a run, batch by batch, as many at a time as somebody wants."""

    def __init__(self, network: Network, signals: Sequence[Signal], every: int) -> None:
        built = program.build(network, network.diagram.run.method)
        kernels = compilation.compile_program(built)
        kernels.load()
        self._simulation = Simulation(built, kernels, [Probes(tuple(signals), every * network.schedule.grid)])
        self._batches = self._all()
        self._kept: Samples | None = None
        self.ended, self.failed = "", False

    def _all(self) -> Iterator[Samples]:
        try:
            self._simulation.initialize()
            for (samples,) in self._simulation.batches():
                if len(samples.times):
                    yield Samples(samples.times, {s: values.copy() for s, values in samples.values.items()})
            if self._simulation.termination:
                self.ended = self._simulation.termination.message
        except CosimError as error:
            self.ended, self.failed = error.message, True
        finally:
            self._simulation.close()

    def ahead(self) -> np.ndarray:
        """The times (k,) in s of the samples that are at hand; none at the end."""
        self._kept = self._kept or next(self._batches, None)
        return np.empty(0) if self._kept is None else self._kept.times

    def take(self, size: int) -> Samples:
        """The next samples, of those that are at hand."""
        kept = self._kept
        assert kept is not None
        rest = {s: values[size:] for s, values in kept.values.items()}
        self._kept = Samples(kept.times[size:], rest) if len(kept.times) > size else None
        return Samples(kept.times[:size], {s: values[:size] for s, values in kept.values.items()})


def _computed(network: Network) -> list[Signal]:
    """The signals that a run computes."""
    return [s for s in network.signals() if not isinstance(network.variable(s), Parameter)]


def _kind(network: Network, signal: Signal) -> str:
    """What two signals have in common that can be compared."""
    return f"{network.variable(signal).dtype.name} {network.shape(signal)}"


def _differences(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Which elements differ; what is no number in both does not."""
    differ: np.ndarray = (a != b) & ~((a != a) & (b != b))  # noqa: PLR0124
    return differ


def _branch(mask: np.ndarray, a: np.ndarray, b: np.ndarray) -> Branch:
    element = tuple(int(k) for k in np.argwhere(mask)[0])
    return Branch(tuple(k + 1 for k in element), (a[element].item(), b[element].item()))
