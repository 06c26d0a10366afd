"""`cosim plot`: a picture of recorded signals, or one that moves."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.plot import animation, figures
from cosim.plot.animation import PORTS, Motion
from cosim.results import open_result


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="several are drawn over each other")
    parser.add_argument("--signals", default="", metavar="a.b,c.d[1]", help="default: what the metrics reduce")
    parser.add_argument("--animate", action="store_true", help="robots moving, as .gif or .html")
    for part, port in PORTS.items():
        help_ = f"with --animate: the signal with their {part} (default: the recorded port called `{port}`)"
        parser.add_argument(f"--{part}", metavar="a.b", help=help_)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="a .png, .svg or .pdf (default: RESULT.png)")


def run(options: argparse.Namespace) -> int:
    """Draw what the options say."""
    first: Path = options.results[0]
    if options.animate:
        output = options.output or first.with_suffix(".gif")
        with open_result(first) as result:
            motion = animation.animate(result, Motion(**{part: getattr(options, part) for part in PORTS}), output)
        print(", ".join(f"{part} {name}" for part, name in motion.signals.items()))
    else:
        output = options.output or first.with_suffix(".png")
        print(", ".join(figures.plot(options.results, _names(options.signals), output)))
    print(f"drawn in {output}")
    return 0


def _names(text: str) -> list[str]:
    """The names between commas that are not inside brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += {"[": 1, "]": -1}.get(character, 0)
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts if part.strip()]
