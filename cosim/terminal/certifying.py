"""`cosim run --error`: the metrics of a run that is done get their errors, by more runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.accuracy import certificate
from cosim.accuracy.certificate import Certificate
from cosim.accuracy.observed import Observed
from cosim.accuracy.refined_runs import Observation, RefinedRuns
from cosim.engine.outcome import Outcome
from cosim.engine.run import Run
from cosim.errors import NoCertificate, ResultError
from cosim.results import result_writer
from cosim.terminal import screen
from cosim.terminal.commands.options import load_network


def prepare(run: Run) -> None:
    """Have a run, before it is executed, keep what its figures are judged by. Raises: UsageError if it has none."""
    certificate.require_figures(run.network, signals=False)
    run.reductions = Observed(run.network)


def certify(run: Run, outcome: Outcome, options: argparse.Namespace) -> Certificate | None:
    """The certificate of a run that has come to its end, noted in its outcome and in its result.

    None, and a warning in the outcome, where there is none, as a run with a smaller step does not come to its end.
    """
    assert isinstance(run.reductions, Observed)
    done = Observation(run.network.diagram.run.step, outcome, run.reductions)
    with screen.Progress(run.network.diagram.run.stop) as progress:
        runs = RefinedRuns(
            run.network,
            lambda more: load_network(options, more=more),
            options.engine,
            watch=progress.update,
            kernels=run.simulation.kernels,
        )
        try:
            made = certificate.certify_run(done, runs)
        except NoCertificate as error:
            outcome.warnings.append(error)
            return None
        except KeyboardInterrupt as stopped:
            stopped.add_note(f"before the errors were known; the run itself is recorded in {run.output}")
            raise
    both = {**made.metrics, **made.requirements}
    outcome.accuracy = {name: accuracy.as_json() for name, accuracy in both.items()}
    try:
        result_writer.add_accuracy(Path(str(run.output)), outcome.accuracy)
    except ResultError as full:
        outcome.status, outcome.error = "failed", full
    return made
