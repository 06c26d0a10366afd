"""What a search for violations has found: a table, how each was checked, and a picture of the run that violates."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from html import escape
from pathlib import Path
from typing import Any

from cosim.engine import run as engine
from cosim.engine.run import Run
from cosim.errors import CosimError, PlotError
from cosim.language.formula_tree import Condition, Mention, Number, Operation, Predicate, Term, mentions, parts
from cosim.plot import lines, motion, plane, style
from cosim.plot.lines import Panel
from cosim.plot.motion import PORTS, Motion
from cosim.plot.plane import Plane
from cosim.results.formatting import format_value
from cosim.results.result_file import Result
from cosim.results.text_table import TextTable
from cosim.wiring.network import Network

HEAD = ["requirement", "runs", "verdict", "margin", "unit", "at", "may be off by"]
SAMPLES = 4000
"""Of a picture's run, about: more are not seen."""
BEYOND = 1.5
"""How far a picture goes, of the time at which the requirement is violated most."""


def table(answers: list[dict[str, Any]]) -> TextTable:
    """What is said of each requirement. answers: as of `cosim.study.found`."""
    rows = []
    for answer in answers:
        verdict = answer["verdict"] or "none found"
        margin, error = (_number(answer[key]) for key in ("margin", "error"))
        place = answer["ended"] or answer["at"]
        rows.append([answer["requirement"], str(answer["runs"]), verdict, margin, answer["unit"], place, error])
    return TextTable("What a search for violations has found", HEAD, rows)


def checks(answer: dict[str, Any]) -> TextTable:
    """The same run done otherwise."""
    rows = [[rerun["how"], rerun["ended"] or _number(rerun["margin"])] for rerun in answer["reruns"]]
    title = f"{answer['requirement']}: {answer['verdict']}, as {answer['why']}"
    return TextTable(title, ["the same run", f"margin ({answer['unit']})"], rows)


def figures(answer: dict[str, Any], folder: Path) -> Iterator[str]:
    """Pictures of a violation whose overlay is in a folder, as HTML: what the requirement speaks of, and the ways."""
    overlay, time = folder / Path(answer["overlay"]).name, answer["time"]
    try:
        network = engine.load(overlay)
        with tempfile.TemporaryDirectory() as aside, ExitStack() as stack:
            file = Path(aside) / "run.nc"
            until = BEYOND * time if time else network.diagram.run.stop
            Run(_recording(overlay, network, answer["requirement"], until), output=file, until=until).execute()
            result = stack.enter_context(Result(file))
            stack.enter_context(style.style())
            drawn = Path(aside) / "picture.svg"
            at = f", violated most at {time:g} s" if time is not None else ""
            style.save(_lines(result, network, answer), drawn)
            yield _figure(drawn, f"What {answer['requirement']} speaks of in the run of {overlay.name}{at}.")
            if ways := _ways(result, time):
                style.save(ways, drawn)
                yield _figure(drawn, f"The ways of the same run, and where all are at the begin{at and ' and then'}.")
    except CosimError as error:
        yield f"<p>{escape(f'No picture of {overlay}: {error.message}')}</p>"


def _recording(overlay: Path, network: Network, requirement: str, until: float) -> Network:
    """The run with the requirement's signals, and what moves, recorded closely."""
    run = network.diagram.run
    every = max(1, round(min(until, run.stop) / run.step / SAMPLES))
    names = [node.value for node in network.diagram.requirements[requirement].signals.values()]
    ports = [str(signal) for signal in network.recorded if signal.variable in PORTS.values()]
    wanted = list(dict.fromkeys(str(name).partition("[")[0].strip() for name in (*names, *ports)))
    return engine.load(overlay, [f"record={{period: {every * run.step!r}, signals: {wanted}}}"])


def _lines(result: Result, network: Network, answer: dict[str, Any]) -> Any:
    """The signals of a requirement, each with the bounds that it has in the formula."""
    entry = network.diagram.requirements[answer["requirement"]]
    panels: dict[str, Panel] = {}
    for mention in mentions(entry.condition):
        text = str(entry.signals[mention.signal].value)
        if mention.index and "[" not in text:
            text += f"[{', '.join(map(str, mention.index))}]"
        panels.setdefault(text, Panel([text], thresholds={f"{b:g}": b for b in _bounds(entry.condition, mention)}))
    marked = lines.draw({answer["requirement"]: result}, list(panels.values()))
    if answer["time"] is not None:
        for axis in marked.axes:
            axis.axvline(answer["time"], color=lines.GREY, linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1)
    return marked


def _bounds(tree: Term | Condition, mention: Mention) -> Iterator[float]:
    """The numbers that a signal alone, or its absolute value, is compared with."""
    match tree:
        case Predicate(left=Number(value=bound), right=term) | Predicate(left=term, right=Number(value=bound)):
            sides: tuple[float, ...] = (bound,)
            if isinstance(term, Operation) and term.name == "abs":
                term, sides = term.arguments[0], (bound, -bound)
            if isinstance(term, Mention) and (term.signal, term.index) == (mention.signal, mention.index):
                yield from sides
    for part in parts(tree):
        yield from _bounds(part, mention)


def _ways(result: Result, time: float | None) -> Any:
    """A picture of bodies that move in the plane; None where nothing does."""
    try:
        found = motion.find(result, Motion())
        at = (0.0,) if time is None else (0.0, time)
        shown = Plane(found.positions or "", found.references or "", found.radii or "", at)
        return plane.draw(result, shown)
    except PlotError:
        return None


def _figure(file: Path, caption: str) -> str:
    data = base64.b64encode(file.read_bytes()).decode()
    image = f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(caption, quote=True)}">'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _number(value: float | None) -> str:
    return "—" if value is None else format_value(value)
