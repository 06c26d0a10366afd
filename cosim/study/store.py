"""What is done of a study: one file of JSON lines, a line for each finished member, added when it is finished.

A line reaches the operating system at once, so nothing that is finished is lost with the process; it reaches the disk
within a second. A line that is not whole, such as one that a crash of the machine cut off, does not have the checksum
that it ends with: it is skipped, and its member runs again. The file is locked while a study uses it, where the system
has locks: two calls at once would write the same files.
"""

from __future__ import annotations

import errno
import json
import os
import stat
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.errors import ResultError
from cosim.machine import files

SYNC_SECONDS = 1.0


class Store:
    """The rows of finished members, by key; in the file are also those of earlier versions of the study."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
            if not stat.S_ISREG(os.fstat(self._file).st_mode):
                raise OSError(0, "it is no file")
            _lock(self._file)
        except BlockingIOError:
            message = f"another call is at work in {path.parent}"
            raise ResultError(message, fix="wait for it, or choose another folder with --results") from None
        except OSError as error:
            raise ResultError(f"cannot write {path}: {error.strerror}", fix=files.usual_fix(error)) from None
        self._offsets: dict[str, int] = {}
        self._synced = time.monotonic()
        self._end_cut_line()
        for offset, row in self._scan():
            self._offsets[row["key"]] = offset

    def __contains__(self, key: str) -> bool:
        return key in self._offsets

    def __getitem__(self, key: str) -> dict[str, Any]:
        with self.path.open("rb") as file:
            file.seek(self._offsets[key])
            row = _read(file.readline())
        if row is None or row["key"] != key:
            raise ResultError(f"{self.path} was changed while it was in use", fix="run the study again")
        return row

    def append(self, row: dict[str, Any]) -> None:
        """Keep a row, which has a `key`. Raises: ResultError, such as for a full disk."""
        line = _written(row)
        with self._writing():
            written = os.write(self._file, line)
            if written < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._offsets[row["key"]] = os.lseek(self._file, 0, os.SEEK_CUR) - len(line)
            if time.monotonic() - self._synced > SYNC_SECONDS:
                os.fsync(self._file)
                self._synced = time.monotonic()

    def close(self) -> None:
        """Bring everything to the disk and close the file. Raises: ResultError."""
        try:
            with self._writing():
                os.fsync(self._file)
        finally:
            os.close(self._file)

    def _end_cut_line(self) -> None:
        """A line that a crash cut off gets its end, so that the next one begins on its own."""
        size = os.fstat(self._file).st_size
        if size and os.pread(self._file, 1, size - 1) != b"\n":
            with self._writing():
                os.write(self._file, b"\n")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            fix = "free some space; the next call goes on from here"
            raise ResultError(f"cannot write {self.path}: {error.strerror}", fix=fix) from None

    def _scan(self) -> Iterator[tuple[int, dict[str, Any]]]:
        offset = 0
        with self.path.open("rb") as file:
            for line in file:
                row = _read(line)
                if row is not None:
                    yield offset, row
                offset += len(line)


class MemoryStore:
    """The same for a program that keeps the rows itself."""

    def __init__(self) -> None:
        self._rows: dict[str, dict[str, Any]] = {}

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    def __getitem__(self, key: str) -> dict[str, Any]:
        return self._rows[key]

    def append(self, row: dict[str, Any]) -> None:
        """Keep a row, which has a `key`."""
        self._rows[row["key"]] = row

    def close(self) -> None:
        """There is nothing to close."""


def _lock(file: int) -> None:
    """Lock a file until it is closed. Raises: BlockingIOError if somebody else has it."""
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # a file system without locks
        return


def _text(row: dict[str, Any]) -> str:
    return json.dumps(row, ensure_ascii=False, allow_nan=False)


def _written(row: dict[str, Any]) -> bytes:
    """The line of a row: its fields, and last the checksum of their text."""
    return _text({**row, "checksum": _checksum(row)}).encode() + b"\n"


def _read(line: bytes) -> dict[str, Any] | None:
    """The row of a line; None if it is not as it was written."""
    try:
        row = json.loads(line)
        checksum = row.pop("checksum") if isinstance(row, dict) else None
        return row if checksum == _checksum(row) and isinstance(row["key"], str) else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _checksum(row: dict[str, Any]) -> int:
    return zlib.crc32(_text(row).encode())
