"""A recorded variable in a growing file: rows are written behind those that are there, and counted only then."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cosim.results.chunk_index import ChunkIndex
from cosim.results.growing_file import WORD, GrowingFile
from cosim.results.object_header import ChunkedDataset
from cosim.results.recorded import Array


class GrowingVariable:
    """One of a file. header: the address of its object header. extent: where its count of rows begins and ends.

    Raises: OSError, ValueError where the file is damaged.
    """

    def __init__(self, file: GrowingFile, header: int) -> None:
        dataset = ChunkedDataset.at(file, header)
        self.extent = dataset.extent, dataset.extent + WORD
        self._file, self.header = file, header
        self._chunk_rows, self._chunk_bytes = dataset.chunk_rows, dataset.chunk_bytes
        self._row_bytes = dataset.chunk_bytes // dataset.chunk_rows
        self.index = ChunkIndex(file, dataset)

    def write(self, first: int, rows: Array) -> None:
        """Put rows where they belong, which are not counted yet, the first of them by its number. Raises: OSError."""
        content = np.ascontiguousarray(rows).reshape(-1).view(np.uint8).data
        at = 0
        while at < len(content):
            number, offset = divmod(first * self._row_bytes + at, self._chunk_bytes)
            piece = content[at : at + self._chunk_bytes - offset]
            known = number < len(self.index.chunks)
            chunk = self.index.chunks[number] if known else self._file.take(self._chunk_bytes)
            self._file.write(chunk + offset, piece)
            if not known:
                self.index.append(chunk)
            at += len(piece)

    def count(self, rows: int) -> None:
        """Have the file say that there are so many rows. Raises: OSError."""
        self._file.set_word(self.extent[0], rows)

    @property
    def counted(self) -> int:
        """How many rows the file says there are. Raises: OSError."""
        return self._file.word(self.extent[0])

    def read(self, first: int, last: int) -> bytes:
        """The rows first … last-1. Raises: OSError, ValueError."""
        return b"".join(self._pieces(first * self._row_bytes, last * self._row_bytes))

    def bytes_for(self, rows: int) -> int:
        """What the file takes at most to grow to so many rows."""
        more = max(0, -(-rows // self._chunk_rows) - len(self.index.chunks))
        return more * (self._chunk_bytes + WORD) + self.index.bytes_for(more)

    def full_chunks(self, rows: int) -> Iterator[tuple[int, int]]:
        """The first byte of each chunk that so many rows fill, and the one behind its last."""
        for chunk in self.index.chunks[: rows // self._chunk_rows]:
            yield chunk, chunk + self._chunk_bytes

    def _pieces(self, at: int, end: int) -> Iterator[bytes]:
        while at < end:
            number, offset = divmod(at, self._chunk_bytes)
            if number >= len(self.index.chunks):
                raise ValueError("it is damaged")
            size = min(end - at, self._chunk_bytes - offset)
            yield self._file.read(self.index.chunks[number] + offset, size)
            at += size
