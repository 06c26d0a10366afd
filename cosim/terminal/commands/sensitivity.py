"""`cosim sensitivity`: which drawn values a figure depends on, and how much."""

from __future__ import annotations

import argparse

from cosim.terminal import sensitivity_display
from cosim.terminal.commands.falsify import search_arguments


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    search_arguments(parser, "random", "how many runs at most (default: 1024)")
    help_ = "a metric or a requirement (default: all that are numbers)"
    parser.add_argument("--metric", action="append", default=[], metavar="NAME", help=help_)


def run(options: argparse.Namespace) -> int:
    """Run, and tell."""
    return sensitivity_display.show(options)
