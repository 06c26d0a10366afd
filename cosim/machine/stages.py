"""The states of an integrator's stage, out of slopes that lie in memory one vector after the other.

Like `cosim.master.loop`, this is one source for both engines.
"""

from __future__ import annotations

from typing import Any

from cosim.integrators import DENOMINATOR, HEAD
from cosim.machine.memory import reals_at


def move(w: Any, origin: Any, h: float, row: Any, slopes: int, stride: int, total: Any) -> None:
    """w = origin + h/denominator (numerator_1 k_1 + …), element by element; `total` is work space of that size.

    `w` is not `origin`; the rest is as of `weigh`.
    """
    weigh(total, row, slopes, stride)
    factor = h / row[DENOMINATOR]
    for j in range(w.size):
        w[j] = origin[j] + factor * total[j]


def weigh(total: Any, row: Any, slopes: int, stride: int) -> None:
    """total = numerator_1 k_1 + …, element by element, of which at least one is not zero.

    row: as of `Tableau.words`. slopes: the address of k_1, `stride` bytes before the next.
    """
    began = False
    for i in range(row.size - HEAD):
        weight = row[HEAD + i]
        if weight == 0.0:
            continue
        k = reals_at(slopes + i * stride, total.size)
        if began:
            for j in range(total.size):
                total[j] += weight * k[j]
        else:
            for j in range(total.size):
                total[j] = weight * k[j]
        began = True
