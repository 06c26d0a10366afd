"""Reads the section `until` of a study: which probabilities it draws for until they are known."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.errors import MissingKey, WrongValue
from cosim.language import grammar
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node
from cosim.study.definition import Random, Sought
from cosim.study.study_keys import UNTIL


def read(entries: Mapping[str, Node], random: Random | None, reader: Reader) -> tuple[Sought, ...]:
    """What is to be known, but for what cannot be read."""
    found = tuple(one for name, node in entries.items() if (one := _until(name, node, reader)))
    if found and random is None:
        fix = "write random: {count: 10000, draws: …}; count is how many at most"
        reader.problems.add(MissingKey("`until` needs draws, and the study has none", found[0].node.place, fix))
    elif found and random and random.method != "random":
        message = f"draws of `method: {random.method}` are no independent trials, by which `until` knows a probability"
        reader.problems.add(WrongValue(message, found[0].node.place, "method: random"))
    return found


def _until(name: str, node: Node, reader: Reader) -> Sought | None:
    where = f"until.{name}"
    said = grammar.conform(node, reader.problems, UNTIL, where).value
    if "probability" not in said:
        reader.problems.add(MissingKey(f"`{where}` has no `probability`", node.place, "such as probability: 0.01"))
        return None
    values = {
        key: read_value(known, said[key], f"{where}.{key}", reader) if key in said else known.default
        for key, known in UNTIL.items()
    }
    if not 0.0 < (values["probability"] or 0.0) < 1.0 or not (values["confidence"] or 1.0) < 1.0:
        message = f"`{where}`: no number of draws shows a probability of 0 or 1, nor anything with certainty"
        reader.problems.add(WrongValue(message, node.place, "such as {probability: 0.01, confidence: 0.99}"))
        return None
    return Sought(name, values["above"], values["below"], values["probability"], values["confidence"], node)
