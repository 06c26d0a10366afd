"""Arrays as kernels see them: narrower elements are widened when they are read, and written where they fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.compiling.interpreted.numbers import Integer, checked, number, plain


def array_view(memory: np.ndarray) -> np.ndarray:
    """An array as an interpreted function sees it, in the same memory."""
    return memory.view(_Reals if memory.dtype == np.float64 else _Array)


class _Reals(np.ndarray):
    """An array of float64, whose elements numpy reads and writes as kernels do."""

    @property
    def size(self) -> Integer:
        """How many elements there are."""
        return checked(super().size)

    @property
    def ndim(self) -> Integer:
        """How many axes there are."""
        return checked(super().ndim)

    @property  # type: ignore[misc]  # numpy's can be assigned to
    def shape(self) -> tuple[Integer, ...]:
        """The sizes of the axes."""
        return tuple(map(checked, super().shape))


for _name, _ufunc in (("add", np.add), ("sub", np.subtract), ("mul", np.multiply), ("truediv", np.divide)):
    setattr(_Reals, f"__i{_name}__", lambda self, other, ufunc=_ufunc: ufunc(self, plain(other), out=self))


class _Array(_Reals):
    """An array of another type, whose elements are read as kernels read them, and written where they fit."""

    def __getitem__(self, index: Any) -> Any:
        found = super().__getitem__(index)
        return found if isinstance(found, np.ndarray) else number(found)

    def __setitem__(self, index: Any, value: Any) -> None:
        if not isinstance(value, np.ndarray):
            _fit(value, self.dtype)
        super().__setitem__(index, value)


_BOUNDS = {np.dtype(kind): (np.iinfo(kind).min, np.iinfo(kind).max) for kind in "bBhHiIqQ"}


def _fit(value: Any, dtype: np.dtype) -> None:
    """Raises: TypeError, OverflowError, where an element of that type cannot hold the number."""
    if isinstance(value, float):
        if dtype.kind != "f":
            raise TypeError(f"a real number is put into an array of {dtype}")
    elif dtype in _BOUNDS:
        least, most = _BOUNDS[dtype]
        if not least <= value <= most:
            raise OverflowError(f"{int(value)} does not fit into {dtype}")
