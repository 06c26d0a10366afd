"""`cosim study`: run many variants, grid points and random draws of a diagram."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.terminal import studying

MOST_THREADS = 1024
EXIT_CODES = """Exit codes: 0 if members have come to their end, also if others failed (the summary says how many, and
why); 1 if not one has; 2 for bad input; 128+n if ended by signal n, 130 by Ctrl-C: what is finished is kept, and the
same command goes on from there."""


def study_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the commands that run studies."""
    parser.epilog = EXIT_CODES
    parser.add_argument("study", type=Path, nargs="+", help="a YAML study")
    parser.add_argument("--set", action="append", default=[], metavar="a.b=VALUE", help="change one value of the study")
    help_ = "threads (default: 0, one each processor)"
    parser.add_argument("--threads", type=threads, default=0, metavar="N", help=help_)
    parser.add_argument("--dask", default="", metavar="ADDRESS", help="run on a Dask cluster")
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="DIR", help="default: results/")


def threads(text: str) -> int:
    """How many threads an option says."""
    if not (text.isdecimal() and int(text) <= MOST_THREADS):
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 0 to {MOST_THREADS}")
    return int(text)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    study_arguments(parser)
    parser.add_argument("--member", metavar="NAME", help="run this member only, and record its signals")
    parser.add_argument("--json", action="store_true", help="print one JSON object for each study and nothing else")


def run(options: argparse.Namespace) -> int:
    """Run or resume the studies."""
    return studying.study(options)
