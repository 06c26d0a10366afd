"""Whether HDF5 gets through the structure of a file: in a damaged one it may go round for ever, or crash.

It is deaf to all signals but SIGKILL then, so a child looks first, once at a file as it is. What the child has is
processor time: a slow disk does no harm.
"""

from __future__ import annotations

import faulthandler
import os
import warnings
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

WALK_SECONDS = 5  # of processor time, in which HDF5 finds millions of chunks


def can_be_read(path: Path) -> bool:
    """Whether a file may be opened at all; errors that HDF5 reports are left to the caller, who meets them again."""
    if not hasattr(os, "fork"):
        return True
    try:
        about = path.stat()
    except OSError:  # which the caller meets too
        return True
    return _is_walked(path, about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns)


@lru_cache(maxsize=64)
def _is_walked(path: Path, *_version: int) -> bool:
    from signal import SIGKILL

    with warnings.catch_warnings():
        # Python 3.12 warns of other threads' locks; the child uses none but h5py's, which h5py takes over a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        with suppress(BaseException):
            _walk(path)
        os._exit(0)
    try:
        return not os.WIFSIGNALED(os.waitpid(child, 0)[1])
    except ChildProcessError:  # whoever started this process has the system forget its children
        return True
    except BaseException:
        os.kill(child, SIGKILL)
        os.waitpid(child, 0)
        raise


def _walk(path: Path) -> None:
    """Read all of a file but its samples, in a process that dies of it without a word where there is no end."""
    import resource

    import h5py

    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (WALK_SECONDS, WALK_SECONDS))
    with h5py.File(path, "r", locking=False) as file:
        for thing in (file, *file.values()):
            list(thing.attrs.items())
            if getattr(thing, "chunks", None):
                thing.id.get_num_chunks()
