"""`cosim lsp`: the language server that editors start."""

from __future__ import annotations

import argparse
import os
import sys

from cosim.errors import MissingPackage
from cosim.machine import distributions
from cosim.terminal.exits import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--stdio", action="store_true", help="over standard input and output, as always")
    parser.description = (
        "Answer an editor by the Language Server Protocol, over standard input and output: mistakes while one types,"
        " completion, what a word means, where it is from, and new names for blocks. Editors start this themselves."
    )


def run(_: argparse.Namespace) -> int:
    """Serve until the editor ends it. What blocks print goes to standard error. Raises: MissingPackage."""
    try:
        from cosim.editor import server
    except ImportError:
        fix = "pip install 'cosim[editor]'"
        raise MissingPackage("an editor's server needs the package pygls, which is not installed", fix=fix) from None
    sys.stdout.flush()
    with os.fdopen(os.dup(0), "rb") as asked, os.fdopen(os.dup(1), "wb") as answered:
        os.dup2(2, 1)
        server.serve(asked, answered, distributions.versions("cosim")["cosim"])
    return DONE
