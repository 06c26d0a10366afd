"""`cosim plot`: a picture of recorded signals, or one that moves."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.plot import animation, figures
from cosim.plot.animation import Motion
from cosim.results import open_result


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="several are drawn over each other")
    parser.add_argument("--signals", default="", metavar="a.b,c.d[1]", help="default: what the metrics reduce")
    parser.add_argument("--animate", action="store_true", help="robots moving, as .gif or .html")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="a .png, .svg or .pdf (default: RESULT.png)")


def run(options: argparse.Namespace) -> int:
    """Draw what the options say."""
    first: Path = options.results[0]
    if options.animate:
        output = options.output or first.with_suffix(".gif")
        with open_result(first) as result:
            animation.animate(result, Motion(), output)
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
