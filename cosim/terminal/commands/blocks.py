"""`cosim blocks`: list the library, or show one block."""

from __future__ import annotations

import argparse

from cosim.terminal import inspection


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("name", nargs="?", help="a block, or file.py:Block")


def run(options: argparse.Namespace) -> int:
    """Print the list, or everything about one block."""
    inspection.print_blocks(options.name)
    return 0
