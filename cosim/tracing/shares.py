"""Which of the keys in which two diagrams differ explains how much of what a metric changes by.

Each key is changed alone, in the first diagram to what the second says and in the second to what the first says; its
share is the mean of both changes. For two keys that is Shapley's value, and the shares add up; of more, what keys do
together is told as such.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

from cosim.engine.run import Run
from cosim.errors import CosimError, Position, Problems
from cosim.language import diagram as diagrams
from cosim.language import source
from cosim.language.keys import TYPES
from cosim.results.diagram_differences import Difference, differences, plain
from cosim.wiring import resolution
from cosim.wiring.network import Network

MOST = 24
"""Of more keys that differ, each would take two runs."""
_STRUCTURE = {*TYPES, "per", "dimensions", "inputs"}
"""Keys of a block that are changed as a whole with it: one may make no sense without the others."""


@dataclass(frozen=True)
class Contribution:
    """What a key explains. changes: of each metric, how much; None where it cannot be changed alone: why."""

    key: str
    texts: tuple[str, ...]
    changes: dict[str, float] | None
    why: str = ""


@dataclass(frozen=True)
class Shares:
    """metrics: of both diagrams, those that are a number in both."""

    metrics: tuple[dict[str, float], dict[str, float]]
    shares: tuple[Contribution, ...]
    too_many: int = 0

    def together(self, metric: str) -> float:
        """What no key alone explains of a metric's change."""
        known = sum(share.changes[metric] for share in self.shares if share.changes)
        return self.metrics[1][metric] - self.metrics[0][metric] - known


def shares(a: Network, b: Network) -> Shares:
    """Run both, and each with every key of the other; without figures where one of the two does not come to its end."""
    trees = [plain(network.diagram.resolved()) for network in (a, b)]
    found = _units(trees)
    try:
        first, second = _figures(a), _figures(b)
    except CosimError as error:
        return Shares(
            ({}, {}), tuple(Contribution(key, told.texts, None, error.message) for key, told in found.items())
        )
    both = [name for name in first if name in second]
    metrics = {n: first[n] for n in both}, {n: second[n] for n in both}
    if len(found) > MOST:
        return Shares(metrics, (), len(found))
    made = []
    for key, told in found.items():
        try:
            forward = _figures(_changed(a, trees[0], trees[1], key))
            backward = _figures(_changed(b, trees[1], trees[0], key))
            changes = {n: ((forward[n] - first[n]) + (second[n] - backward[n])) / 2 for n in both}
            made.append(Contribution(key, told.texts, changes))
        except (CosimError, KeyError) as error:
            made.append(
                Contribution(key, told.texts, None, error.message if isinstance(error, CosimError) else "no figure")
            )
    return Shares(metrics, tuple(made))


def _units(trees: Sequence[Mapping[str, Any]]) -> dict[str, Difference]:
    """What can be changed alone, with what both say there: a key, or a block whose structure differs."""
    every = [item for item in differences(trees) if item.changes_run and item.key.partition(".")[0] != "requirements"]
    whole = {block for item in every if (block := _block(item.key)) and _is_structure(item.key, block)}
    found: dict[str, Difference] = {}
    for item in every:
        block = _block(item.key)
        if block in whole:
            found[block] = Difference(block, tuple(_at(tree, block) for tree in trees))
        else:
            found[item.key] = item
    return found


def _block(key: str) -> str:
    parts = key.split(".")
    return ".".join(parts[:2]) if parts[0] == "blocks" and len(parts) > 1 else ""


def _is_structure(key: str, block: str) -> bool:
    return key == block or key.removeprefix(f"{block}.").partition(".")[0] in _STRUCTURE


def _at(tree: Any, key: str) -> Any:
    """What a tree says at a key; None where it says nothing."""
    for part in key.split("."):
        if isinstance(tree, Mapping):
            tree = tree.get(part)
        elif isinstance(tree, list):
            tree = tree[int(part)]
        else:
            return None
    return tree


def _with(tree: Any, parts: Sequence[str], value: Any) -> Any:
    """A tree that says something else at a key, or, for None, nothing."""
    if not parts:
        return value
    if isinstance(tree, list):
        k = int(parts[0])
        return [*tree[:k], _with(tree[k], parts[1:], value), *tree[k + 1 :]]
    found = {**(tree or {})}
    inner = _with(found.get(parts[0]), parts[1:], value)
    if inner is None:
        found.pop(parts[0], None)
    else:
        found[parts[0]] = inner
    return found


def _changed(network: Network, tree: Any, other: Any, key: str) -> Network:
    """The network with what the other tree says at a key. Raises: DiagramErrors."""
    problems = Problems()
    text = source.dump(_with(tree, key.split("."), _at(other, key)))
    node = source.parse_value(text, Position(str(network.diagram.path)))
    return resolution.wire(diagrams.build(node, network.diagram.files[:1], problems), problems)


def _figures(network: Network) -> dict[str, float]:
    """The metrics of a run that are numbers. Raises: CosimError of a run that does not come to its end."""
    outcome = Run(network).execute()
    if outcome.signal:
        raise KeyboardInterrupt
    if outcome.error:
        raise outcome.error
    margins = {v.name: v.margin for v in outcome.requirements.values()}
    found = {**outcome.metrics, **margins}
    return {name: float(v) for name, v in found.items() if isinstance(v, Real) and not isinstance(v, bool)}
