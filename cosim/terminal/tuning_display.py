"""`cosim tune`: runs a tuning, shows how far it is, and the values and figures before and after."""

from __future__ import annotations

import argparse
import json
import sys

from cosim.results.formatting import format_value
from cosim.results.metrics import for_json
from cosim.search import tuned
from cosim.search.tuned import Tuned
from cosim.study.counter import Counter
from cosim.study.definition import Tuning
from cosim.terminal import screen, searched, study_display
from cosim.terminal.exits import DONE, UNCERTAIN


def tune(options: argparse.Namespace) -> int:
    """Tune. Returns the exit code: 1 where nothing better was found."""
    study = searched.load(options)
    tuning = tuned.tuning_of(study)
    folder = options.results / options.study.stem / "tune"
    so_far: list[tuple[int, float | None]] = []
    with Counter() as counter:

        def watch(spent: int, best: float | None) -> None:
            so_far[:] = [(spent, best)]
            counter.update(min(spent, runs), runs)

        runs = options.runs or tuning.runs
        budget = options.runs, options.seconds, options.seed
        try:
            made = tuned.tune(study, folder, budget, options.threads, options.set, watch)
        except KeyboardInterrupt:
            for spent, best in so_far:
                reached = "nothing better" if best is None else f"{tuning.objective.value} {format_value(best)}"
                kept = "all runs are kept, and the same command goes on from there"
                print(f"came as far as {spent} runs, {reached} so far; {kept}", file=sys.stderr)
            raise
    if options.json:
        print(json.dumps(for_json({"study": str(options.study), **made.as_json()}), ensure_ascii=False))
    else:
        _show(made, tuning)
    return DONE if made.after else UNCERTAIN


def _show(made: Tuned, tuning: Tuning) -> None:
    for table in tuned.tables(made, tuning):
        study_display.show(table)
    if made.before.worth.broken:
        screen.print_wrapped(f"before: {'; '.join(made.before.worth.broken)}", 2)
    if made.after is None:
        screen.say(f"nothing better was found in {made.spent} runs that keeps all bounds")
        return
    changes = f"figures change by at most {100 * made.after.changes:.2g} % at a tenth of the step"
    checked = changes if made.after.finer else "not checked with a smaller step, which would be another system"
    screen.say(f"tuned in {made.spent} runs; {checked}")
    screen.say(f"cosim run {made.overlay}")
