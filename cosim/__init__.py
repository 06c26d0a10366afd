"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master."""

from importlib import import_module

TYPE_CHECKING = False  # as of `typing`, without the time that it takes
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


def __getattr__(name: str) -> object:
    """What blocks are written with; imported only when asked for, so that the command line soon hears Ctrl-C."""
    if name not in __all__:
        raise AttributeError(f"module `{__name__}` has no attribute `{name}`")
    return getattr(import_module("cosim.block"), name)
