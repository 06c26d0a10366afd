"""`cosim fit`: runs a fit, shows how far it is, and the values with their intervals."""

from __future__ import annotations

import argparse
import json
import sys

from cosim.errors import CosimError
from cosim.results.formatting import format_value
from cosim.results.metrics import for_json
from cosim.search import fit_answer
from cosim.search.fit_answer import FitAnswer
from cosim.study.counter import Counter
from cosim.terminal import screen, searched, study_display
from cosim.terminal.exits import DONE, UNCERTAIN


def fit(options: argparse.Namespace) -> int:
    """Fit. Returns the exit code: 1 where the values are not to be believed without a look at the warnings."""
    study = searched.load(options)
    wanted = fit_answer.fit_of(study)
    folder = options.results / options.study.stem / "fit"
    so_far: list[tuple[int, float | None]] = []
    with Counter() as counter:

        def watch(spent: int, least: float | None) -> None:
            so_far[:] = [(spent, least)]
            counter.update(min(spent, runs), runs)

        runs = options.runs or wanted.runs
        budget = options.runs, options.seconds, options.seed
        try:
            made = fit_answer.fit(study, folder, budget, options.threads, options.set, watch)
        except KeyboardInterrupt:
            for spent, least in so_far:
                kept = "all runs are kept, and the same command goes on from there"
                reached = f"came as far as {spent} runs, the least sum of squares {format_value(least)}"
                print(f"{reached}; {kept}", file=sys.stderr)
            raise
    warnings = list(made.warnings())
    if options.json:
        print(json.dumps(for_json({"study": str(options.study), **made.as_json()}), ensure_ascii=False))
    else:
        _show(made)
        screen.print_warnings(list(map(CosimError, warnings)))
    return UNCERTAIN if warnings else DONE


def _show(made: FitAnswer) -> None:
    for table in made.tables():
        study_display.show(table)
    same = len(made.fitted.ends) - len(made.fitted.others())
    starts = f"{same} of {len(made.fitted.ends)} starts end there"
    screen.say(f"fitted in {made.spent} runs to {made.measured.size} measurements; {starts}")
    screen.say(f"cosim run {made.overlay}")
