"""What brings a result back to what it was at a checkpoint, byte for byte, whatever has been written to it since.

A kill in the midst of a flush leaves HDF5's index half written, and may take rows with it that have long been there. So
all is kept that is ever written a second time: everything but full chunks of samples, which stay where they are as they
are. What has come behind the end since is cut off.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

Image = Mapping[str, np.ndarray]


def image_of(path: Path, variables: Iterable[Any], rows: int) -> dict[str, np.ndarray]:
    """The image of a file that is flushed, as arrays; variables: h5py's, over time, with so many rows.

    Raises: OSError.
    """
    pieces = []
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        spans = np.array([*_between(sorted(_full_chunks(variables, rows)), size)], np.int64).reshape(-1, 2)
        for begin, end in spans.tolist():
            file.seek(begin)
            pieces.append(file.read(end - begin))
    return {"size": np.array(size), "spans": spans, "bytes": np.frombuffer(b"".join(pieces), np.uint8)}


def bring_back(path: Path, image: Image) -> None:
    """Have a file be what its image says. Raises: OSError, KeyError or ValueError for what is no image."""
    at = 0
    with path.open("r+b") as file:
        for begin, end in image["spans"].tolist():
            file.seek(begin)
            file.write(image["bytes"][at : at + end - begin].tobytes())
            at += end - begin
        file.truncate(int(image["size"]))


def holds(path: Path, mark: str) -> bool:
    """Whether a text is somewhere in a file. Raises: OSError."""
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return False
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return content.find(mark.encode()) >= 0


def _full_chunks(variables: Iterable[Any], rows: int) -> Iterator[tuple[int, int]]:
    """The first byte of each chunk in which all rows are written, and the one behind its last."""
    for variable in variables:
        found: list[Any] = []
        variable.id.chunk_iter(found.append)
        for chunk in found:
            if chunk.chunk_offset[0] + variable.chunks[0] <= rows:
                yield chunk.byte_offset, chunk.byte_offset + chunk.size


def _between(spans: Iterable[tuple[int, int]], size: int) -> Iterator[tuple[int, int]]:
    """What lies before, between and behind spans of bytes that are sorted, of so many."""
    at = 0
    for begin, end in spans:
        if begin > at:
            yield at, begin
        at = end
    if size > at:
        yield at, size
