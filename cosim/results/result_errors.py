"""What the operating system and HDF5 raise, as the one mistake that a user can put right."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.errors import ResultError
from cosim.machine.files import FULL

FIXES = {
    "full": "free some space, record fewer signals, or record with a longer period",
    "write": "choose a folder that you may write to",
    "read": "name a file that `cosim run` wrote",
}


@contextmanager
def as_result_error(action: str, path: Path) -> Iterator[None]:
    """Turn what is raised into a ResultError with the reason in one line; action: `read` or `write`."""
    try:
        yield
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        inner = re.search(r"error message = '([^']*)'", str(error))
        reason = inner[1] if inner else (isinstance(error, OSError) and error.strerror) or str(error)
        fix = FIXES["full" if reason in map(os.strerror, FULL) else action]
        raise ResultError(f"cannot {action} {path}: {reason}", fix=fix) from error
