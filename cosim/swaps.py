"""What a block keeps, drops and takes by default of what was written for the type that it replaces.

Dropping what the diagram gave is a mistake unless the block waives it: `drop: [gamma_1, gamma_2]`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Any

import numpy as np

from cosim import source, units
from cosim.block import Declaration, Input, Parameter, Variable
from cosim.entry import SECTIONS, BlockEntry
from cosim.errors import CosimError, DroppedValue, Problems
from cosim.source import Node

_SHOWN = 60
_ALIKE = 0.5


@dataclass(frozen=True)
class Swap:
    """One block whose type a layer of the diagram replaces. keeps, drops, defaults: names, the last with values."""

    block: str
    before: str
    after: str
    keeps: tuple[str, ...]
    drops: tuple[str, ...]
    defaults: tuple[str, ...]

    def __str__(self) -> str:
        parts = {"keeps": self.keeps, "drops": self.drops, "defaults": self.defaults}
        said = "; ".join(f"{verb} {', '.join(names)}" for verb, names in parts.items() if names)
        return f"{self.block}: {self.before} → {self.after}" + (f": {said}" if said else "")


@dataclass(frozen=True)
class _Lost:
    """Something that was written for the replaced type and that the new one does not take."""

    section: str
    name: str
    node: Node
    reason: str = ""

    @property
    def label(self) -> str:
        """Its name below the block."""
        return f"{self.section}.{self.name}" if self.section else self.name


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
    needs = {
        "period": declaration.kind("update"),
        **dict.fromkeys(("integrator", "inner_steps"), declaration.continuous()),
    }
    for key, needed in needs.items():
        node = getattr(entry, key)
        if node and node.inherited and not needed:
            entry.unfit[key] = node
            setattr(entry, key, None)
    lost = [*other, *_take_out(entry, names)]
    if lost:
        problems.add(_error(entry, lost, _offers(entry, lost, known, before)))
    defaults = [
        f"{v.name} = {_short(v.start)}"
        for section in ("parameters", "inputs")
        for v in known[section].values()
        if v.start is not None and v.name not in {*entry.parameters, *entry.inputs, *entry.start}
    ]
    return _swap(entry, lost, defaults)


def settle_diagram(entry: BlockEntry, known: Mapping[str, Collection[str]], problems: Problems) -> Swap | None:
    """The same for a block that is a diagram: known are the names in each section that it hands on."""
    if entry.type.replaces is None:
        return None
    lost = _take_out(entry, known)
    if lost:
        problems.add(_error(entry, lost, []))
    return _swap(entry, lost, [])


def _take_out(entry: BlockEntry, known: Mapping[str, Collection[str]]) -> list[_Lost]:
    """Remove from an entry what its type does not know of that which was written for another."""
    lost = [_Lost(s, name, node) for s in SECTIONS for name, node in entry.take_out(s, known[s]).items()]
    lost += [_Lost("", key, node) for key, node in entry.unfit.items()]
    return lost


def _swap(entry: BlockEntry, lost: list[_Lost], defaults: list[str]) -> Swap:
    assert entry.type.replaces
    before, after = _type_name(*entry.type.replaces), _type_name(entry.kind, entry.type)
    drops = (*entry.dropped, *(item.label for item in lost))
    return Swap(entry.name, before, after, tuple(_kept(entry)), drops, tuple(defaults))


def _kept(entry: BlockEntry) -> list[str]:
    keys = [k for k in ("period", "integrator", "inner_steps", "mode", "isolate") if getattr(entry, k)]
    sections = [(s, getattr(entry, s)) for s in (*SECTIONS, "ports")]
    names = [
        n if s in ("parameters", "inputs") else f"{s}.{n}" for s, e in sections for n, v in e.items() if v.inherited
    ]
    return names + [k for k in keys if getattr(entry, k).inherited]


def _type_name(kind: str, node: Node) -> str:
    text = str(node.value)
    return text if kind == "block" else text.rpartition("/")[2].rpartition(":")[2]


def _short(value: Any) -> str:
    """A default in few characters."""
    text = str(value) if np.ndim(value) == 0 else str(np.asarray(value).tolist())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def _replaced(entry: BlockEntry, code: bool) -> Declaration | None:
    """The declaration of the replaced type, where it can be had."""
    from cosim import library

    assert entry.type.replaces
    kind, node = entry.type.replaces
    if kind == "diagram" or not (code or kind == "block"):
        return None
    try:
        return library.find(BlockEntry(entry.name, kind, node, node.position)).declaration
    except CosimError:
        return None


def _other_units(entry: BlockEntry, before: Declaration, known: Mapping[str, Mapping[str, Variable]]) -> list[_Lost]:
    """What has the same name in the new type and another unit; it is taken out of the entry."""
    lost = []
    for section in ("parameters", "start"):
        entries = getattr(entry, section)
        for name in [n for n, node in entries.items() if node.inherited and n in known[section]]:
            there, here = before.variables.get(name), known[section][name]
            if there and there.unit and here.unit and not units.same(there.unit, here.unit):
                reason = f"in {there.unit} there, in {here.unit} here"
                lost.append(_Lost(section, name, entries[name], reason))
        setattr(entry, section, {n: v for n, v in entries.items() if n not in {item.name for item in lost}})
    return lost


# ---- what the message offers ----


def _error(entry: BlockEntry, lost: list[_Lost], offers: list[str]) -> DroppedValue:
    """One mistake for all that a block would drop, with the lines to paste."""
    assert entry.type.replaces
    before, after = _type_name(*entry.type.replaces), _type_name(entry.kind, entry.type)
    named = [f"{item.label} at {item.node.place}" + (f" ({item.reason})" if item.reason else "") for item in lost]
    message = f"block {entry.name}: {after} does not take what the diagram gives {before}: {', '.join(named)}"
    waiver = f"drop: [{', '.join(_shortest_label(item, entry, lost) for item in lost)}]"
    lines = [f"write below blocks.{entry.name}, as far as these are the same:", *offers] if offers else []
    lines += [f"{'and' if offers else f'write below blocks.{entry.name},'} if it is meant to be dropped:", waiver]
    if not entry.type.position.line:
        lines += ["or on the command line:", f"--set 'blocks.{entry.name}.{waiver.replace(': ', '=', 1)}'"]
    return DroppedValue(message, entry.type.position, "\n".join(lines))


def _shortest_label(item: _Lost, entry: BlockEntry, lost: list[_Lost]) -> str:
    """The name alone, unless something else of the block that was written for the old type has it too."""
    others = [(s, n) for s in SECTIONS for n, node in getattr(entry, s).items() if node.inherited]
    others += [(other.section, other.name) for other in lost]
    return item.label if any(n == item.name and s != item.section for s, n in others) else item.name


def _offers(
    entry: BlockEntry, lost: list[_Lost], known: Mapping[str, Mapping[str, Variable]], before: Declaration | None
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
