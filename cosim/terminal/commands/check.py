"""`cosim check`: validate a diagram without running it."""

from __future__ import annotations

import argparse

from cosim.engine import compilation, program
from cosim.terminal import inspection
from cosim.terminal.commands.options import diagram_arguments, load_network


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    help_ = "import no `python:` file, so that nothing of a stranger's diagram runs; says what it could not check"
    parser.add_argument("--no-code", action="store_true", help=help_)


def run(options: argparse.Namespace) -> int:
    """Compile what a run needs, so that what it would refuse is refused; print blocks, wires, order, conditions."""
    network = load_network(options, code=not options.no_code)
    fleets: dict[str, str] = {}
    if not options.no_code:
        built = program.build(network, network.diagram.run.method)
        fleets = compilation.one_by_one(built, compilation.compile_program(built))
    inspection.print_network(network, fleets)
    return 0
