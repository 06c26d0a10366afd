"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master, FMUs in and out.

What a program needs (`load`, `describe`, `Run`, `open_result`, `export_fmu`) and what blocks are written with stands
here; all else is private by convention, and may change.
"""

import os
from importlib import import_module

TYPE_CHECKING = False  # as of `typing`, without the time that it takes
if TYPE_CHECKING:
    from cosim.authoring.block import Block, Measure
    from cosim.authoring.rules import Course, condition, rule
    from cosim.authoring.variables import (
        CalculatedParameter,
        Dimension,
        Indicator,
        Input,
        Local,
        Output,
        Parameter,
        State,
    )
    from cosim.engine.outcome import Outcome
    from cosim.engine.run import Run, load
    from cosim.errors import CosimError
    from cosim.export.exporter import export_fmu
    from cosim.results.result_file import open_result
    from cosim.wiring.overview import describe

__version__ = "0.1.0"

_HOMES = {
    "cosim.authoring.block": "Block Measure",
    "cosim.authoring.rules": "Course condition rule",
    "cosim.authoring.variables": "CalculatedParameter Dimension Indicator Input Local Output Parameter State",
    "cosim.engine.outcome": "Outcome",
    "cosim.engine.run": "Run load",
    "cosim.errors": "CosimError",
    "cosim.export.exporter": "export_fmu",
    "cosim.results.result_file": "open_result",
    "cosim.wiring.overview": "describe",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "Block",
    "CalculatedParameter",
    "CosimError",
    "Course",
    "Dimension",
    "Indicator",
    "Input",
    "Local",
    "Measure",
    "Outcome",
    "Output",
    "Parameter",
    "Run",
    "State",
    "condition",
    "describe",
    "export_fmu",
    "load",
    "open_result",
    "rule",
]

# In the source tree, the library's blocks stand beside this package; a wheel holds them within, as `cosim.blocks`.
_folder = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_folder, "blocks")):
    __path__.append(os.path.dirname(_folder))


def __getattr__(name: str) -> object:
    """Imported only when asked for, so that the command line soon hears Ctrl-C."""
    if name not in _HOME:
        raise AttributeError(f"module `{__name__}` has no attribute `{name}`")
    return getattr(import_module(_HOME[name]), name)
