"""`cosim accuracy`: say how wrong a diagram's figures may be."""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from cosim.accuracy import certificate
from cosim.accuracy.certificate import Certificate
from cosim.accuracy.largest_step import Wanted
from cosim.accuracy.refined_runs import RefinedRuns
from cosim.errors import NoCertificate, PlotError, UsageError, nearest
from cosim.machine import files
from cosim.plot import error_lines
from cosim.plot.style import FORMATS
from cosim.results.metrics import for_json
from cosim.terminal import accuracy_display, screen
from cosim.terminal.commands.options import diagram_arguments, load_network
from cosim.terminal.exits import DONE, UNCERTAIN
from cosim.wiring.network import Network

TELLS = """Runs the diagram with its own step, half and a quarter of it, with steps that lie elsewhere, with some
that are cut, and with more inner steps: eight runs, which take 19 times as long as one. `value ± error`: by how much a
figure may be off at the diagram's step; `order`: how its error falls with the step; `coupling` and `integration`: what
the communication step and the blocks' own integration contribute. Exit codes: 1 where a figure depends on the step, or
no error can be told; else as of `cosim --help`."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = TELLS
    diagram_arguments(parser)
    help_ = "find the largest step with such an error: relative, or absolute of one metric or signal"
    parser.add_argument("--wanted", action="append", default=[], type=_wanted, metavar="[NAME=]X", help=help_)
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the metrics' errors over the step: .png, .svg, .pdf"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run(options: argparse.Namespace) -> int:
    """Print the certificate; 1 where a figure depends on the step, or a run does not come to its end."""
    network = load_network(options)
    certificate.require_figures(network, signals=True)
    wanted = _asked(options.wanted, network)
    if options.plot:
        files.require_ending(options.plot, "a picture", *FORMATS)
    with tempfile.TemporaryDirectory(prefix="cosim-") as folder, screen.Progress(network.diagram.run.stop) as progress:
        recorded = Path(folder) if network.recorded else None
        runs = RefinedRuns(
            network, lambda more: load_network(options, more=more), folder=recorded, watch=progress.update
        )
        try:
            made = certificate.certify(runs, wanted)
        except NoCertificate as error:
            return _none(error, options)
    if options.json:
        print(json.dumps(for_json(made.as_json()), ensure_ascii=False))
    else:
        accuracy_display.show(made)
    screen.print_warnings(made.warnings)
    if options.plot:
        error_lines.draw(made.steps, _relative(made), options.plot)
    return UNCERTAIN if made.changing else DONE


def _none(error: NoCertificate, options: argparse.Namespace) -> int:
    if options.json:
        content = {"diagram": str(options.diagram), "status": "failed", "error": str(error)}
        print(json.dumps(content, ensure_ascii=False))
    screen.print_errors(error)
    return UNCERTAIN


def _relative(made: Certificate) -> dict[str, list[float]]:
    """The errors that can be drawn, of each metric at all steps. Raises: PlotError if there are none."""
    metrics = {name: accuracy for name, accuracy in made.metrics.items() if accuracy.relative}
    if not metrics:
        raise PlotError("no metric has an error that could be drawn", fix="leave --plot out")
    return {name: [error / accuracy.size for error in accuracy.errors] for name, accuracy in metrics.items()}


def _wanted(text: str) -> tuple[str, float]:
    """A name, or nothing for all, and an error."""
    name, _, number = text.rpartition("=")
    with suppress(ValueError):
        value = float(number)
        if 0.0 < value < math.inf:
            return name.strip(), value
    raise argparse.ArgumentTypeError(f"`{text}` is no number above zero, nor NAME=NUMBER")


def _asked(wanted: Iterable[tuple[str, float]], network: Network) -> Wanted | None:
    """Raises: UsageError."""
    known = [*network.reduced, *map(str, network.recorded)]
    found = dict(wanted)
    relative = found.pop("", None)
    for name in found:
        if name not in known:
            raise UsageError(f"--wanted: there is no metric and no recorded signal `{name}`", fix=nearest(name, known))
    return Wanted(relative, found) if relative or found else None
