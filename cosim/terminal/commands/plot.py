"""`cosim plot`: a picture of recorded signals, or one that moves."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.errors import PlotError
from cosim.plot import animation, figures
from cosim.plot.animation import PORTS, Motion
from cosim.results.result_file import open_result


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
    _refuse_unused(options)
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


def _refuse_unused(options: argparse.Namespace) -> None:
    """What the picture that is wanted would not show was asked for by mistake. Raises: PlotError."""
    parts = [f"--{part}" for part in PORTS if getattr(options, part) is not None]
    if parts and not options.animate:
        raise PlotError(f"{parts[0]} is a part of an animation", fix="add --animate, or choose lines by --signals")
    if options.animate and options.signals:
        raise PlotError("--signals chooses lines, and an animation has none", fix="choose its parts: --positions a.b")
    if options.animate and len(options.results) > 1:
        message = f"an animation shows one run, not {len(options.results)}"
        raise PlotError(message, fix=f"animate {options.results[0]} alone")
    if options.signals and not _names(options.signals):
        raise PlotError(f"`{options.signals}` names no signal", fix="names joined by commas, such as plant.x,plant.v")


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
