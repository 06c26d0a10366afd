"""One style for all pictures, as a journal prints them: serif, thin frames, lines that differ also in grey."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.errors import PlotError

FORMATS = ("png", "svg", "pdf")
WIDTH = 7.16
"""Inches across two columns of a journal's page."""
COLUMN = 3.5
# Colours that colour-blind readers tell apart, from dark to light, so that grey print keeps them apart too.
COLOURS = ("#000000", "#c1440e", "#4393d0", "#e0a100", "#6a4c93", "#5a9e6f", "#8c8c8c", "#d08fb0")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1, 1.2)))
SETTINGS: Any = {
    "font.family": "serif",
    "font.serif": ["STIXGeneral"],
    "mathtext.fontset": "stix",
    "font.size": 8.5,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "axes.grid": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.4,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "#b0b0b0",
    "legend.fancybox": False,
    "legend.handlelength": 2.4,
    "patch.linewidth": 0.6,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 300,
    "svg.fonttype": "path",
    "svg.hashsalt": "cosim",
    "pdf.fonttype": 42,
}


@contextmanager
def style() -> Iterator[Any]:
    """Draw in this style, without a screen; gives `matplotlib.pyplot`. Raises: PlotError if it is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise PlotError("matplotlib is not installed", fix="pip install matplotlib pillow") from None
    if not {"matplotlib.pyplot", "ipykernel"} & set(sys.modules):  # else a program draws too, maybe on a screen
        matplotlib.use("Agg")
    from matplotlib import pyplot

    others = set(pyplot.get_fignums())
    with matplotlib.rc_context(SETTINGS):
        try:
            yield pyplot
        finally:
            for number in set(pyplot.get_fignums()) - others:
                pyplot.close(number)


def save(made: Any, output: Path) -> None:
    """Write a figure as PNG, SVG or PDF, by the name's ending. Raises: PlotError."""
    kind = output.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise PlotError(f"`{output}`: pictures are {', '.join(FORMATS)}", fix="such as -o picture.svg")
    about = {"Date": None} if kind == "svg" else {"CreationDate": None} if kind == "pdf" else {}
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        made.savefig(output, metadata=about)
    except OSError as error:
        message = f"cannot write {output}: {error.strerror or error}"
        raise PlotError(message, fix="choose a folder that you may write to") from None
    except (ValueError, RuntimeError, MemoryError) as error:
        # Texts are read when they are drawn; the last line of the message says what is wrong with one.
        reason = (str(error).strip() or type(error).__name__).splitlines()
        message = f"matplotlib cannot draw this: {reason[-1]}" + (f" in `{reason[0]}`" if len(reason) > 1 else "")
        raise PlotError(message, fix="put right what stands between $ signs: matplotlib's own TeX") from None


def line(k: int, dash: int | None = None) -> dict[str, Any]:
    """How the k-th line looks; 32 lines look different. dash: which dash it has, if that says something else."""
    chosen = k + k // len(COLOURS) if dash is None else dash
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[chosen % len(DASHES)]}


def unit_text(unit: str) -> str:
    """A unit as it is printed after a quantity, such as `m s$^{-2}$` for `m/s2`; dimensionless is nothing."""
    if unit in ("", "1"):
        return ""
    over, *under = unit.replace("*", ".").split("/")
    parts = [_power(part, 1) for part in over.split(".") if part != "1"]
    return " ".join(parts + [_power(part, -1) for group in under for part in group.split(".")])


def _power(part: str, sign: int) -> str:
    name = part.rstrip("0123456789-^")
    exponent = sign * int(part[len(name) :].strip("^") or 1)
    return name if exponent == 1 else f"{name}$^{{{exponent}}}$"
