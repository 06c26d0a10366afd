"""The table of how the inputs of a block go on in a step, see `cosim.fmu.curves`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.fmu import fields
from cosim.fmu.curves import matrix


class CurveTable:
    """Of one block. histories: offsets of what wires brought, by input. keep: what lives as long as the table does.

    address: of the table; 0 where no input goes on.
    """

    def __init__(
        self, fmu: Any, component: Any, histories: Mapping[str, int], slots: Mapping[str, int], keep: list[Any]
    ) -> None:
        self._keep = keep
        self.address = 0
        if not histories:
            return
        rows, references, orders = self._array(len(histories), fields.CURVE_WORDS), list[int](), list[int]()
        for row, (name, history) in zip(rows, histories.items(), strict=True):
            coupling, port = component.couplings[name], fmu.ports[name]
            order, width = coupling.order + int(coupling.interpolated), component.count * port.size
            row[[fields.CURVE_SLOT, fields.CURVE_HISTORY, fields.CURVE_ORDER]] = slots[name], history, order
            row[[fields.CURVE_ELEMENTS, fields.CURVE_WIDTH]] = port.size, width
            row[fields.CURVE_POINTS] = self._array((order + 1) * width).ctypes.data
            row[fields.CURVE_MATRIX] = self._kept(matrix(order)).ctypes.data
            references += [reference for reference in port.references for _ in range(order)]
            orders += [*range(1, order + 1)] * port.size
        told = np.array(references, np.uint32), np.array(orders, np.int32), np.zeros(len(orders))
        table = self._array(fields.CURVES_WORDS)
        table[:] = rows.ctypes.data, len(rows), *(self._kept(array).ctypes.data for array in told), len(orders)
        self.address = table.ctypes.data

    def _array(self, *shape: int) -> np.ndarray:
        """Zeroed words."""
        return self._kept(np.zeros(shape, np.int64))

    def _kept(self, array: np.ndarray) -> np.ndarray:
        self._keep.append(array)
        return array
