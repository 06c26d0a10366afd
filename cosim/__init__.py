"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master."""

import os
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

# In the source tree, the library's blocks stand beside this package; a wheel holds them within, as `cosim.blocks`.
_folder = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_folder, "blocks")):
    __path__.append(os.path.dirname(_folder))

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
