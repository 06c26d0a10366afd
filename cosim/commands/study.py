"""`cosim study`: run many variants, grid points and random draws of a diagram."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.study import command


def study_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the commands that run studies."""
    parser.add_argument("study", type=Path, nargs="+", help="a YAML study")
    parser.add_argument("--set", action="append", default=[], metavar="a.b=VALUE", help="change one value of the study")
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="threads (default: one each processor)")
    parser.add_argument("--dask", default="", metavar="ADDRESS", help="run on a Dask cluster")
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="DIR", help="default: results/")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    study_arguments(parser)
    parser.add_argument("--member", metavar="NAME", help="run this member only, and record its signals")
    parser.add_argument("--json", action="store_true", help="print one JSON object for each study and nothing else")


def run(options: argparse.Namespace) -> int:
    """Run or resume the studies."""
    return command.study(options)
