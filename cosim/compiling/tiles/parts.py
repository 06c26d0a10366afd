"""What a tile is: a function's arguments of eight members, in which an element of all eight stands in one row."""

from __future__ import annotations

from dataclasses import dataclass

MEMBERS = 8  # on every processor, so that its vectors are no part of what is computed
LEAST = 3  # members that are worth a tile
LARGEST = 128  # elements of all arguments, of one member


@dataclass(frozen=True)
class TilePart:
    """An argument of a function in a tile: so many elements from an offset (bytes) on; slot: its word in the frame."""

    kind: str
    itemsize: int
    elements: int
    offset: int
    slot: int
    written: bool

    @property
    def end(self) -> int:
        """The first byte behind it at which vectors may stand."""
        return self.offset + -(-self.elements * MEMBERS * self.itemsize // 64) * 64
