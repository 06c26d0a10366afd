"""What a block keeps, drops and takes by default of what was written for the type that it replaces.

Dropping what the diagram gave is a mistake unless the block waives it: `drop: [gamma_1, gamma_2]`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from cosim.errors import DroppedValue, Problems
from cosim.language.entry import SECTIONS, BlockEntry, type_words
from cosim.language.keys import BLOCK, TYPES
from cosim.language.source import Node


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
class Lost:
    """Something that was written for the replaced type and that the new one does not take."""

    section: str
    name: str
    node: Node
    reason: str = ""

    @property
    def label(self) -> str:
        """Its name below the block."""
        return f"{self.section}.{self.name}" if self.section else self.name


def settle_diagram(entry: BlockEntry, known: Mapping[str, Collection[str]], problems: Problems) -> Swap | None:
    """Leave out of a block that is a diagram what it does not hand on of that which was written for another type.

    known: the names in each section that it hands on. None for no swap.
    """
    if entry.type.replaces is None:
        return None
    lost = take_out(entry, known)
    if lost:
        problems.add(dropped(entry, lost, []))
    return swap_of(entry, lost, [])


def take_out(entry: BlockEntry, known: Mapping[str, Collection[str]]) -> list[Lost]:
    """Remove from an entry what its type does not know of that which was written for another."""
    lost = [Lost(s, name, node) for s in SECTIONS for name, node in entry.take_out(s, known[s]).items()]
    lost += [Lost("", key, node) for key, node in entry.unfit.items()]
    return lost


def swap_of(entry: BlockEntry, lost: list[Lost], defaults: list[str]) -> Swap:
    """What became of an entry whose type is replaced."""
    assert entry.type.replaces
    before, after = type_words(*entry.type.replaces), type_words(entry.kind, entry.type)
    drops = (*entry.dropped, *(item.label for item in lost))
    return Swap(entry.name, before, after, tuple(_kept(entry)), drops, tuple(defaults))


def _kept(entry: BlockEntry) -> list[str]:
    keys = [key for key in entry.settings if BLOCK[key].kinds != TYPES]
    sections = [(s, getattr(entry, s)) for s in (*SECTIONS, "ports")]
    names = [
        n if s in ("parameters", "inputs") else f"{s}.{n}" for s, e in sections for n, v in e.items() if v.inherited
    ]
    return names + [key for key in keys if entry.settings[key].inherited]


def dropped(entry: BlockEntry, lost: list[Lost], offers: list[str]) -> DroppedValue:
    """One mistake for all that a block would drop, with the lines to paste."""
    assert entry.type.replaces
    before, after = type_words(*entry.type.replaces), type_words(entry.kind, entry.type)
    named = [f"{item.label} at {item.node.place}" + (f" ({item.reason})" if item.reason else "") for item in lost]
    message = f"block {entry.name}: {after} does not take what the diagram gives {before}: {', '.join(named)}"
    waiver = f"drop: [{', '.join(_shortest_label(item, entry, lost) for item in lost)}]"
    lines = [f"write below blocks.{entry.name}, as far as these are the same:", *offers] if offers else []
    lines += [f"{'and' if offers else f'write below blocks.{entry.name},'} if it is meant to be dropped:", waiver]
    if not entry.type.position.line:
        lines += ["or on the command line:", f"--set 'blocks.{entry.name}.{waiver.replace(': ', '=', 1)}'"]
    return DroppedValue(message, entry.type.position, "\n".join(lines))


def _shortest_label(item: Lost, entry: BlockEntry, lost: list[Lost]) -> str:
    """The name alone, unless something else of the block that was written for the old type has it too."""
    others = [(s, n) for s in SECTIONS for n, node in getattr(entry, s).items() if node.inherited]
    others += [(other.section, other.name) for other in lost]
    return item.label if any(n == item.name and s != item.section for s, n in others) else item.name
