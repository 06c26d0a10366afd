"""Space on the disk, set aside before HDF5 writes: when a write fails, HDF5 loses the file, and then its process.

The head of the file says at once that the space is part of it. HDF5 says so only after all else, and a kill before that
would leave an index that points behind the end: a file that nobody opens any more.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import Any

from cosim.results.result_errors import FULL

INDEX_BYTES, NODE_BYTES = 256, 8 * 1024  # at most, of HDF5's index: for a chunk, and for a new node
CLOSING_BYTES = 256 * 1024  # for the attributes written last
END_OF_FILE = 40  # where the earliest format's head has the file's size, as 8 bytes


def reserve(file: Any, variables: Sequence[Any], count: int, rows: int) -> tuple[int, OSError | None]:
    """Have the disk set aside what `rows` more than `count` rows take, or fewer. Returns how many, and why not all."""
    full = None
    while True:
        try:
            _set_aside(file, _needed(variables, count, count + rows))
        except OSError as error:
            if error.errno not in FULL:
                raise
            full = full or error
            if not rows:
                return 0, full
            rows //= 2
        else:
            return rows, full


def reserve_bytes(file: Any, size: int) -> None:
    """Have the disk set aside so much for attributes. Raises: OSError."""
    _set_aside(file, CLOSING_BYTES + 2 * size)


def give_back(file: Any) -> None:
    """Cut off what was set aside and is not used."""
    _end_at(file, file.id.get_filesize())


def _needed(variables: Sequence[Any], before: int, after: int) -> int:
    """The bytes that rows `before` … `after`-1 take, and then the closing attributes."""
    size = CLOSING_BYTES
    for variable in variables:
        rows = variable.chunks[0]
        chunks = -(-after // rows) - -(-before // rows)
        size += chunks * (prod(variable.chunks) * variable.dtype.itemsize + INDEX_BYTES) + NODE_BYTES
    return size


def _set_aside(file: Any, size: int) -> None:
    """Raises: OSError."""
    descriptor, end = file.id.get_vfd_handle(), file.id.get_filesize()
    try:
        os.posix_fallocate(descriptor, end, size)
    except (AttributeError, OSError) as error:
        if getattr(error, "errno", None) in FULL:
            _end_at(file, end)  # a part may have been set aside
            raise
        # This system, or this file system, cannot reserve; it can still say what is left.
        if shutil.disk_usage(Path(file.filename).parent).free < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
    _end_at(file, end + size)


def _end_at(file: Any, size: int) -> None:
    """Have the file and its head agree on a size; at no instant does the head say more than there is."""
    descriptor = file.id.get_vfd_handle()
    if os.fstat(descriptor).st_size < size:
        os.ftruncate(descriptor, size)
    if hasattr(os, "pwrite"):  # any other way to write there moves HDF5's own place in the file
        os.pwrite(descriptor, size.to_bytes(8, "little"), END_OF_FILE)
    os.ftruncate(descriptor, size)
