"""`cosim falsify`: runs a search, shows how far it is and what it has found, and keeps all on Ctrl-C."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable

from cosim.errors import Position
from cosim.language.source import Node
from cosim.results.formatting import format_value
from cosim.results.metrics import for_json
from cosim.results.text_table import TextTable
from cosim.search.checking import REAL
from cosim.search.falsification import Findings
from cosim.search.violations import Answer, Budget, Violations
from cosim.study import found
from cosim.study.counter import Counter
from cosim.terminal import screen, searched, study_display
from cosim.terminal.exits import DONE, UNCERTAIN, VIOLATED


def falsify(options: argparse.Namespace) -> int:
    """Search for violations of each requirement. Returns the exit code."""
    study = searched.load(options)
    folder = options.results / options.study.stem / found.FOLDER
    place = Position("--requirement")
    budget = Budget(options.runs, options.seconds, options.seed)
    answers: list[Answer] = []
    with Counter() as counter:
        last: list[Findings] = []

        def watch(_requirement: str, so_far: Findings) -> None:
            last[:] = [so_far]
            counter.update(so_far.trials, runs)

        wanted = [Node(name, place) for name in options.requirement]
        search = Violations(study, folder, wanted, options.threads, options.set, watch, lambda how: None)
        runs = options.runs or search.search.runs
        try:
            with search.evaluator.at_work():
                for name in search.requirements:
                    answers.append(search.of(name, budget))
                    found.keep(folder, study, [answers[-1].as_json()])
        except KeyboardInterrupt:
            _tell_interrupted(last)
            raise
    if options.json:
        content = {"study": str(options.study), "answers": [answer.as_json() for answer in answers]}
        print(json.dumps(for_json(content), ensure_ascii=False))
    else:
        for answer in answers:
            _show(answer)
    return _exit_code(answers)


def _exit_code(answers: Iterable[Answer]) -> int:
    verdicts = {answer.check.verdict for answer in answers if answer.check}
    return VIOLATED if REAL in verdicts else UNCERTAIN if verdicts else DONE


def _tell_interrupted(last: list[Findings]) -> None:
    if last and (least := last[0].least):
        so_far = f"{last[0].trials} runs, the smallest margin {_margin(least.margin)}"
        print(f"came as far as {so_far}; all is kept, and the same command goes on from there", file=sys.stderr)


def _margin(margin: float | None) -> str:
    return "—" if margin is None else format_value(margin)


def _show(answer: Answer) -> None:
    """Print what is said of one requirement."""
    least, unit = answer.least, f" {answer.unit}" if answer.unit not in ("", "1") else ""
    if answer.check is None:
        runs = "run" if answer.trials == 1 else "runs"
        near = f"; the smallest margin is {_margin(least.margin)}{unit}, {least.place}" if least else ""
        screen.print_wrapped(f"{answer.requirement}: no violation in {answer.trials} {runs}{near}", 2)
        screen.say("  that does not show that there is none: look longer, from another seed, or over more")
        return
    assert least
    told = f"by {_margin(least.margin)}{unit}, {least.place}" if not least.ended else f"({least.ended})"
    screen.print_wrapped(f"{answer.requirement}: violated {told}, after {answer.trials} runs", 2)
    rows: list[list[str]] = [
        [rerun.how, rerun.ended or _margin(rerun.margin), "" if rerun.ended else answer.unit]
        for rerun in answer.check.reruns
    ]
    study_display.show(TextTable("", ["the same run", "margin", "unit"], rows), numbers=False)
    error = f" (± {answer.check.error:.2g}{unit})" if answer.check.error is not None else ""
    screen.print_wrapped(f"  {answer.check.verdict}: {answer.check.why}{error}", 4)
    screen.say(f"  cosim run {answer.overlay}")
