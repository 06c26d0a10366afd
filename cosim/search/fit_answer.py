"""What a fit says: the values with their intervals, the residuals before and after, warnings, and the overlay."""

from __future__ import annotations

import hashlib
import math
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import MissingKey, WrongValue
from cosim.language.source import Node
from cosim.results.formatting import format_value
from cosim.results.text_table import TextTable
from cosim.search import measurements, overlay_file
from cosim.search.estimates import CONFIDENCE
from cosim.search.evaluator import Evaluator
from cosim.search.fitting import FitRun, Fitted
from cosim.search.measurements import Measurements
from cosim.study import executors
from cosim.study.addresses import value_at
from cosim.study.definition import Fit, Study
from cosim.study.variants import Variants

UNLIKELY = 1e-3
"""How likely residuals as large have to be, with the deviations that are said, for a model to explain the data."""
STEP_SHARE = 0.1
"""Of the residuals' size, by which the step may change what is measured."""
SMALL = 1e-6
"""Of what is measured: residuals are no smaller to this end, as those of a perfect fit are rounding."""


@dataclass(frozen=True)
class FitAnswer:
    """The values that were found. names, before: of each free number; spent: how many runs it took."""

    names: tuple[str, ...]
    before: tuple[float, ...]
    fitted: Fitted
    measured: Measurements
    spent: int
    overlay: Path

    def as_json(self) -> dict[str, Any]:
        """What it says, as JSON has it."""
        found = self.fitted
        rows = zip(self.names, self.before, found.estimates.values, strict=True)
        return {
            "runs": self.spent,
            "values": {
                name: {"before": before, "after": one.value, "interval": _interval(one.low, one.high), "why": one.why}
                for name, before, one in rows
            },
            "covariance": found.estimates.covariance.tolist(),
            "measurements": self.measured.size,
            "residuals": {
                course.label: {"unit": course.unit, "before": before, "after": after}
                for course, before, after in zip(self.measured.courses, *self._sizes(), strict=True)
            },
            "ends": [end.cost for end in found.ends],
            "warnings": list(self.warnings()),
            "overlay": str(self.overlay),
        }

    def _sizes(self) -> tuple[list[float | None], list[float | None]]:
        """The root mean square residuals of each signal, in its unit, before and after."""
        before, after = self.fitted.before, self.fitted.best.residuals
        return self.measured.sizes(before), self.measured.sizes(after)

    def tables(self) -> list[TextTable]:
        """The free values with their intervals, and the residuals of each signal."""
        rows = []
        for name, before, one in zip(self.names, self.before, self.fitted.estimates.values, strict=True):
            known = one.low is not None and one.high is not None
            interval = f"{format_value(one.low)} … {format_value(one.high)}" if known else one.why
            rows.append([name, format_value(before), format_value(one.value), interval])
        values = TextTable("", ["free", "before", "after", f"interval, {100 * CONFIDENCE:g} %"], rows)
        sizes = [
            [course.label, course.unit, format_value(before), format_value(after)]
            for course, before, after in zip(self.measured.courses, *self._sizes(), strict=True)
        ]
        return [values, TextTable("", ["residual, rms", "unit", "before", "after"], sizes)]

    def warnings(self) -> Iterator[str]:
        """What a person should know before the values are believed."""
        found, named = self.fitted.estimates, self.names
        for name, one in zip(named, found.values, strict=True):
            if one.why == "at its bound":
                yield f"{name} is at its bound, {format_value(one.value)}: the data would have it beyond"
        for group in found.together:
            several = ", ".join(named[k] for k in group)
            yield (
                f"the data do not tell {several}"
                if len(group) == 1
                else f"the data do not tell {several} apart: other values of them together give the same"
            )
        if found.freedom <= 0:
            yield "there are no more measurements than free values: nothing is known of how far they may be off"
        yield from self._of_ends()
        yield from self._of_residuals()

    def _of_ends(self) -> Iterator[str]:
        found = self.fitted
        if not found.complete:
            yield "all runs were spent before the last start came to its end: give it more"
        limit = found.best.cost * (1.0 + 4.0 / max(found.estimates.freedom, 1)) + 1e-300
        if not found.estimates.together and any(end.cost <= limit for end in found.others()):
            yield "another start ended at other values that fit as well: see `ends`, or narrow the bounds"

    def _of_residuals(self) -> Iterator[str]:
        from scipy.stats import chi2

        found, size = self.fitted, self.measured.size
        if self.measured.known and found.estimates.freedom > 0:
            likely = float(chi2.sf(found.best.cost, found.estimates.freedom))
            if likely < UNLIKELY:
                times = format_value(math.sqrt(found.best.cost / size))
                yield f"the residuals are {times} times the deviations that are said: the model lacks something"
        if found.finer is not None:
            change = float(np.linalg.norm(found.finer - found.best.residuals))
            size_ = max(math.sqrt(found.best.cost), SMALL * float(np.linalg.norm(self.measured.scaled())))
            if change > STEP_SHARE * size_:
                share = 100.0 * change / size_
                yield f"a tenth of the step changes the residuals by {share:.2g} %: fit with a smaller step"


def _interval(low: float | None, high: float | None) -> list[float] | None:
    return None if low is None or high is None else [low, high]


def fit_of(study: Study) -> Fit:
    """The study's fit. Raises: MissingKey, WrongValue where the study has draws too."""
    if study.fit is None:
        fix = "write fit: {over: {blocks.plant.parameters.k: {uniform: [1, 10]}}, data: …, signals: …}"
        raise MissingKey(f"the study {study.path} has no `fit`", None, fix)
    if study.random:
        message = "a fit is of the measured run alone, and the study draws others at random"
        raise WrongValue(message, study.fit.node.place, "remove `random`, or give the fit a study of its own")
    return study.fit


def fit(
    study: Study,
    folder: Path,
    budget: tuple[int, float, int | None],
    threads: int,
    settings: Sequence[str],
    watch: Callable[[int, float | None], None],
) -> FitAnswer:
    """Fit. budget: runs, 0 for what the study says; seconds; seed, None as runs.

    Raises: as `FitRun`, and as `measurements.read`.
    """
    wanted = fit_of(study)
    place = wanted.node.position
    signals = list(dict.fromkeys(one.signal for one in wanted.measured))
    recorded = {"signals": Node([Node(name, place) for name in signals], place)}
    plain, variant = Variants(study), next(iter(study.variants))
    plain.check()
    measured = measurements.read(wanted, plain.base(variant))
    looked_at = replace(study, record=Node(recorded, place), sighting=measured.sighting)
    evaluator = Evaluator(looked_at, wanted.space, folder / _digest(measured), threads, settings)
    evaluator.origin = executors.PickledStudy(pickle.dumps(looked_at))
    runs, seconds, seed = budget
    seed = wanted.space.seed if seed is None else seed
    deadline = time.monotonic() + seconds
    search = FitRun(evaluator, measured, wanted, runs or wanted.runs, deadline, seed, watch)
    with evaluator.at_work():
        found = search.run()
    network = plain.base(variant)
    before = evaluator.draws.numbers_of(lambda path: value_at(network, path))
    overlay = folder / "fitted.yaml"
    overlay_file.write(overlay, f"{network.diagram.title}, fitted", plain, variant, found.settings)
    names = tuple(evaluator.draws.names())
    return FitAnswer(names, tuple(before.tolist()), found, measured, search.spent, overlay)


def _digest(measured: Measurements) -> str:
    """What is kept of a run depends on what is looked at: a folder for each."""
    content = [repr(measured.sighting.signals).encode(), measured.times.tobytes()]
    return hashlib.sha256(b"\0".join(content)).hexdigest()[:16]
