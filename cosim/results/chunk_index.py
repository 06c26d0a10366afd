"""Where the chunks of a dataset over time lie: an HDF5 B-tree that only ever grows at its right-hand end.

HDF5 itself, when a node is full, moves half of it to a new one; a kill in between leaves an index in which it finds
nothing. But rows come one behind the other, so no node has to be split: a full one stays as it is, and its new right
neighbour is entered in the node above; where there is none above, a new root gets both, and the dataset points to that
one. At every instant the index is whole:

    an entry      is written behind those that its node counts, then counted
    a node        is written where nothing points to, with its first entry, then entered in the node above
    a root        likewise, then pointed to by the dataset's header

A node says that its last entry reaches to END, whichever are to come, so that none above it changes when it gets one.
Version 1, node type 1, of *HDF5 File Format Specification Version 3.0*, III.A.1:

    "TREE" | type | level | entries | left, right neighbour | key 0 | child 0 | key 1 | … | child 63 | key 64

where a key has the size of a chunk, and of which element it is the first.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from cosim.results.growing_file import WORD, GrowingFile
from cosim.results.object_header import ChunkedDataset

CAPACITY = 64
"""Entries of a node."""
END = 2**40
"""The number of a chunk that never comes."""
_HEAD = struct.Struct("<4sBBHQQ")
_COUNT, _RIGHT = 6, 16  # where a node counts its entries, and where it names its right neighbour
_SIGNATURE, _CHUNKS, _NOWHERE = b"TREE", 1, 2**64 - 1


@dataclass
class _Node:
    at: int
    count: int


class ChunkIndex:
    """The index of a dataset. chunks: their addresses, in the order of time."""

    def __init__(self, file: GrowingFile, dataset: ChunkedDataset) -> None:
        """The one that a dataset has, or none yet. Raises: OSError, ValueError where it is damaged."""
        self._file, self._dataset = file, dataset
        self._key = struct.Struct(f"<II{1 + dataset.axes}Q")
        self._entry_bytes = self._key.size + WORD
        self._node_bytes = _HEAD.size + CAPACITY * self._entry_bytes + self._key.size
        self._path: dict[int, _Node] = {}
        """The last node of each level; the leaf is 0."""
        root = file.word(dataset.index)
        self.chunks = [] if root == _NOWHERE else [*self._found(root)]

    def begin(self) -> None:
        """Make one without entries. Raises: OSError."""
        self._path[0] = self._new(0)
        self._file.set_word(self._dataset.index, self._path[0].at)

    def append(self, chunk: int) -> None:
        """Enter a chunk whose bytes are in the file. Raises: OSError, and then the chunk may be appended again."""
        self._append(0, len(self.chunks), chunk)
        self.chunks.append(chunk)

    def bytes_for(self, more: int) -> int:
        """What entries for so many chunks take."""
        before, after = (_nodes(len(self.chunks) + new) for new in (0, more))
        return (after - before) * self._node_bytes

    def _append(self, level: int, number: int, child: int) -> None:
        """Give the last node of a level another child, which begins with a chunk of that number."""
        node = self._path[level]
        if node.count < CAPACITY:
            at = node.at + _HEAD.size + node.count * self._entry_bytes
            self._file.write(at + self._key.size, child.to_bytes(WORD, "little") + self._key_of(END))
            self._file.set_word(at + WORD, number * self._dataset.chunk_rows)  # of the key that was the last
            self._file.write(node.at + _COUNT, (node.count + 1).to_bytes(2, "little"))
            node.count += 1
            return
        right = self._new(level, (number, child), left=node.at)
        self._file.set_word(node.at + _RIGHT, right.at)
        if level + 1 in self._path:
            self._append(level + 1, number, right.at)
        else:
            root = self._new(level + 1, (0, node.at), (number, right.at))
            self._file.set_word(self._dataset.index, root.at)
            self._path[level + 1] = root
        self._path[level] = right

    def _new(self, level: int, *entries: tuple[int, int], left: int = _NOWHERE) -> _Node:
        """A node that nothing points to yet; entries: of each the number of its first chunk, and the child."""
        head = _HEAD.pack(_SIGNATURE, _CHUNKS, level, len(entries), left, _NOWHERE)
        body = b"".join(self._key_of(number) + child.to_bytes(WORD, "little") for number, child in entries)
        at = self._file.take(self._node_bytes)
        self._file.write(at, (head + body + self._key_of(END)).ljust(self._node_bytes, b"\0"))
        return _Node(at, len(entries))

    def _key_of(self, number: int) -> bytes:
        """The key of a chunk: of its first element, the row, and 0 for all other axes and the bytes of the element."""
        dataset = self._dataset
        return self._key.pack(dataset.chunk_bytes, 0, number * dataset.chunk_rows, *[0] * dataset.axes)

    def _found(self, at: int, below: int | None = None) -> Iterator[int]:
        """The chunks under a node, which is below one of some level; the last nodes are kept. Raises: ValueError."""
        content = self._file.read(at, self._node_bytes)
        signature, kind, level, count, _, _ = _HEAD.unpack_from(content)
        sound = (signature, kind) == (_SIGNATURE, _CHUNKS) and count <= CAPACITY
        if not sound or below not in (None, level + 1):
            raise ValueError("it is damaged")
        self._path[level] = _Node(at, count)
        for k in range(count):
            (child,) = struct.unpack_from("<Q", content, _HEAD.size + k * self._entry_bytes + self._key.size)
            if level:
                yield from self._found(child, level)
            else:
                yield child


def _nodes(chunks: int) -> int:
    """How many nodes so many chunks need."""
    total = level = max(1, -(-chunks // CAPACITY))
    while level > 1:
        level = -(-level // CAPACITY)
        total += level
    return total
