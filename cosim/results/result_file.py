"""Recorded signals in a self-describing netCDF-4 file, read without xarray."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from cosim.errors import ResultError, nearest
from cosim.machine import files
from cosim.results import attributes, netcdf_layout
from cosim.results.damage import can_be_read
from cosim.results.recorded import Array
from cosim.results.result_errors import FIXES, as_result_error

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class Result:
    """A result file, open for reading; signals are read from it on demand: ``result["plant.x"]``.

    times: (k,) in s. signals: what is recorded, by name. attrs: title, diagram, status, metrics, versions, …
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file = _opened(self.path)
        with as_result_error("read", self.path):
            self.attrs = attributes.read(self._file)
            self._variables = netcdf_layout.variables(self._file)
            # Killed in the middle of a flush, a writer leaves some variables longer than others.
            self._count = min(map(netcdf_layout.rows, [self._file["time"], *self._variables.values()]))
            self.times: Array = self._file["time"][: self._count]
            self.signals = {name: netcdf_layout.described(variable) for name, variable in self._variables.items()}

    def __getitem__(self, name: str) -> Array:
        return self.read(name)

    def read(self, name: str, first: int = 0, last: int | None = None) -> Array:
        """The samples first … last-1 of a signal, (k, *shape). Raises: ResultError."""
        if name not in self._variables:
            raise ResultError(f"{self.path} has no signal `{name}`", fix=nearest(name, self._variables))
        with as_result_error("read", self.path):
            values: Array = self._variables[name][first : self._count if last is None else min(last, self._count)]
        return values.astype(self.signals[name].dtype, copy=False)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_result(path: str | Path) -> Result:
    """Open a result file, also one whose run is still going on or was killed. Raises: ResultError."""
    return Result(path)


def read_attributes(path: Path) -> dict[str, Any]:
    """What a result says of its run beside the samples, as `Result.attrs`, in less time. Raises: ResultError."""
    with _opened(path) as file, as_result_error("read", path):
        return attributes.read(file)


def metrics_in(attrs: Mapping[str, Any], reductions: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The metrics among a result's attributes; none if its run did not come to an end.

    reductions: what each metric means, as of `Reductions.meanings`; then those alone that meant the same.
    """
    metrics: dict[str, Any] = attrs.get("metrics", {})
    before = attrs.get("reductions")
    if reductions is None or before is None:
        return metrics
    return {name: value for name, value in metrics.items() if before.get(name) == reductions.get(name)}


def requirements_in(attrs: Mapping[str, Any], formulas: Mapping[str, str] | None = None) -> dict[str, dict[str, Any]]:
    """The verdicts among a result's attributes by the requirement's name, as of `Verdict.as_json`.

    formulas: by name; then those alone that were of the same one.
    """
    found = {judged["name"]: judged for judged in attrs.get("requirements", [])}
    if formulas is None:
        return found
    return {name: judged for name, judged in found.items() if judged["formula"] == formulas.get(name)}


def refuse_foreign(path: Path) -> None:
    """Raises: ResultError where something stands that is no result."""
    files.refuse_foreign(path, "a result of a run", is_result)


def is_result(path: Path) -> bool:
    """Whether a file is a result; looks at its head only."""
    import h5py

    with path.open("rb") as file:
        if file.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
            return False
    if not can_be_read(path):
        return False
    try:
        with h5py.File(path, "r", locking=False) as file:
            return _is_result(file)
    except (OSError, RuntimeError, ValueError, KeyError):
        return False


def _opened(path: Path) -> Any:
    """A result as h5py opens it. Raises: ResultError."""
    import h5py

    if not path.is_file():
        raise ResultError(f"{path} does not exist or is not a file", fix="run the diagram first")
    if not can_be_read(path):
        raise ResultError(f"cannot read {path}: it is damaged", fix=FIXES["read"])
    with as_result_error("read", path):
        file = h5py.File(path, "r", locking=False)
        if not _is_result(file):
            raise ResultError(f"{path} is no result of a run", fix=FIXES["read"])
    return file


def _is_result(file: Any) -> bool:
    return "status" in file.attrs and "time" in file
