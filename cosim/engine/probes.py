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
    """Where a signal is in the rows of a group of probes."""

    signal: Signal
    words: slice
    stored: tuple[int, ...]
    shape: tuple[int, ...]
    dtype: np.dtype

    def of(self, rows: np.ndarray) -> np.ndarray:
        """The signal's values (k, *shape) in the rows (k, words), as a view; all have what is stored once."""
        size = math.prod(self.stored)
        found = rows[:, self.words].view(self.dtype)[:, :size].reshape(len(rows), *self.stored)
        if self.stored == self.shape:
            return found
        return np.broadcast_to(found[:, None], (len(rows), *self.shape))


class Buffers:
    """The rows of all groups, as the loop fills them; words: zeroed words that a run's processes share.

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
            columns, width = _columns(program, arena, group.signals)
            rows += [[program.places[c.signal].offset, c.words.stop - c.words.start] for c in columns]
            capacity = max(1, min(BUFFER_BYTES // (8 * width), ticks // group.every + 1))
            buffer = words(capacity + 1, width)  # an event that ends the run may come in between
            self.arrays.append(buffer)
            self._columns.append(columns)
            groups.append([group.every, begin, len(rows), width, 0, buffer.ctypes.data, capacity])
        self.groups = words(len(groups), tables.GROUP_WORDS)
        self.groups[:] = np.array(groups, np.int64).reshape(self.groups.shape)
        self.rows = np.array(rows, np.int64).reshape(-1, tables.PROBE_WORDS)

    def take(self) -> list[Samples]:
        """What the groups hold, which makes room for more; valid until the loop goes on."""
        result = []
        for row, buffer, columns in zip(self.groups, self.arrays, self._columns, strict=True):
            filled = min(max(0, int(row[tables.FILLED])), len(buffer))  # a crash may have left any number
            row[tables.FILLED] = 0
            values = {column.signal: column.of(buffer[:filled]) for column in columns}
            result.append(Samples(buffer[:filled, 0].view(np.float64).copy(), values))
        return result


def _columns(program: Program, arena: np.ndarray, signals: Sequence[Signal]) -> tuple[list[Column], int]:
    """Where each signal is in a row, after the time; and how many words a row has."""
    columns, width = list[Column](), 1
    for signal in signals:
        stored = program.stored(signal, arena)
        span = slice(width, width - (-stored.nbytes // 8))
        columns.append(Column(signal, span, stored.shape, program.network.shape(signal), stored.dtype))
        width = span.stop
    return columns, width
