"""The files of a new block: one with the block, which runs, and one with its test."""

from __future__ import annotations

import keyword
import os
import re
import sys
from pathlib import Path

import cosim.authoring.variables as declared
from cosim.errors import UsageError
from cosim.project.new_files import template, write_all
from cosim.study import file_names

_WRITTEN_WITH = {"Block", "Measure", *(name for name in vars(declared) if name[0].isupper())}
_TAKEN = {"cosim", "numpy", "scipy", "numba", "conftest", "matplotlib", "yaml", "pytest"}


def class_and_file(name: str) -> tuple[str, str]:
    """The class `ServoMotor` and the module `servo_motor` of a block of either name.

    Raises: UsageError for what cannot be one, or would hide a module that others import.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        meant = (name.isascii() and _camel(name)) or "ServoMotor"
        fix = f"such as {meant}: letters, digits and _, beginning with a letter"
        raise UsageError(f"a block cannot be called {name!r}", fix=fix)
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower().strip("_")
    class_ = name if name[0].isupper() and "_" not in name else _camel(module)
    if keyword.iskeyword(class_) or keyword.iskeyword(module):
        raise UsageError(f"`{name}` is a word of Python's own", fix=f"such as {class_}Block")
    if class_ in _WRITTEN_WITH:
        raise UsageError(f"blocks are written with `{class_}`, so none is called so", fix=f"such as My{class_}")
    if module in sys.stdlib_module_names or module in _TAKEN:
        message = f"`{module}.py` would hide the module `{module}`, which other files import"
        raise UsageError(message, fix=f"such as {class_}Block")
    if flaw := file_names.flaw(module):
        raise UsageError(f"a file cannot be called `{module}.py`: {flaw}", fix=f"such as {class_}Block")
    return class_, module


def _camel(name: str) -> str:
    parts = re.findall(r"[A-Za-z0-9]+", name.lstrip("0123456789_"))
    return "".join(part[0].upper() + part[1:] for part in parts)


def write(name: str, folder: Path, tests: Path = Path("tests")) -> tuple[str, list[Path]]:
    """Write a block and its test; what a diagram in the current folder calls it, and the files.

    Raises: UsageError, OSError.
    """
    class_, module = class_and_file(name)
    block, test = folder / f"{module}.py", tests / f"test_{module}.py"
    path = Path(os.path.relpath(block, tests)).as_posix()
    words = {"name": class_, "module": module, "path": path}
    write_all({block: template("new_block.txt", **words), test: template("new_test.txt", **words)})
    return f"{block.as_posix()}:{class_}", [block, test]
