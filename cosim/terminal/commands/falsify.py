"""`cosim falsify`: search for runs that violate a requirement, and check whether they are real."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.terminal import falsifying
from cosim.terminal.commands.study import threads

EXIT_CODES = """Exit codes: 0 if no violation was found, which does not show that there is none; 3 if one is real; 1 if
those that were found are numerical or undecided; 2 for bad input; 128+n if ended by signal n: what has been run is
kept, and the same command goes on from there."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = EXIT_CODES
    search_arguments(parser, "search", "how many runs at most for each")
    help_ = "the requirement to be violated (default: those of the study, one after the other)"
    parser.add_argument("--requirement", action="append", default=[], metavar="NAME", help=help_)


def search_arguments(parser: argparse.ArgumentParser, section: str, runs: str) -> None:
    """Options of the commands that search; section: of the study that says over what; runs: help on how many."""
    parser.add_argument("study", type=Path, help=f"a YAML study with a section `{section}`")
    parser.add_argument("--runs", type=_count, default=0, metavar="N", help=runs)
    parser.add_argument("--seconds", type=_seconds, default=float("inf"), metavar="S", help="how long at most")
    parser.add_argument("--seed", type=_seed, default=None, metavar="N", help="in place of the study's")
    parser.add_argument("--variant", metavar="NAME", help="which of the study's variants, if there are several")
    parser.add_argument("--set", action="append", default=[], metavar="a.b=VALUE", help="change one value of the study")
    help_ = "threads (default: 0, one each processor)"
    parser.add_argument("--threads", type=threads, default=0, metavar="N", help=help_)
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="DIR", help="default: results/")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run(options: argparse.Namespace) -> int:
    """Search, check, and tell."""
    return falsifying.falsify(options)


def _count(text: str) -> int:
    if not (text.isdecimal() and int(text)):
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 1")
    return int(text)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number from 0")
    return int(text)


def _seconds(text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = -1.0
    if not found > 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no number above zero")
    return found
