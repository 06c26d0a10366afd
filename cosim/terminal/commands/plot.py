"""`cosim plot`: a picture of recorded signals, or one that moves."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from cosim.errors import PlotError
from cosim.plot import animation, signal_plot, style
from cosim.plot.motion import PORTS, Motion
from cosim.plot.signal_plot import View
from cosim.results.result_file import open_result

LOGS = {"y": (True, False), "x": (False, True), "xy": (True, True), "none": (False, False)}
"""Which axes are logarithmic: the vertical one, the horizontal one."""
SIGNALS = """A panel is a signal, `plant.x`, or elements of it counted from 1, `plant.x[1,2]` or `plant.x[:,2]`; several
in one panel are joined by +, `"formation.S + formation.S_hat"`; a phase plane is one over another,
`"plant.x[:,2] over plant.x[:,1]"`. Several results are drawn over each other; what their diagrams say otherwise stands
in the legend, and `cosim compare` lists it."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="several are drawn over each other")
    parser.epilog = SIGNALS
    help_ = "the panels, see below (default: what the metrics reduce)"
    parser.add_argument("--signals", default="", metavar="PANEL,PANEL", help=help_)
    help_ = "which axes are logarithmic (default: the vertical one where the values need it)"
    parser.add_argument("--log", choices=LOGS, metavar="|".join(LOGS), help=help_)
    parser.add_argument("--from", dest="first", type=float, metavar="T", help="draw from this time on (s)")
    parser.add_argument("--to", dest="last", type=float, metavar="T", help="draw up to this time (s)")
    parser.add_argument("--columns", type=int, choices=range(1, 7), metavar="N", help="panels side by side (1 to 6)")
    parser.add_argument("--animate", action="store_true", help="bodies moving, as .mp4, .gif or .html")
    for part, port in PORTS.items():
        help_ = (
            f"with --animate: the signal with their {part} (default: as the diagram's `animation` says, or `{port}`)"
        )
        parser.add_argument(f"--{part}", metavar="a.b", help=help_)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="a .png, .svg or .pdf (default: RESULT.png)")


def run(options: argparse.Namespace) -> int:
    """Draw what the options say."""
    first: Path = options.results[0]
    _refuse_unused(options)
    if options.animate:
        output = options.output or first.with_suffix(f".{animation.film()}")
        with open_result(first) as result:
            motion = animation.animate(result, Motion(**{part: getattr(options, part) for part in PORTS}), output)
        print(", ".join(f"{part} {name}" for part, name in motion.signals.items()))
    else:
        output = options.output or first.with_suffix(".png")
        style.kind_of(output, style.FORMATS, "pictures")
        made = signal_plot.plot(options.results, options.signals, _view(options))
        style.save(made, output)
        print(made.get_label())
    print(f"drawn in {output}")
    if options.animate and not options.output and output.suffix == ".gif":
        print("a GIF, as ffmpeg is not installed; -o robots.html plays in a browser")
    return 0


def _view(options: argparse.Namespace) -> View:
    window = None
    if options.first is not None or options.last is not None:
        first = -math.inf if options.first is None else options.first
        window = (first, math.inf if options.last is None else options.last)
    log, log_x = LOGS[options.log] if options.log else (None, False)
    return View(log, log_x, window, options.columns)


def _refuse_unused(options: argparse.Namespace) -> None:
    """What the picture that is wanted would not show was asked for by mistake. Raises: PlotError."""
    parts = [f"--{part}" for part in PORTS if getattr(options, part) is not None]
    if parts and not options.animate:
        raise PlotError(f"{parts[0]} is a part of an animation", fix="add --animate, or choose lines by --signals")
    if options.animate and options.signals:
        raise PlotError("--signals chooses lines, and an animation has none", fix="choose its parts: --positions a.b")
    given = {"log": options.log, "from": options.first, "to": options.last, "columns": options.columns}
    lines = [f"--{name}" for name, value in given.items() if value is not None]
    if options.animate and lines:
        raise PlotError(f"{lines[0]} is for lines, and an animation has none", fix=f"leave out {lines[0]}")
    if options.animate and len(options.results) > 1:
        message = f"an animation shows one run, not {len(options.results)}"
        raise PlotError(message, fix=f"animate {options.results[0]} alone")
