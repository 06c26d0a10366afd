"""A file that grows at its end, and in which no more than a word at a time is changed that is in use.

A process that is killed leaves of a longer write what lies before the end of a page; of a word that lies in one page it
leaves the one before or the new one. So what is new is written where nothing points to, and then pointed to by a word.

HDF5's head (superblock, version 0) has the file's size. It is never more than there is on the disk, nor less than what
is pointed to: HDF5 opens no file that ends before its head says so, and reads nothing behind that.
"""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import IO

from cosim.machine.files import FULL

WORD = 8
"""Bytes of a number, an address or a size, little-endian; blocks begin at multiples of it."""
END_OF_FILE = 40
"""Where the head has the file's size."""
ROOT_HEADER = 64
"""Where the head has the address of the root group's object header."""
CLOSING_BYTES = 64 * 1024
"""Set aside beyond what is asked for, so that on a full disk there is room for how the run ended."""


class GrowingFile:
    """A file of HDF5's earliest format. end: where the next block begins, all before it being in use."""

    def __init__(self, file: IO[bytes], end: int) -> None:
        """file: unbuffered and open for reading and writing, or in memory."""
        self._file = file
        self.end = _aligned(end)

    def take(self, size: int) -> int:
        """The address of a new block of so many bytes, which nothing points to yet."""
        at = self.end
        self.end = _aligned(at + size)
        return at

    def read(self, at: int, size: int) -> bytes:
        """So many bytes. Raises: OSError, ValueError where the file has no more."""
        self._file.seek(at)
        found = self._file.read(size)
        if len(found) < size:
            raise ValueError("it is damaged")
        return found

    def write(self, at: int, content: bytes | memoryview) -> None:
        """Put bytes where they belong. Raises: OSError."""
        self._file.seek(at)
        rest = memoryview(content)
        while rest:
            rest = rest[self._file.write(rest) :]

    def word(self, at: int) -> int:
        """The number in a word. Raises: OSError, ValueError."""
        return int.from_bytes(self.read(at, WORD), "little")

    def set_word(self, at: int, number: int) -> None:
        """Have a word be a number, at once. Raises: OSError."""
        self.write(at, number.to_bytes(WORD, "little"))

    def reserve(self, size: int) -> None:
        """Have the disk set aside so much for what is taken next, and for closing. Raises: OSError.

        What was set aside before remains so.
        """
        size += CLOSING_BYTES
        try:
            os.posix_fallocate(self._file.fileno(), self.end, size)
        except (AttributeError, OSError) as error:
            if getattr(error, "errno", None) in FULL:
                self._file.truncate(self.word(END_OF_FILE))  # a part may have been set aside
                raise
            # This system, or this file system, cannot reserve; it can still say what is left.
            if shutil.disk_usage(Path(self._file.name).parent).free < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
            if self._file.seek(0, os.SEEK_END) < self.end + size:
                self._file.truncate(self.end + size)
        if self.word(END_OF_FILE) < self.end + size:
            self.set_word(END_OF_FILE, self.end + size)

    def give_back(self) -> None:
        """Cut off what was set aside and is not used. Raises: OSError."""
        self.set_word(END_OF_FILE, self.end)
        self._file.truncate(self.end)

    def sync(self) -> None:
        """Have it all on the disk. Raises: OSError."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def closed(self) -> bool:
        """Whether it is."""
        return self._file.closed


def _aligned(size: int) -> int:
    return -(-size // WORD) * WORD
