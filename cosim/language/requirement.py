"""The requirements of a diagram: formulas of signal temporal logic, by name."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from cosim.errors import CosimError, FormulaError, Position, WrongType, WrongValue
from cosim.language import places
from cosim.language.keys import ANY, DIAGRAM, read_value
from cosim.language.reader import Reader
from cosim.language.source import Node, describe

if TYPE_CHECKING:
    from cosim.language.formula_tree import Condition


@dataclass(frozen=True)
class RequirementEntry:
    """What a run has to keep.

    formula: as it is written; ends: whether the run ends where it is violated. signals: what
    each `block.port` of the formula is, diagrams as blocks unfolded. position: where the requirement's name stands.
    """

    name: str
    formula: Node
    condition: Condition
    ends: bool
    signals: dict[str, Node]
    position: Position

    @property
    def text(self) -> str:
        """The formula."""
        return str(self.formula.value)

    def place(self, at: int) -> Position:
        """Where a character of the formula stands."""
        if at not in self._places:
            self._places[at] = places.within(self.formula, at)
        return self._places[at]

    @cached_property
    def _places(self) -> dict[int, Position]:
        """Those that somebody has asked for: each of a study's many runs does, and they are read from a file."""
        return {}

    def plain(self) -> Any:
        """The entry without places, as YAML has it, with the names of an unfolded diagram."""
        from cosim.language.formula_tree import mentions

        text = self.text
        for mention in sorted(mentions(self.condition), key=lambda m: -m.at):
            name, members = self.signals[mention.signal].value.partition("[")[::2]
            behind = text[mention.at + len(mention.signal) :]
            if members and mention.index:  # a member that an output takes, and an element of it
                behind = f"[{members.rstrip(']')}, {behind.lstrip()[1:]}"
            elif members:
                behind = f"[{members}{behind}"
            text = text[: mention.at] + name + behind
        return {"formula": text, "stop": "violated"} if self.ends else text


def read_requirements(
    nodes: dict[str, Node], metrics: AbstractSet[str], rewired: Callable[[Node], Node], reader: Reader
) -> dict[str, RequirementEntry]:
    """The requirements of a diagram, but for those that cannot be read: each has its report.

    metrics: their names. rewired: gives what a source is, diagrams as blocks unfolded.
    """
    for name in metrics & nodes.keys():
        message = f"`{name}` is a requirement and a metric: a study has one figure of each name"
        reader.wrong(nodes[name], message, "give one of them another name", WrongValue)
    found = {name: _read(name, node, rewired, reader) for name, node in nodes.items()}
    return {name: entry for name, entry in found.items() if entry}


def _read(name: str, node: Node, rewired: Callable[[Node], Node], reader: Reader) -> RequirementEntry | None:
    from cosim.language.formula import parse  # which a diagram without requirements does not need
    from cosim.language.formula_tree import mentions

    where, ends, formula = f"requirements.{name}", False, node
    if isinstance(node.value, dict):
        if "formula" not in node.value:
            reader.missing(node, f"requirement `{name}` has no `formula`", "such as always(plant.x < 1)")
            return None
        key = DIAGRAM["requirements"].below[ANY].below["stop"]
        ends = "stop" in node.value and bool(read_value(key, node.value["stop"], f"{where}.stop", reader))
        formula = node.value["formula"]
    if not isinstance(formula.value, str):
        fix = "such as always(plant.x < 1)"
        reader.wrong(formula, f"`{where}` must be a formula, not {describe(formula)}", fix, WrongType)
        return None
    try:
        condition = parse(formula.value, partial(places.within, formula))
    except FormulaError as error:
        reader.problems.add(told(name, error))
        return None
    signals: dict[str, Node] = {}
    for mention in mentions(condition):
        if mention.signal not in signals:
            signals[mention.signal] = rewired(Node(mention.signal, places.within(formula, mention.at)))
    return RequirementEntry(name, formula, condition, ends, signals, node.place)


def told(name: str, error: CosimError) -> CosimError:
    """The error with the name of its requirement."""
    return type(error)(f"requirement {name}: {error.message}", error.position, error.fix)
