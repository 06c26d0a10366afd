"""Texts of any length in an HDF5 file: an attribute has the place of one, so that it is changed by a few bytes.

A collection of the global heap (version 1), of *HDF5 File Format Specification Version 3.0*, III.E:

    "GCOL" | version | size || number of a text | references | size | text, to a multiple of 8 || … || 0 | 0 | free
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

_LEAST = 4096  # bytes, by the specification
_HEAD, _OBJECT = struct.Struct("<4sB3xQ"), struct.Struct("<HH4xQ")


def collection(texts: Sequence[bytes]) -> bytes:
    """The bytes of a collection; its texts are numbered from 1."""
    parts = [_OBJECT.pack(number, 1, len(text)) + _padded(text) for number, text in enumerate(texts, 1)]
    used = _HEAD.size + sum(map(len, parts))
    size = max(_LEAST, used + _OBJECT.size)
    return b"".join((_HEAD.pack(b"GCOL", 1, size), *parts, _OBJECT.pack(0, 0, size - used))).ljust(size, b"\0")


def place(address: int, number: int, text: bytes) -> bytes:
    """What an attribute has of a text in the collection at an address."""
    return struct.pack("<IQI", len(text), address, number) if text else bytes(16)


def _padded(text: bytes) -> bytes:
    return text.ljust(-(-len(text) // 8) * 8, b"\0")
