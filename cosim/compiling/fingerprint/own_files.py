"""A text that changes whenever the framework's own code could: the files that a function of it can reach by imports.

They stay as they are while a process runs, unlike what authors write, so that nothing in them need be followed: of the
loop, that takes longer than a short run.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).parents[3]
_IMPORT = re.compile(r"^ *from (cosim[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


def files_text(function: Callable[..., Any]) -> str:
    """A digest of the file that a function stands in, and of all of this package that it imports, one by another."""
    begin = sys.modules[function.__module__].__file__
    assert begin
    return _digest(Path(begin))


@cache
def _digest(begin: Path) -> str:
    reached, waiting = dict[Path, bytes](), [begin]
    while waiting:
        file = waiting.pop()
        if file not in reached and file.is_file():
            reached[file] = file.read_bytes()
            waiting += _imported(reached[file].decode())
    digests = sorted(hashlib.sha256(file.name.encode() + content).digest() for file, content in reached.items())
    return hashlib.sha256(b"".join(digests)).hexdigest()


def _imported(text: str) -> Iterator[Path]:
    """The modules of this package that a text imports, or imports something of."""
    for module, names in _IMPORT.findall(text):
        place = _ROOT.joinpath(*module.split("."))
        folder = place.is_dir()
        yield from (
            (place / f"{name}.py" for name in re.findall(r"\w+", names)) if folder else (place.with_suffix(".py"),)
        )
