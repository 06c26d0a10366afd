"""What a tuning says: the values before and after, every figure beside, and the overlay that has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.errors import MetricError, MissingKey, WrongValue, nearest
from cosim.language.diagram import Diagram
from cosim.results.formatting import format_value
from cosim.results.text_table import TextTable
from cosim.search import overlay_file
from cosim.search.evaluator import Evaluator
from cosim.search.tuning import Candidate, TuningRun
from cosim.search.worth import figures, objective
from cosim.study.addresses import value_at
from cosim.study.definition import Study, Tuning
from cosim.study.member_run import Row
from cosim.study.variants import Settings


@dataclass(frozen=True)
class Tuned:
    """The values before, and the best that were found; None if none keep all bounds and are better.

    spent: how many runs it took. values: of each free path, before and after. overlay: the file with those after.
    """

    objective: str
    before: Candidate
    after: Candidate | None
    spent: int
    values: dict[str, tuple[Any, Any]]
    overlay: Path | None

    def as_json(self) -> dict[str, Any]:
        """What it says, as JSON has it."""
        return {
            "minimised": self.objective,
            "runs": self.spent,
            "found": self.after is not None,
            "values": {path: list(pair) for path, pair in self.values.items()},
            "before": _as_json(self.before),
            "after": _as_json(self.after) if self.after else None,
            "overlay": str(self.overlay) if self.overlay else None,
        }


def _as_json(candidate: Candidate) -> dict[str, Any]:
    parts = {"runs": candidate.rows, "finer": candidate.finer, "held_out": candidate.held}
    content: dict[str, Any] = {name: [row["metrics"] for row in rows] for name, rows in parts.items()}
    return {**content, "broken": list(candidate.worth.broken), "changes": candidate.changes}


def tuning_of(study: Study) -> Tuning:
    """The study's tuning. Raises: MissingKey."""
    if study.tuning is None:
        fix = "write tune: {over: {blocks.controller.parameters.k_p: {uniform: [1, 10]}}, minimise: error}"
        raise MissingKey(f"the study {study.path} has no `tune`", None, fix)
    return study.tuning


def tune(
    study: Study,
    folder: Path,
    budget: tuple[int, float, int | None],
    threads: int,
    settings: Sequence[str],
    watch: Callable[[int, float | None], None],
) -> Tuned:
    """Tune. budget: runs, 0 for what the study says; seconds; seed, None as runs.

    Raises: as `TuningRun`, MetricError.
    """
    tuning = tuning_of(study)
    evaluator = Evaluator(study, tuning.space, folder, threads, settings)
    network = evaluator.variants.base(evaluator.variant)
    _check(tuning, network.diagram)
    starts = _starts(evaluator, study, tuning)
    runs, seconds, seed = budget
    seed = tuning.space.seed if seed is None else seed
    search = TuningRun(evaluator, tuning, starts, runs or tuning.runs, seconds, seed, watch)
    with evaluator.at_work():
        before, after = search.run()
    values = {path: (value_at(network, path), value) for path, value in (after.settings if after else ())}
    overlay = None
    if after:
        overlay = folder / "tuned.yaml"
        title = f"{network.diagram.title}, tuned"
        overlay_file.write(overlay, title, evaluator.variants, evaluator.variant, after.settings)
    return Tuned(str(tuning.objective.value), before, after, search.spent, values, overlay)


def _check(tuning: Tuning, diagram: Diagram) -> None:
    """Raises: MetricError for a metric that there is not."""
    known = list(diagram.figures)
    places = {bounds.signal: bounds.node.place for bounds in tuning.subject}
    for name in figures(tuning):
        if name not in known and not _is_constant(name):
            place = places.get(name, tuning.objective.position)
            raise MetricError(
                f"there is no metric `{name}`", place, nearest(name, known) or "define it below `metrics:`"
            )


def _is_constant(name: str) -> bool:
    from cosim.language.elementary import FUNCTIONS
    from cosim.language.expression import CONSTANTS

    return name in CONSTANTS or name in FUNCTIONS


def _starts(evaluator: Evaluator, study: Study, tuning: Tuning) -> list[Settings]:
    """The study's draws, as settings. Raises: WrongValue where none are left to tune with, NoAcceptedDraw."""
    draws = evaluator.variants.draws()
    count = study.random.count if study.random else 1
    if tuning.held_out >= count:
        message = f"`tune.held_out` of {tuning.held_out} leaves none of {count} draws to tune with"
        raise WrongValue(message, tuning.node.place, "a smaller one, or a larger `random.count`")
    return [draws.settings(number) for number in range(draws.count)] if draws else [()]


def tables(made: Tuned, tuning: Tuning) -> list[TextTable]:
    """The free values, and the figures that are named, before and after; the worst where there are several runs."""
    columns: list[tuple[str, list[Row]]] = [("before", made.before.rows)]
    columns += [("before, h/10", made.before.finer)] if made.before.finer else []
    if made.after:
        columns += [("after", made.after.rows)]
        columns += [("after, h/10", made.after.finer)] if made.after.finer else []
    if made.before.held:
        columns += [("held out, before", made.before.held)]
        columns += [("held out, after", made.after.held)] if made.after else []
    lines = [[made.objective, *(format_value(_mean(tuning, rows)) for _, rows in columns)]]
    named = dict.fromkeys([*figures(tuning), *made.before.rows[0]["requirements"]])
    lines += [
        [name, *(format_value(_worst(tuning, name, rows)) for _, rows in columns)]
        for name in named
        if name != made.objective
    ]
    values = [[path, format_value(_alike(a)), format_value(b)] for path, (a, b) in made.values.items()]
    found = [TextTable("", ["free", "before", "after"], values)] if values else []
    return [*found, TextTable("", ["figure", *(head for head, _ in columns)], lines)]


def _alike(value: Any) -> Any:
    """One number for a list of equal ones."""
    return value[0] if isinstance(value, list) and value and all(item == value[0] for item in value) else value


def _mean(tuning: Tuning, rows: Sequence[Row]) -> float | None:
    values = [objective(tuning, row["metrics"]) for row in rows]
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) and known else None


def _worst(tuning: Tuning, name: str, rows: Sequence[Row]) -> float | None:
    """The figure of the run that is nearest to its bound, or the largest where it has none; the least margin."""
    values = [row["metrics"].get(name) for row in rows]
    known = [value for value in values if isinstance(value, int | float)]
    least = any(b.signal == name and b.least > -float("inf") for b in tuning.subject)
    margin = any(name in row["requirements"] for row in rows)
    return (min if least or margin else max)(known, default=None)
