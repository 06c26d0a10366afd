"""What brings a result back to what it was at a checkpoint, byte for byte, whatever has been written to it since.

When a machine stops, of what was written since the checkpoint any part may be on the disk. So all is kept that is ever
written a second time: everything but full chunks of samples, which stay where they are as they are. What has come
behind the end since is cut off.

If the file could be read before, it can be at every instant while it is brought back: first it says that its run goes
on, and counts no more rows than are to stay; then indices are shortened, from the headers to the leaves; it is cut off
when nothing points behind its end any more.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from cosim.results import attributes
from cosim.results.growing_file import END_OF_FILE, WORD, GrowingFile
from cosim.results.growing_variable import GrowingVariable

Image = Mapping[str, np.ndarray]


def image_of(file: GrowingFile, variables: Sequence[GrowingVariable], rows: int) -> dict[str, np.ndarray]:
    """The image of a file that ends where it is used, as arrays; variables: all over time, with so many rows.

    Raises: OSError, ValueError where the file is damaged.
    """
    full = sorted(span for variable in variables for span in variable.full_chunks(rows))
    spans = np.array([*_between(full, file.end)], np.int64).reshape(-1, 2)
    pieces = b"".join(file.read(begin, end - begin) for begin, end in spans.tolist())
    first = np.array([attributes.status_of(file), *(variable.extent for variable in variables)], np.int64)
    return {"size": np.array(file.end), "first": first, "spans": spans, "bytes": np.frombuffer(pieces, np.uint8)}


def bring_back(file: GrowingFile, image: Image) -> None:
    """Have a file be what its image says. Raises: OSError, KeyError or ValueError for what is no image."""
    content, at = image["bytes"].data, 0
    for begin, end in image["first"].tolist():
        file.write(begin, content[begin:end])  # as no sample lies before them
    for begin, end in image["spans"].tolist():
        piece = content[at : at + end - begin]
        at += end - begin
        if begin == 0:
            file.write(0, piece[:END_OF_FILE])
            file.write(END_OF_FILE + WORD, piece[END_OF_FILE + WORD :])
        else:
            file.write(begin, piece)
    file.end = int(image["size"])
    file.give_back()


def holds(path: Path, mark: str) -> bool:
    """Whether a text is somewhere in a file. Raises: OSError."""
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return False
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return content.find(mark.encode()) >= 0


def _between(spans: Iterable[tuple[int, int]], size: int) -> Iterator[tuple[int, int]]:
    """What lies before, between and behind spans of bytes that are sorted, of so many."""
    at = 0
    for begin, end in spans:
        if begin > at:
            yield at, begin
        at = end
    if size > at:
        yield at, size
