"""What a block's new type takes of that which was written for the one before, and what to write where it does not."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import SequenceMatcher
from typing import Any

import numpy as np

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Input, Parameter, Variable
from cosim.errors import CosimError, Problems
from cosim.language import source, units
from cosim.language.entry import SECTIONS, BlockEntry
from cosim.language.keys import INTEGRATION
from cosim.language.swaps import Lost, Swap, dropped, swap_of, take_out
from cosim.wiring import library

_SHOWN = 60
_ALIKE = 0.5


def settle(entry: BlockEntry, declaration: Declaration, problems: Problems, code: bool = True) -> Swap | None:
    """Leave out of an entry what its type does not declare of that which was written for another; None for no swap.

    code: whether the replaced type, whose units are asked for, may be imported. What is left out without `drop:` goes
    to `problems` as one DroppedValue with the lines to paste.
    """
    if entry.type.replaces is None:
        return None
    before = _replaced(entry, code)
    known: dict[str, dict[str, Variable]] = {
        "parameters": {v.name: v for v in declaration.of(Parameter)},
        "start": {v.name: v for v in declaration.startable()},
        "inputs": {v.name: v for v in declaration.of(Input)},
    }
    names: dict[str, Collection[str]] = {
        **known,
        "dimensions": {*declaration.dimension_names(), *declaration.dimensions},
    }
    other = _other_units(entry, before, known) if before else []
    for key in INTEGRATION:
        node = entry.settings.get(key)
        if node and node.inherited and not declaration.continuous():
            entry.unfit[key] = entry.settings.pop(key)
    lost = [*other, *take_out(entry, names)]
    if lost:
        problems.add(dropped(entry, lost, _offers(entry, lost, known, before)))
    defaults = [
        f"{v.name} = {_short(v.start)}"
        for section in ("parameters", "inputs")
        for v in known[section].values()
        if v.start is not None and v.name not in {*entry.parameters, *entry.inputs, *entry.start}
    ]
    return swap_of(entry, lost, defaults)


def _short(value: Any) -> str:
    """A default in few characters."""
    text = str(value) if np.ndim(value) == 0 else str(np.asarray(value).tolist())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def _replaced(entry: BlockEntry, code: bool) -> Declaration | None:
    """The declaration of the replaced type, where it can be had."""
    assert entry.type.replaces
    kind, node = entry.type.replaces
    if kind in ("diagram", "expression") or not (code or kind == "block"):
        return None
    try:
        return library.find(BlockEntry(entry.name, kind, node, node.position)).declaration
    except CosimError:
        return None


def _other_units(entry: BlockEntry, before: Declaration, known: Mapping[str, Mapping[str, Variable]]) -> list[Lost]:
    """What has the same name in the new type and another unit; it is taken out of the entry."""
    lost = []
    for section in ("parameters", "start", "inputs"):
        entries = getattr(entry, section)
        values = entry.constants if section == "inputs" else entries
        for name in [n for n, node in values.items() if node.inherited and n in known[section]]:
            there, here = before.variables.get(name), known[section][name]
            if there and there.unit and here.unit and not units.same(there.unit, here.unit):
                reason = f"in {there.unit} there, in {here.unit} here"
                lost.append(Lost(section, name, entries[name], reason))
        setattr(entry, section, {n: v for n, v in entries.items() if n not in {item.name for item in lost}})
    return lost


def _offers(
    entry: BlockEntry, lost: list[Lost], known: Mapping[str, Mapping[str, Variable]], before: Declaration | None
) -> list[str]:
    """Lines that would hand what is lost to the variables of the new type that look most like it."""
    given = {s: {**getattr(entry, s)} for s in SECTIONS}
    lines: dict[str, dict[str, Any]] = {}
    for item in lost:
        if item.section not in known:
            continue
        old = before.variables.get(item.name) if before else None
        # A start value may have become a parameter, as where an FMU calculates its outputs.
        sections = ("start", "parameters") if item.section == "start" else (item.section,)
        free = {n: (s, v) for s in sections for n, v in known[s].items() if n not in given[s] or n == item.name}
        scores = {n: _likeness(item.name, old, v) for n, (_, v) in free.items()}
        best = max(scores, key=lambda n: scores[n], default="")
        alone = len(free) == 1 and sum(other.section == item.section for other in lost) == 1
        if not best or (scores[best] < _ALIKE and not alone):
            continue
        section = free[best][0]
        given[section][best] = item.node
        if entry.kind == "fmu" and section == item.section:
            lines.setdefault("ports", {})[item.name] = best
        else:
            lines.setdefault(section, {})[best] = item.node.plain()
    return [source.dump({key: values}).replace("\n", " ").strip() for key, values in lines.items()]


def _likeness(name: str, old: Variable | None, new: Variable) -> float:
    """How likely a variable is another's under a new name: by their names, units and shapes."""
    short, long = sorted((name.lower(), new.name.lower()), key=len)
    score = SequenceMatcher(None, short, long).ratio()
    if long.startswith(short):
        score = max(score, _ALIKE)
    if old is None:
        return score
    if old.unit and new.unit:
        score = score + 0.5 if units.same(old.unit, new.unit) else 0.0
    return score if len(old.shape) == len(new.shape) else 0.0
