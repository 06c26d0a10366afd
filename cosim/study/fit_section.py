"""Reads the section `fit` of a study: what is free, and which signals have been measured."""

from __future__ import annotations

import re

from cosim.errors import MissingKey, UnknownPort, WrongValue
from cosim.language import grammar
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node
from cosim.study import tune_section
from cosim.study.definition import Fit, Measured, Random
from cosim.study.study_keys import FIT, MEASURED

_SIGNAL = re.compile(r"(?P<name>[^\[\]]+\.[^\[\]]+?)\s*(\[\s*(?P<index>\d+(\s*,\s*\d+)*)\s*\])?")


def read(node: Node, space: Random | None, reader: Reader) -> Fit | None:
    """The fit; None where it does not say what is free, or what is measured. space: what is free, as of one draw."""
    entries = node.value
    for key, example in (("data", "measured.csv"), ("signals", "{plant.x: {column: x}}")):
        if key not in entries:
            reader.problems.add(MissingKey(f"`fit` has no `{key}`", node.place, f"write {key}: {example}"))
            return None
    if space is None or not tune_section.is_bounded(space, "fit", reader):
        return None
    if not entries["signals"].value:
        reader.wrong(entries["signals"], "`fit.signals` is empty", "such as {plant.x: {column: x}}")
    found = [_measured(name, n, reader) for name, n in entries["signals"].value.items()]
    measured = tuple(one for one in found if one)
    known = [one.deviation is not None for one in measured]
    if any(known) and not all(known):
        other = measured[known.index(False)]
        message = f"`fit.signals.{other.label}` has no `deviation`, which others have"
        reader.problems.add(MissingKey(message, other.node.place, "give it for all, or for none"))
    time = entries.get("time", Node(FIT["time"].default, entries["data"].position))
    starts, runs = (
        read_value(FIT[key], entries[key], f"fit.{key}", reader) if key in entries else FIT[key].default
        for key in ("starts", "runs")
    )
    texts = [reader.text(entries["data"], "fit.data"), reader.text(time, "fit.time")]
    return Fit(space, entries["data"], time, measured, starts, runs, node) if all(texts) else None


def _measured(name: str, node: Node, reader: Reader) -> Measured | None:
    where = f"fit.signals.{name}"
    said = _SIGNAL.fullmatch(name.strip())
    if not said:
        message = f"`{name}` names no signal, nor an element of one"
        reader.problems.add(UnknownPort(message, node.place, "such as plant.x, or plant.x[1] for its first element"))
        return None
    entries = grammar.conform(node, reader.problems, MEASURED, where).value
    if "column" not in entries:
        reader.problems.add(MissingKey(f"`{where}` has no `column`", node.place, "name a column of the data"))
        return None
    values = {k: read_value(key, entries[k], where, reader) if k in entries else None for k, key in MEASURED.items()}
    if "nominal" in entries and "deviation" in entries:
        message = f"`{where}` has a nominal value beside its deviation, which would not count"
        reader.problems.add(WrongValue(message, entries["nominal"].place, "remove it"))
    index = tuple(int(number) for number in (said["index"] or "").split(",") if number)
    nominal = values["nominal"] or MEASURED["nominal"].default
    return Measured(said["name"], index, entries["column"], values["unit"], values["deviation"], nominal, node)
