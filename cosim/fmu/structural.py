"""FMI 3's structural parameters: what a diagram gives them says which shapes ports have, before anything is wired."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.errors import WrongValue
from cosim.language import data_files
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.language.values import Value


def sizes(entry: BlockEntry, description: Any) -> dict[str, int]:
    """The sizes to which an entry gives a value, under whatever name it calls them, by the FMU's name.

    Raises: WrongType, WrongValue, ExpressionError.
    """
    sizing = {d.variable.name for v in description.modelVariables for d in v.dimensions if d.variable is not None}
    own = {v.name: (v.alias or v).name for v in description.modelVariables}
    names = {ours: node.value for ours, node in entry.ports.items() if isinstance(node.value, str)}
    given = {own.get(names.get(name, name), ""): (name, node) for name, node in entry.parameters.items()}
    return {theirs: _size(entry, *given[theirs]) for theirs in sizing & given.keys()}


def _size(entry: BlockEntry, name: str, node: Node) -> int:
    if isinstance(data_files.listed(node).value, list):
        message = f"block {entry.name}: `{name}` needs one value"
        raise WrongValue(
            message, node.position, "give one for all members of a fleet, as shapes of ports follow from it"
        )
    return int(Value.read(node, f"{entry.name}.{name}").array((), np.dtype(np.uint64), {}))
