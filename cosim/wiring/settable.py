"""What a diagram may say of a block below each of its sections, as the block's type declares it."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Input, Parameter, Variable


def sections(declaration: Declaration) -> dict[str, Mapping[str, Variable | None]]:
    """The variables that may be named, by section of a block; a dimension is none."""
    fixed = {name for name, dimension in declaration.dimensions.items() if dimension.of}
    sizes = dict.fromkeys((*declaration.dimension_names(), *declaration.dimensions))
    starts = (*declaration.startable(), *declaration.guessable())
    return {
        "parameters": {v.name: v for v in declaration.of(Parameter)},
        "start": {v.name: v for v in starts},
        "inputs": {v.name: v for v in declaration.of(Input)},
        "dimensions": {name: None for name in sizes if name not in fixed},
    }
