"""The figures that a study describes, read from YAML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.errors import PlotError, Position, Problems, UnknownKey, WrongType, WrongValue
from cosim.language import grammar
from cosim.language.keys import (
    ANIMATION,
    ANY,
    ANYTHING,
    NUMBER,
    POSITIVE,
    SIGNAL,
    TEXT,
    TRUTH,
    Key,
    choice,
    count,
    read_value,
)
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.plot import lines, plane, style
from cosim.plot.distribution import Distribution
from cosim.plot.lines import Panel
from cosim.plot.motion import Motion
from cosim.plot.plane import Plane
from cosim.results.result_file import Result

HEIGHTS = 0.5, 20.0
"""Inches of one panel: below, its labels do not fit; beyond, it fits no screen and no page."""
_THRESHOLDS = Key("lines to compare with, by their words", below={ANY: Key("", NUMBER)})
_KEYS = {
    "lines": {
        "members": Key("which runs it shows", ANYTHING),
        "columns": Key("panels side by side", count()),
        "height": Key("of one panel", POSITIVE, unit="in"),
        "panels": Key("a list of panels", ANYTHING),
    },
    "plane": {
        "members": Key("which runs it shows", ANYTHING),
        "positions": Key("whose positions are drawn, block.port", ANYTHING),
        "references": Key("what they follow, block.port", ANYTHING),
        "radii": Key("of safe distances around them", ANYTHING),
        "at": Key("the times at which they are marked", ANYTHING, unit="s"),
    },
    "animation": {
        "members": Key("which run it shows", ANYTHING),
        **{part: Key(f"{key.help}; none: as the diagram says", SIGNAL) for part, key in ANIMATION.items()},
    },
    "distribution": {
        "metric": Key("what is distributed", ANYTHING),
        "label": Key("of its axis", TEXT),
        "limits": Key("of its axis, [least, most]", ANYTHING),
        "thresholds": _THRESHOLDS,
    },
}
"""What each kind of figure takes, beside what all take."""
FIGURE: dict[str, Key] = {
    "kind": Key("of figure", choice(_KEYS)),
    "caption": Key("what stands below it", TEXT),
    **{name: key for keys in reversed(_KEYS.values()) for name, key in keys.items()},
}
PANEL: dict[str, Key] = {
    "signals": Key("what is drawn, block.port each", ANYTHING),
    "label": Key("of the vertical axis", TEXT),
    "title": Key("of the panel", TEXT),
    "over": Key("the signal on the horizontal axis; none: time", TEXT),
    "over_label": Key("of the horizontal axis", TEXT),
    "names": Key("of the lines", ANYTHING),
    "log": Key("whether the vertical axis is logarithmic", TRUTH),
    "derivative": Key("whether derivatives are drawn", TRUTH),
    "limits": Key("of the vertical axis, [least, most]", ANYTHING),
    "span": Key("of the horizontal axis, [first, last]", ANYTHING),
    "window": Key("the times that are drawn, [first, last]", ANYTHING, unit="s"),
    "thresholds": _THRESHOLDS,
}


@dataclass
class Figure:
    """A figure of a study. members: the runs that it shows, all if none is named. position: where it is described."""

    name: str
    position: Position
    caption: str = ""
    members: Sequence[str] = ()
    columns: int = 1
    height: float = 1.75
    panels: list[Panel] = field(default_factory=list)
    plane: Plane | None = None
    distribution: Distribution | None = None
    motion: Motion | None = None

    def signals(self) -> list[str]:
        """The names of the signals that it shows, without the elements of them that it takes."""
        shown = [text for panel in self.panels for text in (*panel.signals, panel.over)]
        shown += [self.plane.positions, self.plane.references, self.plane.radii] if self.plane else []
        shown += self.motion.signals.values() if self.motion else []
        return list(dict.fromkeys(text.partition("[")[0].strip() for text in shown if text))

    def draw(self, files: Mapping[str, Path], output: Path) -> None:
        """Draw it from the members' result files; what moves is no picture. Raises: PlotError, ResultError."""
        chosen = self._chosen(files)
        with ExitStack() as stack:
            runs = {name: stack.enter_context(Result(files[name])) for name in chosen}
            stack.enter_context(style.style())
            if self.plane:
                made = plane.draw(next(iter(runs.values())), self.plane)
            else:
                made = lines.draw(runs, self.panels, self.columns, self.height)
            style.save(made, output)

    def moving(self, files: Mapping[str, Path]) -> tuple[Path, Motion]:
        """The result file and the signals of one that moves. Raises: PlotError."""
        assert self.motion
        return files[self._chosen(files)[0]], self.motion

    def _chosen(self, files: Mapping[str, Path]) -> list[str]:
        """The members that it shows. Raises: PlotError where one has no recorded signals."""
        chosen = self.members or list(files)
        missing = [name for name in chosen if name not in files]
        if missing:
            raise PlotError(f"member `{missing[0]}` has no recorded signals", fix="see in the summary why it failed")
        if not chosen:
            raise PlotError("no member has recorded signals", fix="see in the summary why they failed")
        return list(chosen)


def read(figures: Mapping[str, Node], problems: Problems) -> list[Figure]:
    """The figures of a study; every mistake goes to `problems`."""
    reader = Reader(problems)
    return [
        _figure(name, grammar.conform(node, problems, FIGURE, f"figures.{name}"), reader)
        for name, node in figures.items()
    ]


def _figure(name: str, node: Node, reader: Reader) -> Figure:
    entries, where = node.value, f"figures.{name}"
    figure = Figure(name, node.place)
    if "caption" in entries:
        figure.caption = read_value(FIGURE["caption"], entries["caption"], f"{where}.caption", reader) or ""
    figure.members = _texts(entries.get("members"), f"{where}.members", reader)
    kind = (
        read_value(FIGURE["kind"], entries["kind"], f"{where}.kind", reader) if "kind" in entries else next(iter(_KEYS))
    )
    _refuse_foreign(entries, kind, where, reader)
    if "height" in entries:
        figure.height = _height(entries["height"], f"{where}.height", reader)
    if kind == "plane":
        figure.plane = _plane(node, figure.members, where, reader)
        return figure
    if kind == "animation":
        figure.motion = _motion(entries, figure.members, where, reader)
        return figure
    if kind == "distribution":
        if "metric" not in entries:
            reader.missing(node, f"`{where}` has no `metric`", "write metric: min_gap")
        figure.distribution = _distribution(entries, where, reader)
        return figure
    panels = entries["panels"].value if "panels" in entries else []
    if not isinstance(panels, list) or not panels:
        reader.wrong(node, f"`{where}` has no panels", "write panels: [{signals: [plant.x]}]", WrongType)
        return figure
    figure.panels = [_panel(f"{where}.panels[{k}]", panel, reader) for k, panel in enumerate(panels)]
    if "columns" in entries:
        figure.columns = read_value(FIGURE["columns"], entries["columns"], f"{where}.columns", reader)
        if figure.columns > len(panels):
            message = f"`{where}` has {figure.columns} columns for {len(panels)} panel{'s' if len(panels) > 1 else ''}"
            reader.wrong(entries["columns"], message, f"at most {len(panels)}", WrongValue)
    return figure


def _plane(node: Node, members: list[str], where: str, reader: Reader) -> Plane:
    entries = node.value
    texts = {k: reader.text(entries[k], f"{where}.{k}") for k in ("positions", "references", "radii") if k in entries}
    if not texts.get("positions"):
        reader.missing(node, f"`{where}` has no `positions`", "write positions: plant.x")
    at = _numbers(entries.get("at"), f"{where}.at", reader)
    if "at" in entries and entries["at"].value == []:
        reader.wrong(entries["at"], f"`{where}.at` is empty", "name times, such as [0, 10]", WrongValue)
    _refuse_several(entries, members, where, reader)
    return Plane(at=at, places=_places(entries), **{"positions": "", **texts})


def _motion(entries: Mapping[str, Node], members: Sequence[str], where: str, reader: Reader) -> Motion:
    _refuse_several(entries, members, where, reader)
    given = {part: entries[part] for part in ANIMATION if part in entries}
    read = {part: read_value(ANIMATION[part], node, f"{where}.{part}", reader) for part, node in given.items()}
    named: dict[str, Any] = {part: str(node.value) for part, node in read.items() if node}
    return Motion(**named)


def _refuse_several(entries: Mapping[str, Node], members: Sequence[str], where: str, reader: Reader) -> None:
    """Report more than one run where only one can be shown."""
    if len(members) > 1:
        message = f"`{where}` shows bodies of one run, not of {len(members)}"
        reader.wrong(entries["members"], message, f"write members: {members[0]}", WrongValue)


def _refuse_foreign(entries: Mapping[str, Node], kind: str, where: str, reader: Reader) -> None:
    """Report what only figures of another kind take."""
    for key in entries:
        if key in ("kind", "caption", *_KEYS[kind]):
            continue
        other = next(name for name, keys in _KEYS.items() if key in keys)
        in_panel = kind == "lines" and key in PANEL
        fix = f"write it in a panel: panels: [{{{key}: …}}]" if in_panel else f"it goes with `kind: {other}`"
        message = f"`{where}` has no key `{key}`, as its kind is {kind}"
        reader.problems.add(UnknownKey(message, entries[key].place, fix))


def _height(node: Node, where: str, reader: Reader) -> float:
    value, (least, most) = reader.positive(node, where), HEIGHTS
    if not least <= value <= most:
        message = f"`{where}` cannot be {value:g} inches"
        reader.wrong(node, message, f"{least:g} to {most:g}, for one panel", WrongValue)
    return value


def _places(entries: Mapping[str, Node]) -> dict[str, Position]:
    return {key: node.position for key, node in entries.items()}


def _distribution(entries: dict[str, Node], where: str, reader: Reader) -> Distribution:
    metric, label = (reader.text(entries[k], f"{where}.{k}") if k in entries else "" for k in ("metric", "label"))
    found = Distribution(metric, label)
    found.limits = _range(entries.get("limits"), f"{where}.limits", reader)
    found.thresholds = _thresholds(entries, where, reader)
    return found


def _thresholds(entries: dict[str, Node], where: str, reader: Reader) -> dict[str, float]:
    named = entries["thresholds"].value if "thresholds" in entries else {}
    return {name: reader.number(node, f"{where}.thresholds.{name}") for name, node in named.items()}


def _panel(where: str, node: Node, reader: Reader) -> Panel:
    entries = grammar.conform(node, reader.problems, PANEL, where).value
    panel = Panel(_texts(entries.get("signals"), f"{where}.signals", reader))
    if "signals" not in entries:
        reader.missing(node, f"`{where}` has no `signals`", "write signals: plant.x")
    for key in ("label", "title", "over", "over_label"):
        if key in entries:
            setattr(panel, key, read_value(PANEL[key], entries[key], f"{where}.{key}", reader) or "")
    for key in ("log", "derivative"):
        if key in entries:
            setattr(panel, key, read_value(PANEL[key], entries[key], f"{where}.{key}", reader))
    panel.names = _texts(entries.get("names"), f"{where}.names", reader)
    for key in ("limits", "span", "window"):
        setattr(panel, key, _range(entries.get(key), f"{where}.{key}", reader))
    panel.thresholds = _thresholds(entries, where, reader)
    panel.places = _places(entries)
    if panel.over_label and not panel.over:
        message = f"`{where}` has a label for what it is drawn over, which is not said"
        reader.wrong(entries["over_label"], message, "write over: plant.x, or remove `over_label`", WrongValue)
    if panel.log and panel.limits and panel.limits[0] <= 0:
        message = f"`{where}`: a logarithmic axis does not reach {panel.limits[0]:g}"
        reader.wrong(entries["limits"], message, "begin above zero, or remove `log: true`", WrongValue)
    return panel


def _texts(node: Node | None, where: str, reader: Reader) -> list[str]:
    items = [] if node is None else node.value if isinstance(node.value, list) else [node]
    return [reader.text(item, where) for item in items]


def _numbers(node: Node | None, where: str, reader: Reader) -> list[float]:
    if node is None:
        return []
    if not isinstance(node.value, list):
        reader.wrong(node, f"`{where}` takes a list of numbers, not {describe(node)}", "such as [0, 10]")
        return []
    return [reader.number(item, where) for item in node.value]


def _range(node: Node | None, where: str, reader: Reader) -> tuple[float, float] | None:
    """The two ends of an axis, the lower one first."""
    before = len(reader.problems.errors)
    pair = _numbers(node, where, reader)
    if node is None or len(reader.problems.errors) > before:
        return None
    if len(pair) != 2:
        reader.wrong(node, f"`{where}` takes two numbers, not {describe(node)}", "such as [0, 10]", WrongValue)
        return None
    if not pair[0] < pair[1]:
        message = f"`{where}`: from {pair[0]:g} to {pair[1]:g} there is nothing"
        reader.wrong(node, message, "write the lower end first, and then a higher one", WrongValue)
        return None
    return pair[0], pair[1]
