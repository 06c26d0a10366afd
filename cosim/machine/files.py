"""Files that appear whole or not at all, and never in the place of what this program did not write."""

from __future__ import annotations

import errno
import glob
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.errors import ResultError

FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
"""What the system says where there is no space left."""


@contextmanager
def fresh(path: Path, keep: Path | None = None) -> Iterator[Path]:
    """A hidden name beside `path`; what was written there takes the place of `path` if the block succeeds.

    keep: where the file that stood at `path` stays. At every instant there is a file called `path`, if there was one.
    """
    new = _hidden(path)
    try:
        yield new
        if keep and path.exists():
            _second_name(path, keep)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def refuse_foreign(path: Path, what: str, ours: Callable[[Path], bool]) -> None:
    """A file of ours may take the place of one of its kind or of an empty one, of nothing else that a slip may name.

    what: the kind in words; ours: whether a file is one. Raises: ResultError.
    """
    try:
        found = path.stat()
        mine = stat.S_ISREG(found.st_mode) and (found.st_size == 0 or ours(path))
    except (FileNotFoundError, NotADirectoryError):
        return
    except (OSError, ValueError) as error:  # a ValueError for a NUL in the name
        reason = error.strerror if isinstance(error, OSError) else error
        raise ResultError(f"cannot write {path}: {reason}", fix="choose another name") from None
    if not mine:
        folder = stat.S_ISDIR(found.st_mode)
        fix = "name a file in that folder" if folder else "choose another name, or remove it if you mean it"
        raise ResultError(f"{path} exists and is not {what}: it is not replaced", fix=fix)


def usual_fix(error: Exception) -> str:
    """What to do about a file that cannot be written."""
    return "free some space" if getattr(error, "errno", None) in FULL else "choose a folder that you may write to"


def require_ending(path: Path, what: str, *endings: str) -> None:
    """A file's name says what it holds: what everybody else goes by. Raises: ResultError.

    what: the kind in words. endings: without their dots, the usual one first.
    """
    if path.suffix.lower().lstrip(".") not in endings:
        fix = f"such as {path.with_suffix(f'.{endings[0]}')}"
        raise ResultError(f"`{path}`: the name of {what} ends in .{' or .'.join(endings)}", fix=fix)


def unfinished(path: Path) -> Iterator[Path]:
    """What a kill inside of `fresh` may have left of files that were to be called `path`."""
    return path.parent.glob(f".{glob.escape(path.name)}.{'[0-9a-f]' * 8}")


def _hidden(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.urandom(4).hex()}")


def _second_name(path: Path, keep: Path) -> None:
    """Have the file at `path` stand at `keep` too; a copy where the file system has no links."""
    second = _hidden(keep)
    try:
        try:
            os.link(path, second)
        except OSError:
            shutil.copy2(path, second)
        second.replace(keep)
    finally:
        second.unlink(missing_ok=True)
