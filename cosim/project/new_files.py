"""Files that are written where there are none: all of them or not one, and nothing in the place of anything else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import resources
from pathlib import Path
from string import Template

from cosim.errors import UsageError

Content = str | Callable[[], str]
"""The text of a file, or what gives it when those before it are written."""


def template(file: str, /, **words: str) -> str:
    """A template of this package, `$name` in it replaced by what it stands for."""
    text = resources.files("cosim.project").joinpath("templates", file).read_text(encoding="utf-8")
    return Template(text).substitute(words)


def write_all(files: Mapping[Path, Content]) -> None:
    """Write text files, with the folders that they are in; what was written is removed again where one fails.

    Raises: UsageError where something stands at one of the names, OSError where one cannot be written.
    """
    there = [path for path in files if path.exists() or path.is_symlink()]
    if there:
        more = f" and {len(there) - 3} more" if len(there) > 3 else ""
        names = ", ".join(f"`{path}`" for path in there[:3]) + more
        verb = "are there already" if len(there) > 1 else "is there already"
        raise UsageError(f"{names} {verb}: nothing is replaced, and nothing was written", fix="choose another name")
    made: list[Path] = []
    try:
        for path, content in files.items():
            text = content if isinstance(content, str) else content()
            _make_folder(path.parent, made)
            with path.open("x", encoding="utf-8", newline="\n") as file:
                made.append(path)
                file.write(text)
    except OSError as error:
        error.filename = error.filename or str(made[-1])  # which a write does not know
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir() if path.is_dir() else path.unlink()
        raise


def _make_folder(folder: Path, made: list[Path]) -> None:
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(missing):
        path.mkdir()
        made.append(path)
