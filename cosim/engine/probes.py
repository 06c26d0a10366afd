"""What is copied out along a run: groups of signals, each every so many ticks, into buffers that the loop fills."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.engine.program import Program
from cosim.master import tables
from cosim.wiring.network import Signal

BUFFER_BYTES = 4_000_000


@dataclass(frozen=True)
class Probes:
    """Signals that are copied out together every so many ticks."""

    signals: tuple[Signal, ...]
    every: int = 1


@dataclass
class Samples:
    """What one group of probes saw in one batch: times (k,) in s, and an array (k, *shape) for each signal."""

    times: np.ndarray
    values: dict[Signal, np.ndarray]


@dataclass(frozen=True)
class Column:
    """A signal's column in the buffer of a group of probes: how many words a row has, and what is in them."""

    signal: Signal
    words: int
    stored: tuple[int, ...]
    shape: tuple[int, ...]
    dtype: np.dtype

    def of(self, rows: np.ndarray) -> np.ndarray:
        """The signal's values (k, *shape) in the rows (k, words), as a view; all have what is stored once."""
        size = math.prod(self.stored)
        found = rows.view(self.dtype)[:, :size].reshape(len(rows), *self.stored)
        if self.stored == self.shape:
            return found
        return np.broadcast_to(found[:, None], (len(rows), *self.shape))


class Buffers:
    """What all groups hold, column by column, as the loop fills them; words: zeroed words that a run's processes share.

    groups, rows: the tables that the loop reads, see `cosim.master.loop`.
    """

    def __init__(
        self,
        program: Program,
        arena: np.ndarray,
        probes: Sequence[Probes],
        ticks: int,
        words: Callable[..., np.ndarray],
    ) -> None:
        self.arrays: list[np.ndarray] = []
        self._columns: list[list[Column]] = []
        groups, rows = list[list[int]](), list[list[int]]()
        for group in probes:
            begin = len(rows)
            columns = _columns(program, arena, group.signals)
            rows += [[program.places[c.signal].offset, c.words] for c in columns]
            width = 1 + sum(c.words for c in columns)
            capacity = max(1, min(BUFFER_BYTES // (8 * width), ticks // group.every + 1))
            buffer = words(width * (capacity + 1))  # an event that ends the run may come in between
            self.arrays.append(buffer)
            self._columns.append(columns)
            groups.append([group.every, begin, len(rows), 0, buffer.ctypes.data, capacity])
        self.groups = words(len(groups), tables.GROUP_WORDS)
        self.groups[:] = np.array(groups, np.int64).reshape(self.groups.shape)
        self.rows = np.array(rows, np.int64).reshape(-1, tables.PROBE_WORDS)

    def take(self) -> list[Samples]:
        """What the groups hold, which makes room for more; valid until the loop goes on."""
        result = []
        for row, buffer, columns in zip(self.groups, self.arrays, self._columns, strict=True):
            room = int(row[tables.CAPACITY]) + 1
            filled = min(max(0, int(row[tables.FILLED])), room)  # a crash may have left any number
            row[tables.FILLED] = 0
            values, begin = dict[Signal, np.ndarray](), room
            for column in columns:
                end = begin + room * column.words
                values[column.signal] = column.of(buffer[begin:end].reshape(room, column.words)[:filled])
                begin = end
            result.append(Samples(buffer[:filled].view(np.float64).copy(), values))
        return result


def _columns(program: Program, arena: np.ndarray, signals: Sequence[Signal]) -> list[Column]:
    """The columns of signals, in this order."""
    columns = []
    for signal in signals:
        stored = program.stored(signal, arena)
        words = -(-stored.nbytes // 8)
        columns.append(Column(signal, words, stored.shape, program.network.shape(signal), stored.dtype))
    return columns
