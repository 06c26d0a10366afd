"""All figures of a study as one labelled netCDF-4 file, variant × grid × draw: ``xarray.open_dataset(path)``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import ResultError
from cosim.machine import files
from cosim.results.metrics import Events
from cosim.results.netcdf_layout import NOT_A_VARIABLE
from cosim.results.software_versions import versions
from cosim.study.definition import Study
from cosim.study.dotted_paths import short_name
from cosim.study.member_run import Row
from cosim.study.row_figures import is_events
from cosim.study.running import Results
from cosim.wiring import required, windows

Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]


def write(path: Path, results: Results) -> None:
    """Write the data set, in place of an older one. Raises: ResultError."""
    try:
        with files.fresh(path) as new:
            new.write_bytes(_content(new.name, results))
    except (OSError, RuntimeError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise ResultError(f"cannot write {path}: {reason}", fix=files.usual_fix(error)) from None


def _content(name: str, results: Results) -> bytes:
    """The file, made in memory, as HDF5 takes its process along where a disk is full; name: that no other one has."""
    import h5py

    study = results.study
    coordinates, variables = arrays(results)
    with h5py.File(name, "w", driver="core", backing_store=False, track_order=True) as file:
        file.attrs.update({"title": study.title, "study": study.text, "versions": json.dumps(versions())})
        for variable_name, variable in {**coordinates, **variables}.items():
            _create(file, variable_name, variable)
        file.flush()
        content: bytes = file.id.get_file_image()
    return content


def arrays(results: Results) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """The coordinates and the variables of the data set, each with its dimensions and attributes."""
    coordinates = _coordinates(results.study)
    return coordinates, _variables(results, tuple(len(values) for _, values, _ in coordinates.values()))


def _create(file: Any, name: str, variable: Variable) -> None:
    """One variable with its dimensions; a dimension that has no values of its own is made when it is first used."""
    import h5py

    dimensions, values, about = variable
    name, dimensions = netcdf_name(name), tuple(map(netcdf_name, dimensions))
    kind = h5py.string_dtype() if values.dtype == object else values.dtype
    made = file.create_dataset(name, data=values, dtype=kind, track_order=True)
    made.attrs.update(about)
    if dimensions == (name,):
        made.make_scale(name)
        return
    for axis, (dimension, size) in enumerate(zip(dimensions, values.shape, strict=True)):
        if dimension not in file:
            file.create_dataset(dimension, (size,), ">f4", track_order=True)
            file[dimension].make_scale(f"{NOT_A_VARIABLE}{size:10d}")
        made.dims[axis].attach_scale(file[dimension])


def netcdf_name(name: str) -> str:
    """netCDF reserves `/` for groups."""
    return name.replace("/", ".")


def _coordinates(study: Study) -> dict[str, Variable]:
    found: dict[str, Variable] = {"variant": (("variant",), np.array(list(study.variants), object), {})}
    for axis in study.grid:
        values = np.array(axis.values, float) if axis.numeric else np.array(axis.labels, object)
        found[axis.name] = (axis.name,), values, {"long_name": ", ".join(axis.paths)}
    if study.random:
        found["draw"] = ("draw",), np.arange(study.random.count), {"long_name": "number of the random draw"}
    return found


def _variables(results: Results, shape: tuple[int, ...]) -> dict[str, Variable]:
    dimensions = results.study.dimensions
    found: dict[str, Variable] = {}

    def column(name: str, fill: Any, kind: Any, about: dict[str, str], more: tuple[int, ...] = ()) -> np.ndarray:
        if name not in found:
            extra = tuple(f"{name}_axis{q}" for q in range(len(more)))
            values = np.full((prod(shape), *more), fill, kind)
            found[name] = (*dimensions, *extra), values, about
        return found[name][1]

    units = {name: {"units": unit} if unit else {} for name, unit in _units(results).items()}
    shapes = _shapes(results.rows())
    for at, row in enumerate(results.rows()):
        column("status", "", object, {"long_name": "how the run ended"})[at] = row["status"]
        column("reason", "", object, {"long_name": "why it ended before its end"})[at] = row["reason"]
        column("steps", 0, np.int64, {})[at] = row["steps"]
        column("seconds", 0.0, float, {"units": "s", "long_name": "wall-clock time of the solution"})[at] = row[
            "seconds"
        ]
        if verdicts := row.get("conditions"):
            about = {"long_name": "whether each condition of a theorem holds along the run, as JSON; null: unknown"}
            column("conditions", "", object, about)[at] = json.dumps(verdicts, ensure_ascii=False)
        for name, value in row["metrics"].items():
            _put(column, at, name, value, units.get(name, {}), shapes[name])
    draws = _drawn(results)
    return {**{k: (d, v.reshape(*shape, *v.shape[1:]), a) for k, (d, v, a) in found.items()}, **draws}


def _put(column: Any, at: int, name: str, value: Any, about: dict[str, str], shape: tuple[int, ...]) -> None:
    """One metric of one member: a number, an array, or events as their number and their text.

    shape: that of the largest member; of a smaller one the first elements are there, the others NaN.
    """
    if is_events(value):
        column(name, np.nan, float, {"long_name": "number of events"})[at] = len(value)
        column(f"{name}_events", "", object, {"long_name": "events as JSON"})[at] = json.dumps(value)
        return
    target = column(name, np.nan, float, about, shape)
    if value is not None:
        array = np.array(value, float, ndmin=len(shape))
        target[(at, *map(slice, array.shape))] = array


def _shapes(rows: Iterable[Row]) -> dict[str, tuple[int, ...]]:
    """For each metric the least shape into which every member's array fits; further axes come before an array's own."""
    shapes: dict[str, tuple[int, ...]] = {}
    for row in rows:
        for name, value in row["metrics"].items():
            own = () if value is None or is_events(value) else np.shape(value)
            known = shapes.setdefault(name, own)
            rank = max(len(own), len(known))
            pairs = zip(*((1,) * (rank - len(shape)) + shape for shape in (own, known)), strict=True)
            shapes[name] = tuple(max(pair) for pair in pairs)
    return shapes


def _drawn(results: Results) -> dict[str, Variable]:
    """What was drawn, as variables over the draws."""
    if results.draws is None:
        return {}
    found: dict[str, Variable] = {}
    for draw, values in results.draws.values():
        name = short_name(",".join(draw.paths))
        axes = tuple(f"{name}_axis{q}" for q in range(values.ndim - 1))
        found[f"drawn_{name}"] = ("draw", *axes), values, {"long_name": ", ".join(draw.paths)}
    return found


def _units(results: Results) -> dict[str, str]:
    units: dict[str, str] = {}
    for variant in results.study.variants:
        network = results.variants.base(variant)
        for name, (signal, reduction) in windows.reduced(network)[0].items():
            unit = network.variable(signal).unit
            if not isinstance(reduction, Events):
                units.setdefault(name, reduction.unit_from(unit if isinstance(unit, str) else ""))
        for name, monitor in required.monitors(network).items():
            units.setdefault(name, monitor.unit)
    return units


def metric_names(rows: Iterable[Row]) -> list[str]:
    """All metrics that any member has, in order."""
    return list(dict.fromkeys(name for row in rows for name in row["metrics"]))
