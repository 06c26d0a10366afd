"""`cosim check`: validate a diagram without running it."""

from __future__ import annotations

import argparse

from cosim import inspection
from cosim.commands.options import diagram_arguments, load_network


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    help_ = "import no `python:` file, so that nothing of a stranger's diagram runs; says what it could not check"
    parser.add_argument("--no-code", action="store_true", help=help_)


def run(options: argparse.Namespace) -> int:
    """Print blocks, wires, order and conditions."""
    inspection.print_network(load_network(options, code=not options.no_code))
    return 0
