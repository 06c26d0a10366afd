"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master, FMUs in and out.

What a program needs (`load`, `diagram`, `study`, `load_study`, `open_result`, …) and what blocks are written with
stands here; all else is private by convention, and may change.
"""

import os
import sys
from importlib import import_module

TYPE_CHECKING = False  # as of `typing`, without the time that it takes
if TYPE_CHECKING:
    from cosim.authoring import random
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
        Seed,
        State,
        Stream,
    )
    from cosim.engine.outcome import Outcome
    from cosim.engine.run import Run
    from cosim.errors import CosimError
    from cosim.export.exporter import export_fmu
    from cosim.face.block_diagram import BlockDiagram, diagram, load
    from cosim.face.finished_run import FinishedRun
    from cosim.face.parameter_study import ParameterStudy, load_study, study
    from cosim.face.stepped_run import SteppedRun
    from cosim.face.study_table import StudyTable
    from cosim.results.result_file import open_result
    from cosim.wiring.overview import describe

__version__ = "0.1.0"

_HOMES = {
    "cosim.authoring.block": "Block Measure",
    "cosim.authoring.rules": "Course condition rule",
    "cosim.authoring.variables": "CalculatedParameter Dimension Indicator Input Local Output Parameter Seed State "
    "Stream",
    "cosim.engine.outcome": "Outcome",
    "cosim.engine.run": "Run",
    "cosim.errors": "CosimError",
    "cosim.export.exporter": "export_fmu",
    "cosim.face.block_diagram": "BlockDiagram diagram load",
    "cosim.face.finished_run": "FinishedRun",
    "cosim.face.parameter_study": "ParameterStudy load_study study",
    "cosim.face.stepped_run": "SteppedRun",
    "cosim.face.study_table": "StudyTable",
    "cosim.results.result_file": "open_result",
    "cosim.wiring.overview": "describe",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "Block",
    "BlockDiagram",
    "CalculatedParameter",
    "CosimError",
    "Course",
    "Dimension",
    "FinishedRun",
    "Indicator",
    "Input",
    "Local",
    "Measure",
    "Outcome",
    "Output",
    "Parameter",
    "ParameterStudy",
    "Run",
    "Seed",
    "State",
    "SteppedRun",
    "Stream",
    "StudyTable",
    "condition",
    "describe",
    "diagram",
    "export_fmu",
    "load",
    "load_study",
    "open_result",
    "random",
    "rule",
    "study",
]

# In the source tree, the library's blocks stand beside this package; a wheel holds them within, as `cosim.blocks`.
_folder = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_folder, "blocks")):
    __path__.append(os.path.dirname(_folder))


class _Package(type(sys)):  # type: ignore[misc]  # the type of modules, without the time to import it by its name
    """The type of this module, in which `study` is the function, though a folder of files has that name too."""

    @property
    def study(self) -> object:
        return import_module(_HOME["study"]).study

    @study.setter
    def study(self, folder: object) -> None:
        """Python's own import, which binds the folder to its name here."""


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> object:
    """Imported only when asked for, so that the command line soon hears Ctrl-C."""
    if name == "random":
        return import_module("cosim.authoring.random")
    if name not in _HOME:
        raise AttributeError(f"module `{__name__}` has no attribute `{name}`")
    return getattr(import_module(_HOME[name]), name)
