"""The table of what an FMU is asked for along tangents, see `cosim.fmu.tangents`; and of which functions it is asked.

FMI has derivatives of real numbers only, by inputs that may change now. So inputs of other types count as held, and
other outputs as they were; where Model Exchange is not at an event, so do discrete outputs, which depend on nothing
there. A function that reads a discrete real input of Model Exchange, whose change is an event, is evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.fmu import fields

_REAL = (fields.FLOAT64, fields.FLOAT32)


def derives(fmu: Any, component: Any, function: Any) -> bool:
    """Whether an FMU gives directional derivatives of what a function of its block computes."""
    knowns, asked, _ = _numbers(fmu, component, function, [n for n in function.arguments if n in function.writes])
    return bool(knowns and asked)


def _numbers(fmu: Any, component: Any, function: Any, outputs: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    """The inputs by which to ask, the outputs to ask for, and those that stay as they are; empty where not to ask."""
    if not fmu.interface.providesDirectionalDerivative or function.kind not in ("outputs", "initial"):
        return [], [], []
    smooth = fmu.kind == fields.MODEL_EXCHANGE and function.kind == "outputs"
    varying = ("continuous",) if smooth else ("continuous", "discrete")
    real = {name for name, port in fmu.ports.items() if port.code in _REAL}
    moving = {name for name in real if fmu.ports[name].first.variability in varying}
    knowns = [n for n in function.reads if n in component.wires and n in real]
    if not moving.issuperset(knowns):
        return [], [], []
    asked = [n for n in outputs if n in moving]
    return knowns, asked, [n for n in outputs if n in real - moving]


class TangentTable:
    """Of one call. outputs: those that it gives. slots: of all. keep: what lives as long as the table does.

    address: of the table; 0 where the call is evaluated as ever.
    """

    def __init__(
        self, fmu: Any, component: Any, call: Any, outputs: Sequence[str], slots: Mapping[str, int], keep: list[Any]
    ) -> None:
        self._fmu = fmu
        self._slots = slots
        self._keep = keep
        self.address = 0
        knowns, asked, held = _numbers(fmu, component, call.function, outputs)
        if not knowns or not asked:
            return
        n, m, most = self._size(knowns), self._size([*asked, *held]), self._size(asked)
        table = self._kept(np.zeros(fields.TANGENT_WORDS, np.int64))
        table[fields.KNOWN_NUMBERS], table[fields.UNKNOWN_NUMBERS], table[fields.ASKED] = n, m, most
        table[fields.KNOWN_PARTS], table[fields.N_KNOWN_PARTS] = self._parts(knowns)
        table[fields.UNKNOWN_PARTS], table[fields.N_UNKNOWN_PARTS] = self._parts([*asked, *held])
        table[fields.KNOWN_REFERENCES], table[fields.N_KNOWN_REFERENCES] = self._references(knowns)
        table[fields.UNKNOWN_REFERENCES], table[fields.N_UNKNOWN_REFERENCES] = self._references(asked)
        table[fields.SEED], table[fields.SENSITIVITY] = (self._kept(np.zeros(k)).ctypes.data for k in (n, m))
        table[fields.POINTS] = self._kept(np.zeros(component.count * (n + m))).ctypes.data
        self.address = table.ctypes.data

    def _size(self, names: Sequence[str]) -> int:
        return sum(self._fmu.ports[name].size for name in names)

    def _parts(self, names: Sequence[str]) -> tuple[int, int]:
        ports = [self._fmu.ports[name] for name in names]
        rows = [(self._slots[n], p.size, p.code == fields.FLOAT32) for n, p in zip(names, ports, strict=True)]
        return self._kept(np.array(rows, np.int64)).ctypes.data, len(rows)

    def _references(self, names: Sequence[str]) -> tuple[int, int]:
        references = np.array([r for name in names for r in self._fmu.ports[name].references], np.uint32)
        return self._kept(references).ctypes.data, len(references)

    def _kept(self, array: np.ndarray) -> np.ndarray:
        self._keep.append(array)
        return array
