"""A program's calls as plain Python: the authors' functions over views of the arena, computing as compiled ones do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.engine import faults
from cosim.engine.allocation import Place
from cosim.engine.writer import Call
from cosim.machine.interruption import Interrupted
from cosim.master import tables

TEXT_BYTES = 1024  # of what a function that raised says


@dataclass(frozen=True)
class Interpreted:
    """A function as it is interpreted: with memory of its own; compiled: it computes as compiled functions do."""

    python: Callable[..., Any]
    work: Sequence[np.ndarray]
    compiled: bool


def python_of(
    arena: np.ndarray, call: Call, function: Interpreted, texts: np.ndarray, causes: list[BaseException]
) -> Callable[[float], int]:
    """A call: the author's function over views of the arena, for each instance. Returns a function of the time (s).

    What it raises is left in the frame, with the text in `texts`, and
    kept in `causes`.
    """
    from cosim.compiling.interpreted.arrays import array_view
    from cosim.compiling.interpreted.functions import interpreted  # which takes long to import

    compiled = function.compiled
    arguments = [
        _views(arena, call, compiled, a, p) for a, p in zip(call.function.arguments, call.arguments, strict=True)
    ]
    python = interpreted(function.python) if compiled else function.python
    work = [array_view(array) for array in function.work]

    def run(time: float) -> int:
        instance = 0
        try:
            with np.errstate(all="ignore"):
                for instance in range(call.count):
                    python(*[np.float64(time) if a is None else a[instance]() for a in arguments], *work)
        except Interrupted:  # a user's, of a run that this thread interprets
            raise
        except BaseException as error:  # noqa: BLE001  # an author's exit would be lost, and the run go on
            faults.leave(arena.ctypes.data + call.frame, texts, error, time, instance)
            causes.append(error)
            return tables.ERROR
        return tables.OK

    return run


def _views(arena: np.ndarray, call: Call, compiled: bool, name: str, place: Place | None) -> Any:
    """For each instance, what a function gets for an argument: a number for a read scalar, else an array."""
    from cosim.compiling.interpreted.arrays import array_view
    from cosim.compiling.interpreted.numbers import number

    if place is None:
        return None
    views = [place.view(arena, k) for k in range(call.count)]
    if place.shape == () and name not in call.function.writes:
        return [(lambda view=view: number(view[()]) if compiled else view[()]) for view in views]
    arrays = [view.reshape(1) if place.shape == () else view for view in views]
    for array in arrays:
        array.flags.writeable = name in call.function.writes
    arrays = [array_view(array) for array in arrays] if compiled else arrays
    return [(lambda array=array: array) for array in arrays]
