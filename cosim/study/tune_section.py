"""Reads the section `tune` of a study: what is free, what is to become small, and what has to hold meanwhile."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cosim.errors import ExpressionError, MissingKey, WrongValue
from cosim.language import expression, grammar
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node
from cosim.study.definition import Bounds, Random, Tuning
from cosim.study.study_keys import BOUNDS, TUNE


def read(node: Node, space: Random | None, reader: Reader) -> Tuning | None:
    """The tuning; None where it does not say what is free, or what for. space: what is free, as of one draw."""
    entries = node.value
    if "minimise" not in entries:
        reader.problems.add(MissingKey("`tune` has no `minimise`", node.place, "name a metric, such as minimise: e_x"))
    if space is None or "minimise" not in entries or not is_bounded(space, "tune", reader):
        return None
    objective = entries["minimise"]
    if not reader.text(objective, "tune.minimise"):
        return None
    if not expression.names(objective.value):
        message = f"`tune.minimise` names no metric: {objective.value}"
        reader.problems.add(ExpressionError(message, objective.position, "such as e_x + 0.01*u_max"))
        return None
    given = {key: read_value(TUNE[key], entries[key], f"tune.{key}", reader) for key in _PLAIN if key in entries}
    values = {key: given.get(key, TUNE[key].default) for key in _PLAIN}
    return Tuning(space, objective, _bounds(entries, reader), **values, node=node)


def is_bounded(space: Random, section: str, reader: Reader) -> bool:
    """Whether all that is free is so between two bounds, else a report."""
    for draw in space.draws:
        if draw.normal or not np.all(draw.a < draw.b):
            message = f"`{section}.over.{','.join(draw.paths)}` is free between two bounds"
            reader.problems.add(WrongValue(message, draw.node.place, "write {uniform: [least, most]}"))
            return False
    return True


_PLAIN = ("conditions", "accuracy", "held_out", "runs")


def _bounds(entries: Mapping[str, Node], reader: Reader) -> tuple[Bounds, ...]:
    found = []
    for name, node in entries["subject"].value.items() if "subject" in entries else ():
        where = f"tune.subject.{name}"
        own = grammar.conform(node, reader.problems, BOUNDS, where).value
        least, most = (read_value(key, own[k], where, reader) if k in own else key.default for k, key in BOUNDS.items())
        if not own or least > most:
            reader.wrong(node, f"`{where}` keeps nothing within bounds", "write {least: 0.1} or {most: 1}", WrongValue)
        found.append(Bounds(name, least, most, node))
    return tuple(found)
