"""A diagram as YAML says it: read, checked against the grammar, with the diagrams inside it unfolded.

What blocks, ports and parameters mean is not known here: that is the wiring's concern.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from cosim.errors import (
    CosimError,
    DiagramErrors,
    MetricError,
    Position,
    Problems,
    WrongFile,
    WrongType,
    WrongValue,
)
from cosim.language import grammar, source
from cosim.language.embedding import Unfolded, unfold
from cosim.language.entry import BlockEntry, type_in_full
from cosim.language.keys import (
    ANIMATION,
    DIAGRAM,
    METRIC,
    METRIC_OPTIONS,
    RECORD,
    REDUCTIONS,
    RUN,
    read_named,
    read_section,
    read_value,
)
from cosim.language.overlay import Change, apply_settings, apply_swaps, layered, read_layers
from cosim.language.reader import Reader
from cosim.language.requirement import RequirementEntry, read_requirements
from cosim.language.run_settings import RunSettings, check_clocks, check_integration, is_multiple, read_run
from cosim.language.source import Node, describe
from cosim.language.swaps import Swap

__all__ = ["BlockEntry", "Diagram", "MetricEntry", "Record", "RunSettings", "load"]


@dataclass
class Record:
    """Which signals (`block.port`) are recorded, and how often (s); position: where that is said."""

    period: float
    signals: list[Node]
    position: Position


@dataclass
class MetricEntry:
    """A reduction of a signal (`block.port`) over the window from `start` to `stop` (s); options: of METRIC_OPTIONS."""

    name: str
    signal: Node
    reduce: str
    start: float
    stop: float
    position: Position
    options: dict[str, float] = field(default_factory=dict)

    def plain(self) -> dict[str, Any]:
        """The entry without places, as YAML has it."""
        window = {"from": self.start, "to": self.stop}
        finite = {key: value for key, value in window.items() if math.isfinite(value)}
        return {"signal": self.signal.value, "reduce": self.reduce, **finite, **self.options}


@dataclass
class Diagram:
    """A whole diagram, diagrams inside it unfolded (their blocks are called `outer/inner`).

    inputs: the ports that each input of the diagram drives where it is a block of another; outputs: the port that each
    output shows. files: all that were read, the diagram's own first. unread: the blocks that mistakes keep from being
    understood, so that a wire to one is no further mistake. swaps: of blocks that are diagrams.
    extended: the files that it extends. animation: the signals that are shown moving, by the part that they play.
    """

    title: str
    path: Path
    files: list[Path]
    run: RunSettings
    fleets: dict[str, int]
    blocks: dict[str, BlockEntry]
    record: Record | None
    metrics: dict[str, MetricEntry]
    inputs: dict[str, list[Node]]
    outputs: dict[str, Node]
    unread: set[str]
    swaps: list[Swap]
    extended: list[Path] = field(default_factory=list)
    animation: dict[str, Node] = field(default_factory=dict)
    requirements: dict[str, RequirementEntry] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, str]:
        """How each figure of a run is made: metrics by their reduction, and the margins of requirements."""
        metrics = {name: metric.reduce for name, metric in self.metrics.items()}
        return {**metrics, **dict.fromkeys(self.requirements, "margin")}

    def resolved(self) -> str:
        """YAML text of the whole diagram: written to a file in the same folder, it loads to the same diagram."""
        sections: dict[str, Any] = {
            "title": self.title,
            "run": {key: value for key in RUN if (value := getattr(self.run, key)) is not None},
            "fleets": self.fleets,
            "blocks": {name: entry.plain(self.path.parent) for name, entry in self.blocks.items()},
            "metrics": {name: metric.plain() for name, metric in self.metrics.items()},
            "requirements": {name: entry.plain() for name, entry in self.requirements.items()},
            "inputs": {name: [node.value for node in nodes] for name, nodes in self.inputs.items()},
            "animation": {part: node.value for part, node in self.animation.items()},
            "outputs": {name: node.value for name, node in self.outputs.items()},
        }
        if self.record:
            sections["record"] = {"period": self.record.period, "signals": [n.value for n in self.record.signals]}
        return source.dump({key: value for key, value in sections.items() if value})


def load(
    path: str | Path, settings: Iterable[str] = (), swaps: Iterable[str] = (), problems: Problems | None = None
) -> Diagram:
    """Read a diagram; `settings` as of --set, `swaps` as of --swap.

    With `problems`, mistakes are collected there, and the diagram is returned as far as it can be understood.
    Raises: DiagramErrors with all mistakes; with `problems`, only if the file or one that it extends cannot be read.
    """
    found = Problems() if problems is None else problems
    diagram = build(*read(Path(path), settings, swaps, found), found)
    if problems is None:
        note_inherited(diagram, found)
        found.raise_if_any()
    return diagram


def read(
    path: Path,
    settings: Iterable[str | Change],
    swaps: Iterable[str],
    problems: Problems,
    written: Callable[[], Node] | None = None,
) -> tuple[Node, list[Path]]:
    """The tree of a diagram with all its layers merged, and the files that it was read from; as of `load`.

    written: gives what stands at `path`, where that is no file.
    """
    try:
        tree, files = layered(written, path, problems) if written else read_layers(path, problems)
    except CosimError as error:
        problems.add(error)
        raise DiagramErrors(problems.errors) from None
    if is_study(tree):
        message = f"`{path}` is a study, not a diagram"
        place = tree.value["diagram"].place
        raise DiagramErrors([WrongFile(message, place, f"cosim study {path}; its diagram is `{_named(tree, files)}`")])
    return apply_settings(apply_swaps(tree, swaps, problems), settings, problems), files


def is_study(tree: Node) -> bool:
    """Whether a file is a study: it names the diagram that a diagram would be."""
    return "diagram" in tree.value and "blocks" not in tree.value


def _named(tree: Node, files: list[Path]) -> Path:
    """The file that a study names as its diagram."""
    return Path(os.path.normpath(files[0].parent / str(tree.value["diagram"].value)))


def note_inherited(diagram: Diagram, problems: Problems) -> None:
    """Let each mistake say so that lies in what the diagram, or a block of another type, only inherits."""
    from_other_type = {
        place: entry
        for entry in diagram.blocks.values()
        if entry.type.replaces
        for section in ("parameters", "start", "inputs", "dimensions")
        for node in getattr(entry, section).values()
        if node.inherited
        for place in _places(node)
    }
    extended = {str(path) for path in diagram.extended}
    for error in problems.errors:
        if error.position in from_other_type and isinstance(error.position, Position):
            entry = from_other_type[error.position]
            assert entry.type.replaces
            said = f"inherited: written at {error.position} for {type_in_full(*entry.type.replaces)}"
        elif error.position and error.position.file in extended and error.position.line:
            said = f"inherited: {diagram.path} extends {error.position.file}"
        else:
            continue
        if said not in error.message:
            error.message += f" ({said})"
            error.args = (error.message,)


def _places(node: Node) -> Iterator[Position]:
    yield from (node.position, node.place)
    for child in node.value if isinstance(node.value, list) else ():
        yield from _places(child)


def build(tree: Node, files: list[Path], problems: Problems) -> Diagram:
    """The diagram of a tree whose layers are merged; mistakes go to `problems`. files: those it was read from."""
    reader = Reader(problems)
    tree = grammar.conform(tree, problems)
    path, extended = files[0], files[1:]
    unfolded = unfold(tree, path, files, reader)
    sections = {key: node.value for key, node in tree.value.items()}
    run = read_run(tree, reader)
    check_integration(run, unfolded.blocks.values(), reader)
    check_clocks(run, unfolded.blocks.values(), reader)
    fleets = _fleets(sections.get("fleets", {}), unfolded, reader)
    titled = tree.value.get("title")
    title = read_value(DIAGRAM["title"], titled, "title", reader) if titled else source.title_of(path)
    record = _record(tree.value["record"], unfolded, run, reader) if "record" in tree.value else None
    metrics = {name: _metric(name, node, unfolded, reader) for name, node in sections.get("metrics", {}).items()}
    known = {name: metric for name, metric in metrics.items() if metric}
    shown = read_section(ANIMATION, sections.get("animation", {}), "animation", reader)
    rewired = partial(unfolded.rewired, problems=problems)
    moving = {part: rewired(node) for part, node in shown.items() if node}
    required = read_requirements(sections.get("requirements", {}), metrics.keys(), rewired, reader)
    blocks, inputs, outputs, unread = unfolded.blocks, unfolded.inputs, unfolded.outputs, unfolded.unread
    swaps, name = unfolded.swaps, title or ""
    return Diagram(
        name,
        path,
        files,
        run,
        fleets,
        blocks,
        record,
        known,
        inputs,
        outputs,
        unread,
        swaps,
        extended,
        moving,
        required,
    )


def _fleets(given: dict[str, Node], unfolded: Unfolded, reader: Reader) -> dict[str, int]:
    """The size of each fleet; the blocks of one whose size is a mistake cannot be understood."""
    fleets = {name: node.value for name, node in read_named(DIAGRAM["fleets"], given, "fleets", reader).items()}
    wrong = given.keys() - fleets.keys()
    mapped = [entry for entry in unfolded.blocks.values() if "per" in entry.settings]
    unfolded.unread |= {entry.name for entry in mapped if entry.settings["per"].value in wrong}
    return fleets


def _record(node: Node, unfolded: Unfolded, run: RunSettings, reader: Reader) -> Record:
    """What is recorded; each step, if no period is given."""
    period, place = run.step, node.place
    if "period" in node.value:
        place = node.value["period"].position
        period = read_value(RECORD["period"], node.value["period"], "record.period", reader)
        is_multiple(node.value["period"], "record.period", period, run.step, reader)
    signals = node.value.get("signals") or Node([], node.position)
    if not isinstance(signals.value, list):
        message = f"`record.signals` must be a list, not {describe(signals)}"
        reader.wrong(signals, message, "such as signals: [plant.x]", WrongType)
        return Record(period, [], place)
    named = reader.endpoints(signals, "record.signals")
    first: dict[str, Node] = {}
    for said in named:
        if first.setdefault(said.value, said) is not said:
            reader.wrong(said, f"`{said.value}` is recorded twice", "write it once", WrongValue)
    known = [unfolded.rewired(n, reader.problems) for n in named]
    return Record(period, known, place)


def _metric(name: str, node: Node, unfolded: Unfolded, reader: Reader) -> MetricEntry | None:
    """One metric; None if it has no signal or no reduction."""
    entries, where = node.value, f"metrics.{name}"
    missing = [key for key in ("signal", "reduce") if key not in entries]
    for key in missing:
        fix = "write signal: block.port" if key == "signal" else f"one of: {', '.join(REDUCTIONS)}"
        reader.missing(node, f"metric `{name}` has no `{key}`", fix)
    if missing or read_value(METRIC["signal"], entries["signal"], f"{where}.signal", reader) is None:
        return None
    rest = {key: spec for key, spec in METRIC.items() if key not in ("signal", *METRIC_OPTIONS)}
    reduce, start, stop = read_section(rest, entries, where, reader).values()
    if not start <= stop:
        message = f"metric `{name}`: its window ends at {stop:g} s, before it begins at {start:g} s"
        reader.wrong(entries["to"], message, "exchange `from` and `to`", MetricError)
        stop = math.inf
    if start < 0:
        message = f"metric `{name}`: its window begins at {start:g} s, before the run does"
        reader.wrong(entries["from"], message, "such as 0, or leave `from` out", MetricError)
    signal = unfolded.rewired(entries["signal"], reader.problems)
    own = {key: METRIC[key] for key in METRIC_OPTIONS if key in entries}
    options = {key: value for key, value in read_section(own, entries, where, reader).items() if value is not None}
    return MetricEntry(name, signal, reduce, start, stop, node.place, options)
