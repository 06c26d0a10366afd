"""Reads the section `random` of a study: how many draws, of what, and which of them count."""

from __future__ import annotations

import numpy as np

from cosim.errors import MissingKey, WrongValue
from cosim.language import grammar
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.study.definition import Bounds, Draw, Random
from cosim.study.dotted_paths import paths
from cosim.study.study_keys import BOUNDS, RANDOM

MOST_DEVIATIONS = 10  # that a normal draw may be away from its mean


def read(node: Node, reader: Reader, section: str = "random", drawn: str = "draws") -> Random | None:
    """The draws; None where it says not how many, or of what. section, drawn: what they are called there."""
    entries = node.value
    for key in ("count", "draws"):
        if key not in entries:
            reader.problems.add(
                MissingKey(
                    f"`random` has no `{key}`", node.place, f"write random: {{count: {RANDOM['count'].example}, …}}"
                )
            )
            return None
    seed = _seed(entries["seed"], f"{section}.seed", reader) if "seed" in entries else 0
    draws = [_draw(path, n, reader, f"{section}.{drawn}.{path}") for path, n in entries["draws"].value.items()]
    bounds = entries["accept"].value if "accept" in entries else {}
    accept = [_bounds(signal, n, reader, f"{section}.accept.{signal}") for signal, n in bounds.items()]
    if not entries["draws"].value:
        reader.wrong(entries["draws"], f"`{section}.{drawn}` draws nothing", "write a path and its distribution")
    return Random(
        read_value(RANDOM["count"], entries["count"], "random.count", reader),
        seed,
        read_value(RANDOM["method"], entries["method"], "random.method", reader)
        if "method" in entries
        else RANDOM["method"].default,
        tuple(draw for draw in draws if draw),
        tuple(accept),
    )


def space(node: Node, section: str, reader: Reader) -> Random | None:
    """What a section varies `over`, as one draw of it; None where it does not say."""
    entries = node.value
    if "over" not in entries:
        fix = f"write {section}: {{over: {{blocks.plant.start.x: {{uniform: [-1, 1]}}}}}}"
        reader.problems.add(MissingKey(f"`{section}` has no `over`", node.place, fix))
        return None
    draws = {"count": Node(1, node.position), "draws": entries["over"]}
    kept = {key: entries[key] for key in ("seed", "accept") if key in entries}
    return read(Node({**draws, **kept}, node.position, node.place), reader, section, "over")


def _seed(node: Node, where: str, reader: Reader) -> int:
    seed = reader.number(node, where, 0.0)
    if not (0 <= seed < 2**53 and seed.is_integer()):
        fix = "such as 0, 1, 2"
        message = f"`{where}` must be a whole number from 0, not {describe(node)}"
        reader.wrong(node, message, fix, WrongValue)
        return 0
    return int(seed)


def _draw(path: str, node: Node, reader: Reader, where: str) -> Draw | None:
    kind = next(iter(node.value)) if isinstance(node.value, dict) and len(node.value) == 1 else ""
    pair = node.value[kind].value if kind in ("uniform", "normal") else None
    if not isinstance(pair, list) or len(pair) != 2:
        fix = "write {uniform: [least, most]} or {normal: [mean, deviation]}"
        reader.wrong(node, f"`{where}` takes a distribution, not {describe(node)}", fix)
        return None
    a, b = (_numbers(item, where, reader) for item in pair)
    try:
        np.broadcast_shapes(a.shape, b.shape)
    except ValueError:
        reader.wrong(node, f"the two bounds of `{where}` differ in shape", "give both one number", WrongValue)
        return None
    draw = Draw(paths(path), kind == "normal", a, b, node)
    _check_range(draw, where, reader)
    return draw


def _check_range(draw: Draw, where: str, reader: Reader) -> None:
    if np.any(draw.b < 0 if draw.normal else draw.a > draw.b):
        reader.wrong(draw.node, f"`{where}` has its bounds the wrong way round", "exchange them", WrongValue)
    with np.errstate(over="ignore"):
        range_ = np.abs(draw.a) + MOST_DEVIATIONS * draw.b if draw.normal else draw.b - draw.a
    if not np.all(np.isfinite(range_)):
        reader.wrong(draw.node, f"`{where}` has a range beyond all numbers", "give a smaller range", WrongValue)


def _numbers(node: Node, where: str, reader: Reader) -> np.ndarray:
    if not isinstance(node.value, list):
        return np.array(reader.number(node, where))
    if not node.value:
        reader.wrong(node, f"a list of `{where}` is empty", "give one number, or one for each element")
        return np.zeros(())
    parts = [_numbers(item, where, reader) for item in node.value]
    if any(part.shape != parts[0].shape for part in parts):
        reader.wrong(node, f"the rows of `{where}` differ in length", "give rows of one length", WrongValue)
        return np.zeros(())
    return np.array(parts)


def _bounds(signal: str, node: Node, reader: Reader, where: str) -> Bounds:
    entries = grammar.conform(node, reader.problems, BOUNDS, where).value
    if not entries:
        reader.wrong(node, f"`{where}` has no bound", "write {least: 0.1} or {most: 1}", WrongValue)
    least, most = (
        read_value(key, entries[name], where, reader) if name in entries else key.default
        for name, key in BOUNDS.items()
    )
    if least > most:
        message = f"`{where}`: nothing is at least {least:g} and at most {most:g}"
        reader.wrong(node, message, "exchange them", WrongValue)
    return Bounds(signal, least, most, node)
