"""`cosim run`: run a diagram and print its metrics."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.engine.outcome import Outcome
from cosim.engine.run import ENGINES, Run
from cosim.errors import CosimError, NothingToResume, UsageError
from cosim.machine import files
from cosim.results import csv_table, result_file
from cosim.results.metrics import for_json
from cosim.results.result_writer import previous_path
from cosim.terminal import profile_display, screen
from cosim.terminal.commands.options import diagram_arguments, load_network
from cosim.terminal.exits import BY_SIGNAL, DONE, STOPPED, UNCERTAIN, VIOLATED

if TYPE_CHECKING:
    from cosim.accuracy.certificate import Certificate
    from cosim.profiling.profile import Profile


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("--engine", choices=ENGINES, default=ENGINES[0], help="python: for breakpoints in blocks")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.nc", help="result (default: results/<diagram>.nc)")
    parser.add_argument("--csv", type=Path, metavar="FILE.csv", help="write the recorded signals as CSV too")
    help_ = "say how wrong each metric may be, by four more runs: 9 times the work in all"
    parser.add_argument("--error", action="store_true", help=help_)
    help_ = "say what the time goes to: blocks and their functions, integration, figures, the start; by a second run"
    parser.add_argument("--profile", action="store_true", help=help_)
    help_ = "keep a checkpoint beside the result: every so many simulated seconds, or 10min, 2h of wall-clock time"
    parser.add_argument("--checkpoint", metavar="EVERY", help=help_)
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint of a run that did not end")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run(options: argparse.Namespace) -> int:
    """Run the diagram; 0 only if it completed."""
    network = load_network(options)
    output = options.output or Path("results") / f"{options.diagram.stem}.nc"
    if options.error and (options.checkpoint or options.resume):
        raise UsageError(
            "--error makes further runs, which keep no checkpoints", fix=f"cosim accuracy {options.diagram}"
        )
    if options.profile and (options.resume or options.engine != ENGINES[0]):
        raise UsageError(
            "--profile times compiled code along a whole run", fix="leave out --resume and --engine python"
        )
    if not options.resume:  # a result whose run was killed may be in pieces
        result_file.refuse_foreign(output)
    files.require_ending(output, "a result", "nc")
    if options.csv:
        csv_table.refuse_foreign_csv(options.csv)
        files.require_ending(options.csv, "a table", "csv")
    run = Run(network, options.engine, output, options.began, checkpoint=options.checkpoint, resume=options.resume)
    before = previous_path(output) if options.resume else output
    previous = _previous(before, run) if before.exists() and before.stat().st_size else None
    certify = _certifier(run, options)
    try:
        with screen.Progress(network.diagram.run.stop, resumed=options.resume) as progress:
            outcome = run.execute(progress.update)
    except NothingToResume as ended:
        return _tell_end(ended, output, options)
    profile = _profile(run, outcome) if options.profile else None
    certificate = certify(outcome)
    if options.json:
        print(outcome.as_json())
    else:
        _report(outcome, previous, certificate)
    if profile and not options.json:
        profile_display.show(profile)
    if outcome.error:
        screen.print_errors(outcome.error)
    _write_csv(output, options)
    uncertain = options.error and (certificate is None or certificate.changing)
    return _exit_code(outcome) or (UNCERTAIN if uncertain or outcome.kept is None else DONE)


def _profile(run: Run, outcome: Outcome) -> Profile | None:
    """What the time of a run went to, noted in its outcome; None, and a warning there, where that cannot be told."""
    from cosim.profiling import profile

    if outcome.status != "completed":
        return None
    try:
        made = profile.profile(run)
    except CosimError as error:
        outcome.warnings.append(CosimError(f"no profile: {error.message}", error.position, error.fix))
        return None
    except KeyboardInterrupt as stopped:
        stopped.add_note(f"before the profile was known; the run itself is recorded in {run.output}")
        raise
    outcome.profile = made.as_json()
    return made


def _previous(path: Path, run: Run) -> tuple[dict[str, Any], dict[str, Any]]:
    """The metrics and the verdicts of the run before that were of the same."""
    formulas = {name: entry.text for name, entry in run.network.diagram.requirements.items()}
    said = result_file.read_attributes(path)
    return result_file.metrics_in(said, run.reductions.meanings), result_file.requirements_in(said, formulas)


def _tell_end(ended: NothingToResume, output: Path, options: argparse.Namespace) -> int:
    """Of a run that was to go on and had come to its end before, say that."""
    if options.json:
        metrics = for_json(result_file.metrics_in(result_file.read_attributes(output)))
        content = {"diagram": str(options.diagram), "status": ended.status, "metrics": metrics, "results": str(output)}
        print(json.dumps({**content, "message": ended.message}, ensure_ascii=False))
    else:
        screen.say(ended.message)
    _write_csv(output, options)
    return DONE if ended.status == "completed" else STOPPED


def _write_csv(output: Path, options: argparse.Namespace) -> None:
    if options.csv:
        with result_file.open_result(output) as result:
            csv_table.write_csv(options.csv, result)


def _certifier(run: Run, options: argparse.Namespace) -> Callable[[Outcome], Certificate | None]:
    """What gives a run its certificate when it is done; none where none is wanted, or it does not come to its end."""
    if not options.error:
        return lambda outcome: None
    from cosim.terminal import certifying

    certifying.prepare(run)
    return lambda outcome: certifying.certify(run, outcome, options) if outcome.status == "completed" else None


def _exit_code(outcome: Outcome) -> int:
    if outcome.status == "interrupted":
        return BY_SIGNAL + (outcome.signal or signal.SIGINT)
    if outcome.status != "completed":
        return STOPPED
    return VIOLATED if outcome.kept is False else DONE


def _report_requirements(outcome: Outcome, previous: dict[str, Any] | None, certificate: Certificate | None) -> None:
    from cosim.terminal import requirement_display

    print(end="\n" if outcome.metrics else "")
    margins = {name: accuracy.error for name, accuracy in certificate.requirements.items()} if certificate else {}
    requirement_display.show(outcome.requirements.values(), previous, margins)


def _report(
    outcome: Outcome, previous: tuple[dict[str, Any], dict[str, Any]] | None, certificate: Certificate | None
) -> None:
    metrics, judged = previous or (None, None)
    errors = {name: accuracy.error for name, accuracy in certificate.metrics.items()} if certificate else None
    if outcome.metrics:
        screen.metrics_table(outcome.metrics, metrics, outcome.units, outcome.windows, errors=errors)
    if outcome.requirements:
        _report_requirements(outcome, judged, certificate)
    if certificate:
        from cosim.terminal import accuracy_display

        print()
        accuracy_display.print_notes(certificate)
    seconds = ", ".join(f"{name} {value:.3g} s" for name, value in outcome.seconds.items())
    compiled = f", kernels compiled: {outcome.kernels_compiled}" if outcome.kernels_compiled else ""
    by = f" by {signal.Signals(outcome.signal).name}" if outcome.signal else ""
    since = f", resumed at t = {outcome.resumed:g} s" if outcome.resumed is not None else ""
    print(f"\n{outcome.status}{by} after {outcome.steps} steps ({outcome.method}; {seconds}{compiled}{since})")
    if outcome.termination:
        screen.say(outcome.termination.message)
    if outcome.stepping:
        screen.say(str(outcome.stepping))
    if outcome.inner_steps:
        rejected = {name: f" ({n['rejected']} rejected)" for name, n in outcome.inner_steps.items() if "rejected" in n}
        counts = [f"{name} {n['taken']}{rejected.get(name, '')}" for name, n in outcome.inner_steps.items()]
        screen.print_wrapped(f"inner steps within tolerance: {', '.join(counts)}", 2)
    screen.say(f"recorded in {outcome.results}")
    if outcome.checkpoint:
        file, time = outcome.checkpoint
        screen.say(f"checkpoint of t = {time:g} s in {file}: --resume goes on from there")
    for swap in outcome.swaps:
        screen.say(swap)
    sys.stdout.flush()
    screen.print_warnings(outcome.warnings)
    for event in outcome.events:
        first = event.times if isinstance(event.times, float) else min(e["time"] for e in event.times)
        screen.print_warnings([CosimError(f"{event.signal}: {event.text}, first at t = {first:g} s")])
