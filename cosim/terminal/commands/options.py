"""Options that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim.wiring.network import Network


def diagram_arguments(parser: argparse.ArgumentParser) -> None:
    """A diagram or an FMU, and what may be changed in it."""
    parser.add_argument("diagram", type=Path, help="a YAML diagram, or an FMU, which is run alone")
    parser.add_argument("--set", action="append", default=[], metavar="a.b.c=VALUE", help="change one value")
    parser.add_argument("--swap", action="append", default=[], metavar="BLOCK=TYPE", help="another type for a block")
    for name, text in (("stop", "end of the run (s)"), ("step", "communication step (s)"), ("method", "master method")):
        parser.add_argument(f"--{name}", metavar=name.upper(), help=text)


def load_network(options: argparse.Namespace, code: bool = True, more: Sequence[str] = ()) -> Network:
    """The wired diagram that the options name; code as of `wiring.wire`, more: settings. Raises: DiagramErrors."""
    from cosim.engine import run

    return run.load(options.diagram, [*settings_of(options), *more], options.swap, code)


def settings_of(options: argparse.Namespace) -> list[str]:
    """What --set and its short forms say."""
    short = [f"run.{k}={v}" for k in ("stop", "step", "method") if (v := getattr(options, k)) is not None]
    return [*options.set, *short]
