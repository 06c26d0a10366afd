"""What is done of a study: one file of JSON lines, a line for each finished member, added when it is finished.

A line reaches the operating system at once, so nothing that is finished is lost with the process; it reaches the disk
within a second. Several processes may append: a line is written in one piece. A line that was cut off (by a crash of
the machine) is skipped, and its member runs again.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim.errors import ResultError

SYNC_SECONDS = 1.0


class Store:
    """The rows of finished members, by key; in the file are also those of earlier versions of the study."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            fix = "choose a folder that you may write to"
            raise ResultError(f"cannot write {path}: {error.strerror}", fix=fix) from None
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
            return json.loads(file.readline())

    def append(self, row: dict[str, Any]) -> None:
        """Keep a row, which has a `key`. Raises: ResultError, such as for a full disk."""
        line = json.dumps(row, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        try:
            written = os.write(self._file, line)
            if written < len(line):
                raise OSError(28, "No space left on device")
            self._offsets[row["key"]] = os.lseek(self._file, 0, os.SEEK_CUR) - len(line)
            if time.monotonic() - self._synced > SYNC_SECONDS:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            fix = "free some space; the next call goes on from here"
            raise ResultError(f"cannot write {self.path}: {error.strerror}", fix=fix) from None

    def close(self) -> None:
        """Bring everything to the disk and close the file."""
        os.fsync(self._file)
        os.close(self._file)

    def _end_cut_line(self) -> None:
        """A line that a crash cut off gets its end, so that the next one begins on its own."""
        size = os.fstat(self._file).st_size
        if size and os.pread(self._file, 1, size - 1) != b"\n":
            os.write(self._file, b"\n")

    def _scan(self) -> Iterator[tuple[int, dict[str, Any]]]:
        offset = 0
        with self.path.open("rb") as file:
            for line in file:
                try:
                    row = json.loads(line)
                    if isinstance(row, dict) and "key" in row:
                        yield offset, row
                except ValueError:
                    pass
                offset += len(line)
