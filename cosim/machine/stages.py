"""The states of a Runge-Kutta stage, out of slopes that lie in memory one vector after the other.

Like `cosim.master.loop`, this is one source for both engines.
"""

from __future__ import annotations

from typing import Any

from cosim.integrators import DENOMINATOR, HEAD
from cosim.machine.memory import reals_at


def move(w: Any, origin: Any, h: float, row: Any, slopes: int, stride: int, total: Any) -> None:
    """w = origin + h/denominator (numerator_1 k_1 + …), element by element; `total` is work space of that size.

    row: as of `Tableau.words`. slopes: the address of k_1, `stride` bytes before the next. `w` is not `origin`.
    """
    began = False
    for i in range(row.size - HEAD):
        weight = row[HEAD + i]
        if weight == 0.0:
            continue
        k = reals_at(slopes + i * stride, w.size)
        if began:
            for j in range(w.size):
                total[j] += weight * k[j]
        else:
            for j in range(w.size):
                total[j] = weight * k[j]
        began = True
    factor = h / row[DENOMINATOR]
    for j in range(w.size):
        w[j] = origin[j] + factor * total[j]
