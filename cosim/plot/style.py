"""One style for all pictures, as a journal prints them: serif, thin frames, lines that differ also in grey."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.errors import PlotError
from cosim.machine import files

FORMATS = ("png", "svg", "pdf")
WIDTH = 7.16
"""Inches across two columns of a journal's page."""
COLUMN = 3.5
MARK = "drawn by cosim"
"""What every picture says of itself, so that none takes the place of somebody else's."""
MARKED = 1 << 16
"""Bytes at a file's beginning and end in which it says so."""
BEGINNINGS = (b"\x89PNG", b"<?xml", b"%PDF", b"GIF8", b"\0\0\0")
# Colours that colour-blind readers tell apart, from dark to light, so that grey print keeps them apart too.
COLOURS = ("#000000", "#c1440e", "#4393d0", "#e0a100", "#6a4c93", "#5a9e6f", "#8c8c8c", "#d08fb0")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1, 1.2)))
SETTINGS: Any = {
    "font.family": ["STIXGeneral", "DejaVu Serif", "DejaVu Sans"],  # what one has not, the next has
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
    "agg.path.chunksize": 20_000,
    "svg.fonttype": "path",
    "svg.hashsalt": "cosim",
    "pdf.fonttype": 42,
}


@contextmanager
def style() -> Iterator[None]:
    """Draw and save in this style. Raises: PlotError if matplotlib is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise PlotError("matplotlib is not installed", fix="pip install matplotlib pillow") from None
    with matplotlib.rc_context(SETTINGS):
        yield


def subplots(rows: int, columns: int, size: tuple[float, float], **more: Any) -> tuple[Any, Any]:
    """A new figure of so many inches, and its axes (rows, columns).

    pyplot has no part in it: it would keep the figure, and choose a window's toolkit.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    figure = Sheet(figsize=size)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **more)


def save(made: Any, output: Path) -> None:
    """Write a figure as PNG, SVG or PDF, by the name's ending, in the place of a picture of ours and of nothing else.

    Raises: PlotError, ResultError.
    """
    kind = kind_of(output, FORMATS, "pictures")
    files.refuse_foreign(output, "a picture of this program", is_ours)
    about: dict[str, Any] = {"Software": MARK} if kind == "png" else {"Creator": MARK}
    about |= {"Date": None} if kind == "svg" else {"CreationDate": None} if kind == "pdf" else {}
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(output) as new, style():
            made.savefig(new, format=kind, metadata=about)
    except OSError as error:
        raise cannot_write(output, error) from None
    except (ValueError, RuntimeError, MemoryError) as error:
        # Texts are read when they are drawn; the last line of the message says what is wrong with one.
        reason = (str(error).strip() or type(error).__name__).splitlines()
        message = f"matplotlib cannot draw this: {reason[-1]}" + (f" in `{reason[0]}`" if len(reason) > 1 else "")
        raise PlotError(message, fix="put right what stands between $ signs: matplotlib's own TeX") from None


def kind_of(output: Path, kinds: Sequence[str], what: str) -> str:
    """The kind of file that a name's ending says. Raises: PlotError for another one."""
    kind = output.suffix.lower().lstrip(".")
    if kind not in kinds:
        raise PlotError(
            f"`{output}`: {what} are {', '.join(kinds)}", fix=f"such as -o {output.with_suffix('')}.{kinds[0]}"
        )
    return kind


def cannot_write(output: Path, error: OSError) -> PlotError:
    """What to raise where a file cannot be written."""
    return PlotError(f"cannot write {output}: {error.strerror or error}", fix=files.usual_fix(error))


def is_ours(path: Path) -> bool:
    """Whether a file is a picture, or a film, that this program made: all of them say so at their beginning or end."""
    with path.open("rb") as file:
        head = file.read(MARKED)
        file.seek(max(path.stat().st_size - MARKED, 0))
        return head.startswith(BEGINNINGS) and MARK.encode() in head + file.read(MARKED)


def plain(text: str) -> str:
    """A name as it stands, in which no dollar sign begins a formula."""
    return text.replace("$", r"\$")


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
