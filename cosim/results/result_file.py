"""Recorded signals in a self-describing netCDF-4 file, written while the run goes on, and read without xarray.

netCDF-4 is HDF5 whose axes are dimension scales, so h5py is all that it takes; h5netcdf, netCDF4 and xarray open it.
h5netcdf, used as the writer, looks through all variables whenever it adds one, and takes four times as long.

Samples wait in memory until `flush`, so that between two flushes nothing on disk is touched: a process that is killed
leaves the file as the last flush left it. HDF5 loses the file, and then its process, when a write fails; so space on
the disk is reserved before HDF5 writes.
"""

from __future__ import annotations

import csv
import errno
import faulthandler
import json
import os
import platform
import re
import shutil
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from importlib import metadata
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosim.errors import ResultError, nearest
from cosim.machine import files
from cosim.results.metrics import for_json, from_json

Array = NDArray[Any]
JSON_ATTRIBUTES = ("settings", "versions", "seconds", "metrics", "reductions", "conditions")
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
NOT_A_VARIABLE = "This is a netCDF dimension but not a netCDF variable."  # with the size, %10d: netCDF-4's own mark
CHUNK_BYTES = 64 * 1024
CHUNK_ROWS = 1024
WAITING_BYTES = 32 * 1024**2
INDEX_BYTES, NODE_BYTES = 256, 8 * 1024  # at most, of HDF5's index: for a chunk, and for a new node
CLOSING_BYTES = 256 * 1024  # for the attributes written last
#: What is known at the end only, with bytes set aside for it: what fits is written in place, so that at no instant is
#: there a file whose header points to what is not yet on disk.
LAST = {"message": 512, "steps": 0, "metrics": 2048, "seconds": 128, "conditions": 2048, "status": 16}
WALK_SECONDS = 5  # of processor time, in which HDF5 finds millions of chunks
CSV_ROWS = 1024
CSV_HEAD = 1 << 24  # characters of the first line that are looked at, to tell whose table it is
FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
FIXES = {
    "full": "free some space, record fewer signals, or record with a longer period",
    "write": "choose a folder that you may write to",
    "read": "name a file that `cosim run` wrote",
}
# The earliest format has no mark for "open for writing", which a process that is killed would leave set.
LIBVER = ("earliest", "v110")


@dataclass(frozen=True)
class Signal:
    """One recorded signal.

    name: `block.port`. shape: of one sample, the fleet's axis first if the block is one `per:` fleet.
    """

    name: str
    shape: tuple[int, ...] = ()
    dtype: Any = float
    fleet: str = ""
    unit: str | tuple[str, ...] | None = None
    description: str = ""
    causality: str = "output"


def previous_path(path: str | Path) -> Path:
    """Where the result that stood at `path` is kept when a new one takes its place."""
    path = Path(path)
    return path.with_name(f"{path.stem}.previous{path.suffix}")


class ResultWriter:
    """Writes one result file; as a context manager it closes the file with the status that the way out implies.

    The file is made under a hidden name and takes the place of an older result only when it can be opened; the older
    one stays as `<stem>.previous.nc`.

    Raises: ResultError if the file cannot be written, or if something else than a result stands there.
    """

    def __init__(self, path: str | Path, signals: Sequence[Signal], attributes: Mapping[str, Any]) -> None:
        self.path = Path(path)
        self._signals = {signal.name: signal for signal in signals}
        self._waiting: list[tuple[Array, dict[str, Array]]] = []
        self._waiting_bytes = 0
        self._count = 0
        refuse_foreign(self.path)
        with _as_result_error("write", self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with files.fresh(self.path, keep=previous_path(self.path)) as new:
                new.write_bytes(self._image(attributes))
            self._open()

    def append(self, times: Array, samples: Mapping[str, Array]) -> None:
        """Keep a batch: times (k,) in s, and for every signal an array (k, *shape). The arrays are copied."""
        batch = {}
        for name, signal in self._signals.items():
            if samples[name].shape != (len(times), *signal.shape):
                raise ValueError(f"`{name}`: samples of shape {samples[name].shape}, not (k, *{signal.shape})")
            batch[name] = np.array(samples[name], _stored(signal))
            self._waiting_bytes += batch[name].nbytes
        self._waiting.append((np.array(times, float), batch))
        if self._waiting_bytes > WAITING_BYTES:
            self.flush()

    def flush(self) -> None:
        """Bring everything appended so far into the file, on a full disk as much as it takes. Raises: ResultError."""
        if not self._waiting:
            return
        times = np.concatenate([times for times, _ in self._waiting])
        samples = {name: np.concatenate([batch[name] for _, batch in self._waiting]) for name in self._signals}
        with _as_result_error("write", self.path):
            rows, full = self._reserve(len(times))
            count = self._count + rows
            for name, variable in self._variables.items():
                variable.resize(count, axis=0)
                variable[self._count :] = samples[name][:rows]
            self._time.resize(count, axis=0)
            self._time[self._count :] = times[:rows]
            self._file.flush()
            # Only now: what breaks off in between has the next flush write the same samples to the same place again.
            self._waiting, self._waiting_bytes, self._count = [], 0, count
            if full:
                raise full

    def close(
        self,
        status: str,
        message: str = "",
        metrics: Mapping[str, Any] | None = None,
        steps: int = 0,
        seconds: Mapping[str, float] | None = None,
        conditions: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """Flush, note how the run ended, and close.

        status: completed, terminated, diverged, interrupted or failed. seconds: wall-clock time of each part.
        conditions: those that were judged along the run, with the fields of a `network.Finding`.
        """
        problem = None
        try:
            self.flush()
        except ResultError as error:
            problem, status, message = error, "failed", error.message
        last: dict[str, Any] = {"status": status, "message": message, "steps": steps}
        last |= {"metrics": metrics or {}, "seconds": seconds or {}, "conditions": list(conditions)}
        with _as_result_error("write", self.path):
            for key in LAST:
                if key == "status":
                    self._file.flush()  # whoever finds a status finds the rest
                _write_last(self._file, key, last[key])
            self._file.flush()
            os.ftruncate(self._file.id.get_vfd_handle(), self._file.id.get_filesize())
            self._file.close()
        if problem:
            raise problem

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: Any) -> None:
        if not self._file:
            return
        if error is None:
            self.close("completed")
            return
        with suppress(ResultError):  # the error on its way out says more than the failure to note it
            interrupted = isinstance(error, KeyboardInterrupt)
            self.close("interrupted" if interrupted else "failed", "" if interrupted else str(error))

    def _image(self, attributes: Mapping[str, Any]) -> bytes:
        """The file without samples, made in memory."""
        import h5py

        head = {"created": datetime.now(UTC).isoformat(timespec="seconds"), "versions": versions()}
        memory = {"driver": "core", "backing_store": False}
        with h5py.File(self.path.name, "w", track_order=True, libver=LIBVER, **memory) as file:
            _write_attributes(file, {"title": "", **head, **attributes})
            for key, size in LAST.items():
                file.attrs[key] = np.array("running" if key == "status" else "", f"S{size}") if size else 0
            scales = self._create_scales(file)
            for signal, dims in self._layout():
                _create_variable(file, signal, [scales["time"], *(scales[name] for name, _ in dims)])
            file.flush()
            return file.id.get_file_image()

    def _open(self) -> None:
        import h5py

        # Without locks a result can be watched while it grows, also on file systems that know no locks.
        self._file = h5py.File(self.path, "r+", locking=False, libver=LIBVER)
        self._time = self._file["time"]
        self._variables = {name: self._file[_netcdf_name(name)] for name in self._signals}

    def _reserve(self, rows: int) -> tuple[int, OSError | None]:
        """Have the disk set aside what so many more rows take, or fewer. Returns how many, and why not all."""
        full = None
        while True:
            try:
                self._set_aside(self._count + rows)
                return rows, full
            except OSError as error:
                if error.errno not in FULL:
                    raise
                full = full or error
                if not rows:
                    return 0, full
                rows //= 2

    def _set_aside(self, count: int) -> None:
        """Have the disk set aside what `count` samples and then the closing attributes take. Raises: OSError."""
        size = CLOSING_BYTES
        for variable in (self._time, *self._variables.values()):
            rows = variable.chunks[0]
            chunks = -(-count // rows) - -(-self._count // rows)
            size += chunks * (prod(variable.chunks) * variable.dtype.itemsize + INDEX_BYTES) + NODE_BYTES
        descriptor, end = self._file.id.get_vfd_handle(), self._file.id.get_filesize()
        try:
            os.posix_fallocate(descriptor, end, size)
        except (AttributeError, OSError) as error:
            if getattr(error, "errno", None) in FULL:
                os.ftruncate(descriptor, end)  # a part may have been set aside
                raise
            # This system, or this file system, cannot reserve; it can still say what is left.
            if shutil.disk_usage(self.path.parent).free < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error

    def _layout(self) -> Iterator[tuple[Signal, list[tuple[str, int]]]]:
        """Each signal with the names and sizes of its dimensions after time.

        Axes of one size are one dimension (`axis3`, `axis3_2` where a signal has two of them), so that `x - x_hat` of
        two blocks subtracts element by element, whatever the blocks call their dimensions.
        """
        for signal in self._signals.values():
            fleet = 1 if signal.fleet else 0
            members = "time_" if signal.fleet == "time" else _netcdf_name(signal.fleet)
            own = signal.shape[fleet:]
            repeated = [own[:q].count(size) + 1 for q, size in enumerate(own)]
            names = [f"axis{size}" if k == 1 else f"axis{size}_{k}" for size, k in zip(own, repeated, strict=True)]
            yield signal, list(zip([members] * fleet + names, signal.shape, strict=True))

    def _create_scales(self, file: Any) -> dict[str, Any]:
        """The dimensions: time in s, the fleets' members from 1, and each signal's own axes, which have no values."""
        make = partial(file.create_dataset, track_order=True)
        time = make("time", (0,), float, maxshape=(None,), chunks=(CHUNK_ROWS,))
        time.attrs.update({"units": "s", "long_name": "simulated time", "axis": "T"})
        time.make_scale("time")
        scales = {"time": time}
        for signal, dims in self._layout():
            for axis, (name, size) in enumerate(dims):
                if name in scales:
                    continue
                member = bool(signal.fleet) and axis == 0
                scales[name] = make(name, data=np.arange(1, size + 1)) if member else make(name, (size,), ">f4")
                scales[name].make_scale(name if member else f"{NOT_A_VARIABLE}{size:10d}")
        return scales


class Result:
    """A result file, open for reading; signals are read from it on demand: ``result["plant.x"]``.

    times: (k,) in s. signals: what is recorded, by name. attrs: title, diagram, status, metrics, versions, …
    """

    def __init__(self, path: str | Path) -> None:
        import h5py

        self.path = Path(path)
        if not self.path.is_file():
            raise ResultError(f"{self.path} does not exist or is not a file", fix="run the diagram first")
        if not _can_be_read(self.path):
            raise ResultError(f"cannot read {self.path}: it is damaged", fix=FIXES["read"])
        with _as_result_error("read", self.path):
            self._file = h5py.File(self.path, "r", locking=False)
            kept = {key: _plain(value) for key, value in self._file.attrs.items()}
            if kept.get("status") == "running":  # the rest of what is written last is not
                kept = {key: value for key, value in kept.items() if key == "status" or key not in LAST}
            self.attrs = {key: _read_attribute(key, value) for key, value in kept.items()}
            if not _is_result(self._file):
                raise ResultError(f"{self.path} is no result of a run", fix=FIXES["read"])
            things = list(self._file.values())
            if any(thing is None for thing in things):  # h5py's word for a link that leads nowhere
                raise ValueError("it is damaged")
            variables = [v for v in things if "signal" in v.attrs]
            self._variables = {variable.attrs["signal"]: variable for variable in variables}
            # Killed in the middle of a flush, a writer leaves some variables longer than others.
            self._count = min(len(variable) for variable in [self._file["time"], *variables])
            self.times: Array = self._file["time"][: self._count]
            self.signals = {name: _read_signal(variable) for name, variable in self._variables.items()}

    def __getitem__(self, name: str) -> Array:
        return self.read(name)

    def read(self, name: str, first: int = 0, last: int | None = None) -> Array:
        """The samples first … last-1 of a signal, (k, *shape). Raises: ResultError."""
        if name not in self._variables:
            raise ResultError(f"{self.path} has no signal `{name}`", fix=nearest(name, self._variables))
        with _as_result_error("read", self.path):
            values = self._variables[name][first : self._count if last is None else min(last, self._count)]
        return values.astype(self.signals[name].dtype, copy=False)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Result:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


def open_result(path: str | Path) -> Result:
    """Open a result file, also one whose run is still going on or was killed. Raises: ResultError."""
    return Result(path)


def read_metrics(path: str | Path, reductions: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The metrics in a result file; none if its run did not come to an end. Raises: ResultError.

    reductions: what each metric means, as of `Run.reductions`; then those alone that meant the same.
    """
    with open_result(path) as result:
        metrics, before = result.attrs.get("metrics", {}), result.attrs.get("reductions")
    if reductions is None or before is None:
        return metrics
    return {name: value for name, value in metrics.items() if before.get(name) == reductions.get(name)}


def refuse_foreign(path: Path) -> None:
    """Raises: ResultError where something stands that is no result."""
    files.refuse_foreign(path, "a result of a run", is_result)


def is_result(path: Path) -> bool:
    """Whether a file is a result; looks at its head only."""
    import h5py

    with path.open("rb") as file:
        if file.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
            return False
    if not _can_be_read(path):
        return False
    try:
        with h5py.File(path, "r", locking=False) as file:
            return _is_result(file)
    except (OSError, RuntimeError):
        return False


def _can_be_read(path: Path) -> bool:
    """Whether HDF5 gets through the structure of a file: in a damaged one it may go round for ever, or crash.

    It is deaf to all signals but SIGKILL then, so a child looks first, once at a file as it is. What the child has is
    processor time: a slow disk does no harm. Errors that HDF5 reports are left to the caller, who meets them again.
    """
    if not hasattr(os, "fork"):
        return True
    try:
        about = path.stat()
    except OSError:  # which the caller meets too
        return True
    return _is_walked(path, about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns)


@lru_cache(maxsize=64)
def _is_walked(path: Path, *version: int) -> bool:
    from signal import SIGKILL

    with warnings.catch_warnings():
        # Python 3.12 warns of other threads' locks; the child uses none but h5py's, which h5py takes over a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        with suppress(BaseException):
            _walk(path)
        os._exit(0)
    try:
        return not os.WIFSIGNALED(os.waitpid(child, 0)[1])
    except ChildProcessError:  # whoever started this process has the system forget its children
        return True
    except BaseException:
        os.kill(child, SIGKILL)
        os.waitpid(child, 0)
        raise


def _walk(path: Path) -> None:
    """Read all of a file but its samples, in a process that dies of it without a word where there is no end."""
    import resource

    import h5py

    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (WALK_SECONDS, WALK_SECONDS))
    with h5py.File(path, "r", locking=False) as file:
        for thing in (file, *file.values()):
            list(thing.attrs.items())
            if getattr(thing, "chunks", None):
                thing.id.get_num_chunks()


def _is_result(file: Any) -> bool:
    return "status" in file.attrs and "time" in file


def refuse_foreign_csv(path: Path) -> None:
    """Raises: ResultError where something stands that `write_csv` did not write."""
    files.refuse_foreign(path, "a table of a run's signals", _is_our_csv)


def _is_our_csv(path: Path) -> bool:
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        try:
            head = next(csv.reader([file.readline(CSV_HEAD)]), [])
        except csv.Error:
            return False
    return head[:1] == ["time"] and all("." in column for column in head[1:])


def write_csv(path: str | Path, result: Result) -> None:
    """All signals of a result as one table: a row a sample, a column an element, `plant.x[1,2]` counting from 1.

    Floats are written with as many digits as it takes to read back the same float. It replaces another such table, and
    nothing else. Raises: ResultError.
    """
    path = Path(path)
    refuse_foreign_csv(path)
    with (
        _as_result_error("write", path),
        files.fresh(path) as new,
        new.open("x", newline="", encoding="utf-8") as file,
    ):
        table = csv.writer(file)
        table.writerow(["time", *(column for signal in result.signals.values() for column in _columns(signal))])
        for first in range(0, len(result.times), CSV_ROWS):
            blocks = [result.read(name, first, first + CSV_ROWS) for name in result.signals]
            times = result.times[first : first + CSV_ROWS, np.newaxis]
            parts = [block.reshape(len(times), -1).tolist() for block in (times, *blocks)]
            table.writerows([value for part in row for value in part] for row in zip(*parts, strict=True))


def versions() -> dict[str, str]:
    """Versions of what computed a result; without importing it."""
    found = {"python": platform.python_version(), "platform": platform.platform(terse=True), "numpy": np.__version__}
    for package in ("cosim", "numba", "llvmlite"):
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def _columns(signal: Signal) -> list[str]:
    subscripts = (",".join(str(q + 1) for q in index) for index in np.ndindex(*signal.shape))
    return [f"{signal.name}[{subscript}]" if subscript else signal.name for subscript in subscripts]


def _netcdf_name(name: str) -> str:
    """netCDF reserves `/` for groups; a block's name has no dot, so dots keep the names of nested blocks apart."""
    return name.replace("/", ".")


def _create_variable(file: Any, signal: Signal, scales: Sequence[Any]) -> None:
    if 0 in signal.shape:
        raise ResultError(f"`{signal.name}` has no elements", fix="leave it out of `record`")
    dtype, shape = _stored(signal), signal.shape
    rows = max(1, min(CHUNK_ROWS, CHUNK_BYTES // (prod(shape) * dtype.itemsize)))
    layout = {"maxshape": (None, *shape), "chunks": (rows, *shape), "track_order": True}
    variable = file.create_dataset(_netcdf_name(signal.name), (0, *shape), dtype, **layout)
    for axis, scale in enumerate(scales):
        variable.dims[axis].attach_scale(scale)
    units = signal.unit if isinstance(signal.unit, tuple) else (signal.unit or "",)
    about = {"signal": signal.name, "units": ", ".join(units if len(set(units)) > 1 else units[:1])}
    about |= {"long_name": signal.description, "causality": signal.causality, "fleet": signal.fleet}
    about |= {"dtype": "bool" if np.dtype(signal.dtype).kind == "b" else ""}  # as xarray notes it
    variable.attrs.update({key: text for key, text in about.items() if text})


def _stored(signal: Signal) -> np.dtype[Any]:
    """The type in the file: netCDF has no booleans. Raises: ResultError for what it does not have at all."""
    dtype = np.dtype(signal.dtype)
    if dtype.kind == "b":
        return np.dtype(np.int8)
    if dtype.kind in "iu" or dtype in (np.float32, np.float64):
        return dtype
    raise ResultError(f"`{signal.name}`: netCDF has no numbers of type {dtype}", fix="leave it out of `record`")


def _read_signal(variable: Any) -> Signal:
    about = variable.attrs
    dtype = np.dtype(bool) if about.get("dtype") == "bool" else variable.dtype
    fleet, description, causality = (about.get(key, "") for key in ("fleet", "long_name", "causality"))
    return Signal(about["signal"], variable.shape[1:], dtype, fleet, about.get("units"), description, causality)


def _write_attributes(file: Any, attributes: Mapping[str, Any]) -> None:
    for key, value in attributes.items():
        file.attrs[key] = json.dumps(for_json(value)) if key in JSON_ATTRIBUTES else value


def _write_last(file: Any, key: str, value: Any) -> None:
    """Write an attribute of LAST in place, if it fits."""
    text = (json.dumps(for_json(value)) if key in JSON_ATTRIBUTES else str(value)).encode()
    if key == "steps":
        file.attrs.get_id(key).write(np.array(value))
    elif len(text) <= LAST[key]:
        file.attrs.get_id(key).write(np.array(text, f"S{LAST[key]}"))
    else:
        file.attrs[key] = text.decode()


def _plain(value: Any) -> Any:
    """An attribute as h5py has it, text always as text."""
    return value.decode() if isinstance(value, bytes) else value


def _read_attribute(key: str, value: Any) -> Any:
    if key not in JSON_ATTRIBUTES:
        return for_json(value)
    found = json.loads(value)
    if key in ("metrics", "reductions") and not isinstance(found, dict):
        raise ValueError(f"its {key} are damaged")
    return from_json(found) if key == "metrics" else found


@contextmanager
def _as_result_error(action: str, path: Path) -> Iterator[None]:
    """Turn what the operating system and HDF5 raise into a ResultError with the reason in one line."""
    try:
        yield
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        inner = re.search(r"error message = '([^']*)'", str(error))
        reason = inner[1] if inner else (isinstance(error, OSError) and error.strerror) or str(error)
        fix = FIXES["full" if reason in map(os.strerror, FULL) else action]
        raise ResultError(f"cannot {action} {path}: {reason}", fix=fix) from error
