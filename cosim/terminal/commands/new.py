"""`cosim new`: write the files of a new block."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.project import new_block
from cosim.terminal.screen import say


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("what", choices=["block"], help="what to write")
    parser.add_argument("name", help="such as ServoMotor or servo_motor")
    help_ = "where the block goes (default: blocks); its test goes to tests"
    parser.add_argument("--folder", type=Path, default=Path("blocks"), metavar="DIR", help=help_)


def run(options: argparse.Namespace) -> int:
    """Write a block and its test, and say how a diagram names it."""
    written, (block, test) = new_block.write(options.name, options.folder)
    say(f"written: {block}, which runs as it is, and its test, {test}")
    say(f"a diagram in this folder says  python: {written}")
    say(f"`cosim blocks {written}` shows it, `python -m pytest {test}` tests it")
    return 0
