"""`cosim blocks`: list the library and a project's own blocks, search them, or show one."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.terminal import block_list, inspection


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    help_ = "a block (Gain, acme.motors:Servo, file.py:Block), words to look for, a Python file, a folder or a diagram"
    parser.add_argument("what", nargs="*", help=help_)


def run(options: argparse.Namespace) -> int:
    """Print the list, a part of it, or everything about one block."""
    words = " ".join(options.what)
    if not words:
        block_list.print_all()
    elif block_list.is_path(words):
        block_list.print_own(Path(words))
    elif ":" in words:
        inspection.print_block(words)
    else:
        block_list.print_found(words)
    return 0
