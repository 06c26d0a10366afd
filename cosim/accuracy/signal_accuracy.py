"""How sure a recorded signal is: the largest error of all its elements, at all times that are recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Self

import numpy as np

from cosim.accuracy import limit as limits
from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy, ErrorPart
from cosim.accuracy.limit import ALIKE, EPSILON, NO_ORDER, Fall
from cosim.accuracy.refined_runs import Observation
from cosim.accuracy.refinement import COUPLING, INTEGRATION, TOTAL, Refinement, Triple
from cosim.results.formatting import format_seconds
from cosim.results.metrics import Array
from cosim.results.result_file import Result

NUMBERS_AT_ONCE = 1_000_000


@dataclass
class Distances:
    """How far three courses are apart, at most: the second from the first, the third from the second and the first.

    across, one, two: products of the two differences with each other and with themselves, of which the angle between
    them comes. least, most, size: of the first course's numbers. apart: instants at which the three are not the same.
    """

    first: float = 0.0
    second: float = 0.0
    ends: float = 0.0
    across: float = 0.0
    one: float = 0.0
    two: float = 0.0
    least: float = math.inf
    most: float = -math.inf
    size: float = 0.0
    apart: int = 0

    def take(self, coarse: Array, middle: Array, fine: Array) -> None:
        """Take some instants, (k, elements) each. What is not finite is as far from anything else as can be."""
        same = _same(coarse, middle) & _same(middle, fine)
        self.apart += int((~same).any(axis=1).sum())
        finite = coarse[np.isfinite(coarse)]
        self.least = min(self.least, float(finite.min(initial=math.inf)))
        self.most = max(self.most, float(finite.max(initial=-math.inf)))
        self.size = max(abs(self.least), abs(self.most)) if finite.size else self.size
        first, second = _distance(coarse, middle), _distance(middle, fine)
        self.first = max(self.first, _largest(first))
        self.second = max(self.second, _largest(second))
        self.ends = max(self.ends, _largest(_distance(coarse, fine)))
        if math.isfinite(self.first + self.second):
            with np.errstate(over="ignore"):
                self.across += float((first * second).sum())
                self.one += float((first * first).sum())
                self.two += float((second * second).sum())

    def fall(self, highest: int, noise: float, believed: bool) -> Fall:
        """As of `cosim.accuracy.limit.fall`."""
        aligned = believed and self.across > ALIKE * math.sqrt(self.one * self.two)
        return limits.fall(self.first, self.second, aligned, highest, noise)


class SignalJudge:
    """Judges signals by the files of runs with the steps of TOTAL, and their parts by those of the other triples.

    highest: the order up to which theory goes. steps: how many steps of integration the longest run has. A context
    manager, which holds the files open.
    """

    def __init__(self, runs: Mapping[Refinement, Observation], highest: int, steps: int) -> None:
        self._runs, self._highest, self._steps = runs, highest, steps
        self._elsewhere = next((refinement for refinement in runs if refinement.lies_elsewhere), None)
        self._early = next((refinement for refinement in runs if refinement.early), None)
        self._files: dict[Refinement, Result] = {}
        self._stack = ExitStack()
        self._rest: dict[str, float] = {}
        self._until = min(map(_end, runs.values()))

    def __enter__(self) -> Self:
        for refinement, run in self._runs.items():
            if run.file:
                self._files[refinement] = self._stack.enter_context(Result(run.file))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def judge(self, name: str, unit: str, doubted: str = "") -> Accuracy:
        """A signal's accuracy. doubted: why it has no order, where that is known."""
        found = self._distances(name, TOTAL)
        if self._files[TOTAL[0]].signals[name].dtype.kind != "f":
            return self._counted(found.apart, unit)
        fallen, errors = self._errors(name, found, doubted, self._elsewhere, self._early)
        self._rest[name] = errors[-1]
        size = found.most - found.least if found.most > found.least else found.size
        accuracy = Accuracy(fallen.kind, fallen.order, unit, (), errors, size)
        accuracy.said = doubted if fallen.kind == NO_ORDER else ""
        if all(refinement in self._files for refinement in (*COUPLING, *INTEGRATION)):
            accuracy.coupling = self._part(name, COUPLING, doubted)
            accuracy.integration = self._part(name, INTEGRATION, doubted)
        return accuracy

    def error(self, name: str, other: Observation) -> float:
        """By how much a signal may be off in a run with other steps; infinite if no time is common but the first."""
        every = self._every(other)
        if not every:
            return math.inf
        assert other.file
        with Result(other.file) as result:
            until = min(self._until, _end(other))
            pairs = zip(_chunks(result, name, until), _chunks(self._files[TOTAL[-1]], name, until, every), strict=False)
            return self._rest[name] + max(_largest(_distance(a, b)) for a, b in pairs)

    def _every(self, other: Observation) -> int:
        """Every how many of the recorded times are those of another run too; 0 if only the first is."""
        assert other.file
        with Result(other.file) as result:
            return round(result.times[1] / self._files[TOTAL[0]].times[1]) if len(result.times) > 1 else 0

    def _distances(self, name: str, triple: Triple) -> Distances:
        found = Distances()
        chunks = [_chunks(self._files[refinement], name, self._until) for refinement in triple]
        for arrays in zip(*chunks, strict=True):
            found.take(*arrays)
        return found

    def _strays(self, name: str, found: Fall, elsewhere: Refinement) -> float:
        """How far a signal is, in a run whose steps lie elsewhere, from where its order has it."""
        every = self._every(self._runs[elsewhere])
        if not every:
            return 0.0
        share = limits.share(found, elsewhere.step(1.0))
        here = _chunks(self._files[TOTAL[0]], name, self._until, every)
        there = _chunks(self._files[elsewhere], name, self._until)
        fine = _chunks(self._files[TOTAL[-1]], name, self._until, every)
        return max(
            _largest(_distance(b + share * _distance(b, a), c)) for a, b, c in zip(here, fine, there, strict=True)
        )

    def _moves(self, name: str, early: Refinement) -> float:
        """How far stops a little before common points move a signal."""
        pair = (_chunks(self._files[refinement], name, self._until) for refinement in (TOTAL[0], early))
        return max(_largest(_distance(a, b)) for a, b in zip(*pair, strict=True))

    def _errors(
        self,
        name: str,
        found: Distances,
        doubted: str,
        elsewhere: Refinement | None = None,
        early: Refinement | None = None,
    ) -> tuple[Fall, tuple[float, float, float]]:
        """How the differences fall, and by how much the signal may be off at the three steps."""
        noise = limits.noise(found.size, self._steps)
        fallen = found.fall(self._highest, noise, not doubted)
        if elsewhere:
            fallen = limits.checked(fallen, self._strays(name, fallen, elsewhere), found.ends, noise)
        if early:
            most = limits.most_noise(noise, self._steps)
            fallen = limits.warned(fallen, self._moves(name, early), found.ends, most)
        rest = (2.0 * fallen.rest if fallen.order else fallen.rest) + EPSILON * found.size
        return fallen, (found.ends + rest, found.second + rest, rest)

    def _part(self, name: str, triple: Triple, doubted: str) -> ErrorPart:
        fallen, errors = self._errors(name, self._distances(name, triple), doubted)
        return ErrorPart(errors[0], fallen.kind, fallen.order)

    def _counted(self, apart: int, unit: str) -> Accuracy:
        """Of a signal of whole numbers or truth values."""
        if not apart:
            return Accuracy(AGREES, unit=unit)
        times = len(self._files[TOTAL[0]].times)
        steps = [format_seconds(self._runs[refinement].step) for refinement in TOTAL]
        said = f"not the same with steps of {', '.join(steps)} at {apart} of {times} times"
        return Accuracy(CHANGES, unit=unit, said=said)


def _end(run: Observation) -> float:
    """The time (s) from which on a run has no samples at times of all, as a block has ended it; else infinite."""
    return run.outcome.time if run.outcome.termination else math.inf


def _chunks(result: Result, name: str, until: float, every: int = 1) -> Iterator[Array]:
    """A signal as rows of numbers, some instants at a time: of every so many recorded ones, as many each time.

    until: a time (s) before which they are; but the first is always one of them.
    """
    size = math.prod(result.signals[name].shape)
    rows, end = max(1, NUMBERS_AT_ONCE // size), max(1, int(np.searchsorted(result.times, until * (1.0 - EPSILON))))
    for first in range(0, end, rows * every):
        samples = result.read(name, first, min(first + rows * every, end))[::every]
        yield samples.reshape(-1, size).astype(float)


def _largest(numbers: Array) -> float:
    return float(np.abs(numbers).max(initial=0.0))


def _same(a: Array, b: Array) -> Array:
    same: Array = (a == b) | (np.isnan(a) & np.isnan(b))
    return same


def _distance(a: Array, b: Array) -> Array:
    """From a to b; infinite where one is not finite and the other is not the same."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(_same(a, b), 0.0, np.where(np.isfinite(a) & np.isfinite(b), b - a, math.inf))
