"""How recorded signals lie in a netCDF-4 file: one variable each, over time and the signal's own dimensions.

netCDF-4 is HDF5 whose axes are dimension scales, so h5py is all that it takes; h5netcdf, netCDF4 and xarray open it.
h5netcdf, used as the writer, looks through all variables whenever it adds one, and takes four times as long.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np

from cosim.errors import ResultError
from cosim.results.recorded import Recorded

NOT_A_VARIABLE = "This is a netCDF dimension but not a netCDF variable."  # with the size, %10d: netCDF-4's own mark
SEPARATOR = ", "
"""Between the names of a signal's components."""
CHUNK_BYTES = 64 * 1024
CHUNK_ROWS = 1024
TIME = {"units": "s", "long_name": "simulated time", "axis": "T"}


def create(file: Any, signals: Iterable[Recorded]) -> None:
    """The dimensions and the variables of a new file, without samples. Raises: ResultError for what netCDF has not."""
    scales = {"time": _create_time(file)}
    layout = [(signal, dimensions_of(signal)) for signal in signals]
    for signal, dimensions in layout:
        for axis, (name, size) in enumerate(dimensions):
            if name not in scales:
                scales[name] = _create_scale(file, name, size, is_member=bool(signal.fleet) and axis == 0)
    for signal, dimensions in layout:
        _create_variable(file, signal, [scales["time"], *(scales[name] for name, _ in dimensions)])


def variables(file: Any) -> dict[str, Any]:
    """The variables of a file by their signals' names. Raises: ValueError where one is lost."""
    things = list(file.values())
    if any(thing is None for thing in things):  # h5py's word for a link that leads nowhere
        raise ValueError("it is damaged")
    return {thing.attrs["signal"]: thing for thing in things if "signal" in thing.attrs}


def rows(variable: Any) -> int:
    """How many there are: HDF5, which wrote results before, grew variables ahead of chunks, which are read as 0."""
    indexed: int = variable.id.get_num_chunks() * variable.chunks[0]
    return min(len(variable), indexed)


def described(variable: Any) -> Recorded:
    """The signal that a variable holds."""
    about = variable.attrs
    dtype = np.dtype(bool) if about.get("dtype") == "bool" else variable.dtype
    fleet, description, causality = (about.get(key, "") for key in ("fleet", "long_name", "causality"))
    names = tuple(about["components"].split(SEPARATOR)) if "components" in about else ()
    return Recorded(
        about["signal"], variable.shape[1:], dtype, fleet, about.get("units"), description, causality, names
    )


def netcdf_name(name: str) -> str:
    """netCDF reserves `/` for groups; a block's name has no dot, so dots keep the names of nested blocks apart."""
    return name.replace("/", ".")


def stored_type(signal: Recorded) -> np.dtype[Any]:
    """The type in the file: netCDF has no booleans. Raises: ResultError for what it does not have at all."""
    dtype: np.dtype[Any] = np.dtype(signal.dtype)
    if dtype.kind == "b":
        return np.dtype(np.int8)
    if dtype.kind in "iu" or dtype in (np.float32, np.float64):
        return dtype
    raise ResultError(f"`{signal.name}`: netCDF has no numbers of type {dtype}", fix="leave it out of `record`")


def dimensions_of(signal: Recorded) -> list[tuple[str, int]]:
    """The names and sizes of a signal's dimensions after time.

    Axes of one size are one dimension (`axis3`, `axis3_2` where a signal has two of them), so that `x - x_hat` of
    two blocks subtracts element by element, whatever the blocks call their dimensions.
    """
    fleet = 1 if signal.fleet else 0
    members = "time_" if signal.fleet == "time" else netcdf_name(signal.fleet)
    own = signal.shape[fleet:]
    repeated = [own[:q].count(size) + 1 for q, size in enumerate(own)]
    names = [f"axis{size}" if k == 1 else f"axis{size}_{k}" for size, k in zip(own, repeated, strict=True)]
    return list(zip([members] * fleet + names, signal.shape, strict=True))


def _create_time(file: Any) -> Any:
    """Time in s."""
    time = file.create_dataset("time", (0,), float, maxshape=(None,), chunks=(CHUNK_ROWS,))
    time.attrs.update(TIME)
    time.make_scale("time")
    return time


def _create_scale(file: Any, name: str, size: int, is_member: bool) -> Any:
    """A dimension: of a fleet's members, from 1, or a signal's own axis, which has no values."""
    make = partial(file.create_dataset, name)
    scale = make(data=np.arange(1, size + 1)) if is_member else make((size,), ">f4")
    scale.make_scale(name if is_member else f"{NOT_A_VARIABLE}{size:10d}")
    return scale


def _create_variable(file: Any, signal: Recorded, scales: Sequence[Any]) -> None:
    if 0 in signal.shape:
        raise ResultError(f"`{signal.name}` has no elements", fix="leave it out of `record`")
    dtype, shape = stored_type(signal), signal.shape
    rows = max(1, min(CHUNK_ROWS, CHUNK_BYTES // (prod(shape) * dtype.itemsize)))
    layout = {"maxshape": (None, *shape), "chunks": (rows, *shape)}
    variable = file.create_dataset(netcdf_name(signal.name), (0, *shape), dtype, **layout)
    for axis, scale in enumerate(scales):
        variable.dims[axis].attach_scale(scale)
    about = attributes_of(signal)
    about |= {"dtype": "bool"} if np.dtype(signal.dtype).kind == "b" else {}  # as xarray notes it
    variable.attrs.update(about)


def attributes_of(signal: Recorded) -> dict[str, str]:
    """What a variable says of itself in words."""
    units = signal.unit if isinstance(signal.unit, tuple) else (signal.unit or "",)
    about = {"signal": signal.name, "units": ", ".join(units if len(set(units)) > 1 else units[:1])}
    about |= {"long_name": signal.description, "causality": signal.causality, "fleet": signal.fleet}
    about |= {"components": SEPARATOR.join(signal.components)}
    return {key: text for key, text in about.items() if text}
