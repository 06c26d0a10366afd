"""The header of an HDF5 object, where the words of it lie that change: how many rows there are, where their index is.

Version 1, of *HDF5 File Format Specification Version 3.0*, IV.A.1.a, which has no checksum and whose messages begin at
multiples of 8 bytes, so that a word of one can be changed by itself.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from cosim.results.growing_file import GrowingFile

_DATASPACE, _LAYOUT, _ATTRIBUTE, _CONTINUATION = 0x0001, 0x0008, 0x000C, 0x0010
_DIMENSIONS = 8  # bytes of a dataspace before its dimensions


@dataclass(frozen=True)
class ChunkedDataset:
    """A dataset in chunks (layout of version 3). extent, index: where its number of rows is, and its index' address.

    The latter is no multiple of 8. Where a page ends in it, that is in front of its last three bytes, which are 0 in a
    file of less than 1 TB.
    """

    extent: int
    index: int
    axes: int
    chunk_rows: int
    chunk_bytes: int

    @classmethod
    def at(cls, file: GrowingFile, header: int) -> ChunkedDataset:
        """The one of a header. Raises: OSError, ValueError where there is none."""
        (extent,), (layout,) = _messages(file, header, _DATASPACE), _messages(file, header, _LAYOUT)
        version, storage, numbers = file.read(layout, 3)
        if (version, storage) != (3, 2):
            raise ValueError("it is damaged")
        rows, *others = struct.unpack(f"<{numbers}I", file.read(layout + 11, 4 * numbers))
        size = rows
        for other in others:  # the size of an element is the last
            size *= other
        return cls(extent + _DIMENSIONS, layout + 3, numbers - 1, rows, size)


def attributes_of(file: GrowingFile, header: int) -> dict[str, int]:
    """Where the value of each attribute is, of those in version 1. Raises: OSError, ValueError."""
    found = {}
    for at in _messages(file, header, _ATTRIBUTE):
        version, *sizes = struct.unpack("<Bx3H", file.read(at, 8))
        if version == 1:
            name, kind, space = (-(-size // 8) * 8 for size in sizes)
            found[file.read(at + 8, sizes[0] - 1).decode()] = at + 8 + name + kind + space
    return found


def _messages(file: GrowingFile, header: int, wanted: int) -> Iterator[int]:
    """Where the messages of a kind begin, without what is said of each."""
    version, size = struct.unpack("<B7xI4x", file.read(header, 16))
    if version != 1:
        raise ValueError("its object headers are not of version 1")
    blocks = [(header + 16, size)]
    for at, length in blocks:
        end = at + length
        while at < end:
            kind, size = struct.unpack("<HH4x", file.read(at, 8))
            if kind == _CONTINUATION:
                blocks.append(struct.unpack("<QQ", file.read(at + 8, 16)))
            elif kind == wanted:
                yield at + 8
            at += 8 + size  # noqa: PLW2901
