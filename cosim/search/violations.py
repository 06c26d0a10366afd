"""From a study to the violations of its requirements that a search finds, each with its overlay, checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.errors import MetricError, MissingKey, nearest
from cosim.language.source import Node
from cosim.search import overlay_file
from cosim.search.checking import Check, check
from cosim.search.evaluator import Evaluator
from cosim.search.falsification import Falsification, Findings
from cosim.search.objective import Trial
from cosim.study import file_names
from cosim.study.definition import Search, Study


@dataclass(frozen=True)
class Answer:
    """What a search says of one requirement. trials: how many runs it took; least: with the smallest margin.

    check, overlay: of a violation, None where none was found.
    """

    requirement: str
    unit: str
    trials: int
    least: Trial | None
    check: Check | None
    overlay: Path | None

    def as_json(self) -> dict[str, Any]:
        """What it says, as JSON has it."""
        found, least = self.check, self.least
        return {
            "requirement": self.requirement,
            "runs": self.trials,
            "violated": found is not None,
            "margin": least.margin if least else None,
            "unit": self.unit,
            "ended": least.ended if least else "",
            "at": least.place if least else "",
            "time": least.time if least and not math.isnan(least.time) else None,
            "values": dict(least.settings) if least else {},
            "verdict": found.verdict if found else None,
            "why": found.why if found else "",
            "error": found.error if found else None,
            "reruns": [vars(rerun) for rerun in found.reruns] if found else [],
            "overlay": str(self.overlay) if self.overlay else None,
        }


@dataclass(frozen=True)
class Budget:
    """How much a search may take: runs, 0 for what the study says; seconds of wall-clock time; seed, None as runs."""

    runs: int
    seconds: float
    seed: int | None


def search_of(study: Study) -> Search:
    """The study's search. Raises: MissingKey."""
    if study.search is None:
        fix = "write search: {over: {blocks.plant.start.x: {uniform: [-1, 1]}}}"
        raise MissingKey(f"the study {study.path} has no `search`", None, fix)
    return study.search


class Violations:
    """The search for violations of one requirement after the other.

    watch: told of the requirement and of what was found after every batch. tell: told how a violation is checked.
    Raises: DiagramErrors, MissingKey, MetricError for a requirement that there is not, ResultError.
    """

    def __init__(
        self,
        study: Study,
        folder: Path,
        wanted: Sequence[Node],
        threads: int,
        settings: Sequence[str],
        watch: Callable[[str, Findings], None],
        tell: Callable[[str], None],
    ) -> None:
        self.search = search_of(study)
        self._folder, self._watch, self._tell = folder, watch, tell
        self.evaluator = Evaluator(study, self.search.space, folder, threads, settings)
        network = self.evaluator.variants.base(self.evaluator.variant)
        known = network.diagram.requirements
        asked = wanted or self.search.requirements or [Node(name, e.position) for name, e in known.items()]
        for node in asked:
            if node.value not in known:
                message = f"there is no requirement `{node.value}`"
                fix = nearest(str(node.value), known) or "write requirements: {name: formula}"
                raise MetricError(message, node.position, fix)
        if not asked:
            message = "neither the study nor its diagram has a requirement"
            raise MissingKey(message, self.search.node.place, "write requirements: {safe: always(plant.x < 1)}")
        self.requirements = [str(node.value) for node in asked]

    def of(self, requirement: str, budget: Budget) -> Answer:
        """What is found of one requirement. Raises: KeyboardInterrupt, MissingPackage, ResultError."""
        seed = self.search.space.seed if budget.seed is None else budget.seed
        runs = budget.runs or self.search.runs
        watch = self._watch
        searched = Falsification(
            self.evaluator, requirement, runs, budget.seconds, seed, lambda found: watch(requirement, found)
        ).run()
        return self._answer(requirement, searched)

    def _answer(self, requirement: str, found: Findings) -> Answer:
        violation, unit = found.violation, self._unit(requirement)
        if violation is None:
            return Answer(requirement, unit, found.trials, found.least, None, None)
        overlay = self._folder / f"{file_names.stem(requirement)}.yaml"
        variant = self.evaluator.variant
        title = f"{requirement} is violated"
        overlay_file.write(overlay, title, self.evaluator.variants, variant, violation.settings)
        made = check(overlay, requirement, violation.margin, self._tell)
        return Answer(requirement, unit, found.trials, violation, made, overlay)

    def _unit(self, requirement: str) -> str:
        from cosim.wiring import required

        return required.monitors(self.evaluator.variants.base(self.evaluator.variant))[requirement].unit
