"""What a fingerprint is made from: a hash that is fed with values.

What may be reached twice has a number, and is fed when its turn comes: so circles end, and long roads need no deep
recursion.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np


class NoEnd(Exception):
    """A road that cannot be followed to its end."""


_GROUND: dict[type, Callable[[Any], str | bytes]] = {
    type(None): str,
    type(...): str,
    type(NotImplemented): str,
    bool: str,
    int: hex,
    float: lambda value: struct.pack("<d", value),
    complex: lambda value: struct.pack("<dd", value.real, value.imag),
    str: str,
    bytes: bytes,
    range: str,
}


class Feed:
    """A hash; alone: gives the digest of a value that is fed to another one. reached: what has got a number."""

    def __init__(self, alone: Callable[[Any], bytes]) -> None:
        self.reached: list[Any] = []
        self._alone = alone
        self._hash = hashlib.sha256()
        self._numbers: dict[int, int] = {}

    def digest(self) -> bytes:
        """Of all that has been fed."""
        return self._hash.digest()

    def put(self, *parts: str | bytes | int) -> None:
        """Parts as they are, each so that it cannot run into the next."""
        for part in parts:
            data = part if isinstance(part, bytes) else str(part).encode("utf-8", "surrogatepass")
            self._hash.update(b"%d:" % len(data) + data)

    def all(self, kind: str, values: Iterable[Any]) -> None:
        """Values in their order, under the name of what holds them."""
        values = list(values)
        self.put(kind, len(values))
        for value in values:
            self.value(value)

    def value(self, value: Any) -> None:
        """Plain data at once, anything else by its number in `reached`."""
        kind = type(value)
        if kind in _GROUND:
            self.put(kind.__name__, _GROUND[kind](value))
        elif kind is tuple:
            self.all("tuple", value)
        elif kind is slice:
            self.all("slice", (value.start, value.stop, value.step))
        elif kind in (frozenset, set):
            self._unordered(kind.__name__, value)
        elif isinstance(value, np.dtype):
            self.all("dtype", value.__reduce__()[1:])
        elif kind is np.ndarray and not value.dtype.hasobject:
            self._array(value)
        elif isinstance(value, np.generic) and not value.dtype.hasobject:
            self.value(value.dtype)
            self.put("scalar", value.tobytes())
        else:
            if id(value) not in self._numbers:
                self._numbers[id(value)] = len(self.reached)
                self.reached.append(value)
            self.put("object", self._numbers[id(value)])

    def _unordered(self, kind: str, values: Iterable[Any]) -> None:
        """The elements of a set come in an order that differs between processes."""
        digests = sorted(map(self._alone, values))
        self.put(kind, len(digests), *digests)

    def _array(self, value: np.ndarray) -> None:
        flags = value.flags
        self.value(value.dtype)
        self.all("array", (*value.shape, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned))
        self.put(value.tobytes())
