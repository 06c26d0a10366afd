"""A network in the making: what the stages of resolving a diagram have found so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from cosim.errors import Problems
from cosim.language.diagram import Diagram
from cosim.language.source import Node
from cosim.language.swaps import Swap
from cosim.language.values import Value
from cosim.wiring.absent import Absent
from cosim.wiring.network import Component, Loop, Network, Signal, Task


@dataclass
class Draft:
    """Each stage adds to it, its mistakes to `problems`, and goes on with what is left.

    code: whether the code of blocks in `python:` files may run. values: by component and variable, as they are written.
    """

    diagram: Diagram
    problems: Problems
    code: bool
    components: dict[str, Component] = field(default_factory=dict)
    values: dict[tuple[str, str], Value] = field(default_factory=dict)
    swaps: list[Swap] = field(default_factory=list)
    unchecked: list[str] = field(default_factory=list)
    recorded: tuple[Signal, ...] = ()
    reduced: dict[str, Signal] = field(default_factory=dict)
    initial: tuple[Task | Loop, ...] = ()
    evaluation: tuple[Task | Loop, ...] = ()
    absent: Absent = field(default_factory=Absent)

    def network(self) -> Network:
        """What there is of the network."""
        return Network(
            self.diagram,
            self.components,
            self.swaps,
            self.unchecked,
            self.recorded,
            self.reduced,
            self.initial,
            self.evaluation,
        )

    def is_whole(self) -> bool:
        """Whether all blocks are known and nothing is wrong so far."""
        return not (self.problems.errors or self.absent.blocks or self.absent.outputs or self.unchecked)

    def named(self, name: str, node: Node, taker: str = "") -> Component | None:
        """The component that a wire or a signal names; where there is none, that is noted.

        What names a block whose own mistakes keep it from being known is no further mistake.
        """
        component = self.components.get(name)
        if component is None and name not in self.diagram.unread and name not in self.diagram.blocks:
            self.absent.blocks.setdefault(name, []).append((node, taker))
        return component
