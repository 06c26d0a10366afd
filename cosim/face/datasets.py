"""Signals and figures as xarray Datasets, which is imported only where somebody asks for one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.errors import MissingPackage
from cosim.results.netcdf_layout import TIME, attributes_of, dimensions_of, netcdf_name
from cosim.results.recorded import Recorded

if TYPE_CHECKING:
    import xarray

Variables = Mapping[str, tuple[tuple[str, ...], np.ndarray, Mapping[str, str]]]


def dataset(coordinates: Variables, variables: Variables, attributes: Mapping[str, Any]) -> xarray.Dataset:
    """A Dataset of named arrays with their dimensions and attributes. Raises: MissingPackage."""
    try:
        import xarray
    except ImportError:
        message = "a Dataset needs xarray, which is not installed"
        fix = "pip install 'cosim[xarray]'; without it, index by a name to have a NumPy array"
        raise MissingPackage(message, fix=fix) from None
    return xarray.Dataset(dict(variables), dict(coordinates), dict(attributes))


def dataset_of_signals(
    recorded: Iterable[Recorded], times: np.ndarray, values: Mapping[str, np.ndarray], attributes: Mapping[str, Any]
) -> xarray.Dataset:
    """Signals over time, laid out as in a result file. Raises: MissingPackage."""
    coordinates: dict[str, tuple[tuple[str, ...], np.ndarray, Mapping[str, str]]] = {"time": (("time",), times, TIME)}
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, Mapping[str, str]]] = {}
    for signal in recorded:
        dimensions = dimensions_of(signal)
        if signal.fleet:
            members, size = dimensions[0]
            coordinates[members] = (members,), np.arange(1, size + 1), {}
        names = ("time", *(name for name, _ in dimensions))
        variables[netcdf_name(signal.name)] = names, values[signal.name], attributes_of(signal)
    return dataset(coordinates, variables, attributes)
