"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosim.block import (
        Block,
        CalculatedParameter,
        Dimension,
        Input,
        Local,
        Measure,
        Output,
        Parameter,
        State,
        condition,
        rule,
    )

__all__ = [
    "Block",
    "CalculatedParameter",
    "Dimension",
    "Input",
    "Local",
    "Measure",
    "Output",
    "Parameter",
    "State",
    "condition",
    "rule",
]


def __getattr__(name: str) -> Any:
    """What blocks are written with; imported when it is asked for, so that the command line hears Ctrl-C from the start."""
    if name not in __all__:
        raise AttributeError(f"module `{__name__}` has no attribute `{name}`")
    return getattr(import_module("cosim.block"), name)
