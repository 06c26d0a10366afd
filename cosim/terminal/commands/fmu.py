"""`cosim fmu`: what an FMU file is."""

from __future__ import annotations

import argparse
from pathlib import Path


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, help="an FMU")


def run(options: argparse.Namespace) -> int:
    """Print kinds, platforms, capabilities, variables as ports, and what validation finds."""
    from cosim.fmu import inspect
    from cosim.terminal import screen

    screen.say(inspect.text(options.file))
    return 0
