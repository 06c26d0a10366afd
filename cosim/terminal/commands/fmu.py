"""`cosim fmu`: what an FMU file is."""

from __future__ import annotations

import argparse
from pathlib import Path

LABEL = 10
"""Characters of what a line begins with, such as `kind`, below which nothing else stands."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, help="an FMU")


def run(options: argparse.Namespace) -> int:
    """Print kinds, platforms, capabilities, variables as ports, and what validation finds."""
    from cosim.fmu import inspect
    from cosim.terminal import screen

    for line in inspect.text(options.file).splitlines():
        screen.print_wrapped(line, LABEL)
    return 0
