"""`cosim fit`: the values of free parameters with which a diagram comes nearest to a measured table."""

from __future__ import annotations

import argparse

from cosim.terminal import fitting_display
from cosim.terminal.commands.falsify import search_arguments

EXIT_CODES = """Exit codes: 0 if values were found that the data tell; 1 with a warning: a value is at its bound, the
data do not tell it, or the model lacks something; 2 for bad input; 128+n if ended by signal n: what has been run is
kept, and the same command goes on from there."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = EXIT_CODES
    search_arguments(parser, "fit", "how many runs at most")


def run(options: argparse.Namespace) -> int:
    """Fit, and tell."""
    return fitting_display.fit(options)
