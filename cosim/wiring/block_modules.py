"""What an imported module of blocks has, where it stands, and what kept it from being imported."""

from __future__ import annotations

import importlib.util
import traceback
from pathlib import Path
from types import ModuleType

from cosim.authoring.author_source import shown
from cosim.authoring.block import Block
from cosim.errors import BlockImportError, CosimError, Position
from cosim.machine import importing

FILE_PREFIX = "cosim_file_"
"""How the names begin of modules that are files next to a diagram."""


def block_classes(module: ModuleType) -> list[type[Block]]:
    """All block classes that a module knows, private ones too."""
    members = [m for m in vars(module).values() if isinstance(m, type) and issubclass(m, Block)]
    return [m for m in dict.fromkeys(members) if m.__module__ != Block.__module__]


def import_error(error: BaseException, path: Path, folder: str) -> CosimError:
    """The error at the innermost line that stands in the file's folder."""
    if isinstance(error, SyntaxError) and error.filename and error.filename.startswith(folder):
        line, column, file = error.lineno or 0, error.offset or 0, Path(error.filename)
        text = error.msg
    else:
        frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename.startswith(folder)]
        line, column = (frames[-1].lineno or 0, (frames[-1].colno or 0) + 1) if frames else (0, 0)
        file = Path(frames[-1].filename) if frames else path
        text = str(error) if isinstance(error, importing.Stuck) else f"{type(error).__name__}: {error}"
    place = Position(shown(str(file.resolve())), line, column)
    if isinstance(error, CosimError):
        error.position = error.position or place
        return error
    return BlockImportError(f"`{path}` cannot be imported: {text}", place, _fix(error))


def _fix(error: BaseException) -> str:
    """The usual fix for an import that fails."""
    if isinstance(error, ModuleNotFoundError):
        return "install it, or put it beside the file: a file of blocks finds the modules of its own folder"
    if isinstance(error, ImportError) and "relative import" in str(error):
        return "leave out the dot: `from helpers import …` finds a file beside this one"
    return "correct the Python file"


def is_inside(module: ModuleType, folder: Path) -> bool:
    """Whether a module was found in a folder, or below it, and is no block file itself."""
    spec = getattr(module, "__spec__", None)
    file = spec.origin if spec else None
    return bool(file) and not module.__name__.startswith(FILE_PREFIX) and folder in Path(str(file)).resolve().parents


def find_spec(name: str) -> importlib.machinery.ModuleSpec | None:
    """Where a module would be found; None if nowhere."""
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None
