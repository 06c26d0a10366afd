"""`cosim tune`: better values of free parameters, within bounds, checked with a smaller step."""

from __future__ import annotations

import argparse

from cosim.terminal import tuning_display
from cosim.terminal.commands.falsify import search_arguments

EXIT_CODES = """Exit codes: 0 if better values were found that keep all bounds; 1 if none were; 2 for bad input; 128+n
if ended by signal n: what has been run is kept, and the same command goes on from there."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = EXIT_CODES
    search_arguments(parser, "tune", "how many runs at most")


def run(options: argparse.Namespace) -> int:
    """Tune, and tell."""
    return tuning_display.tune(options)
