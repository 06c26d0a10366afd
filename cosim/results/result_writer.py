"""Writes a result file while the run goes on.

HDF5 makes the file, in memory. Rows are appended without it, see `growing_file`: a process that is killed at whatever
moment leaves a file with all rows of the last flush, which HDF5, where it appends, may not. Samples wait in memory
until `flush`, so that between two flushes nothing on disk is touched.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from cosim.errors import ResultError
from cosim.machine import files
from cosim.results import attributes, netcdf_layout, result_image
from cosim.results.growing_file import GrowingFile
from cosim.results.growing_variable import GrowingVariable
from cosim.results.new_result import new_result
from cosim.results.recorded import Array, Recorded
from cosim.results.result_errors import as_result_error
from cosim.results.result_file import refuse_foreign

WAITING_BYTES = 32 * 1024**2
SUMMED_ROWS = 4096


def previous_path(path: str | Path) -> Path:
    """Where the result that stood at `path` is kept when a new one takes its place."""
    path = Path(path)
    return path.with_name(f"{path.stem}.previous{path.suffix}")


class ResultWriter:
    """Writes one result file; as a context manager it closes the file with the status that the way out implies.

    The file is made under a hidden name and takes the place of an older result only when it can be opened; the older
    one stays as `<stem>.previous.nc`. state: that of a writer of this very file, from which it goes on.

    Raises: ResultError if the file cannot be written, or if something else than a result stands there.
    """

    def __init__(
        self,
        path: str | Path,
        signals: Sequence[Recorded],
        about: Mapping[str, Any],
        state: Mapping[str, Any] | None = None,
    ) -> None:
        self.path = Path(path)
        self._signals = {signal.name: signal for signal in signals}
        self._waiting: list[tuple[Array, dict[str, Array]]] = []
        self._waiting_bytes = 0
        self._count = 0
        self.flushed = time.perf_counter()  # when that was done last
        self._summed, self._sums = 0, [0] * (1 + len(signals))  # up to which row, and what, see `state`
        if state is None:
            self._begin(about)
        else:
            self._go_on(state)

    def append(self, times: Array, samples: Mapping[str, Array]) -> None:
        """Keep a batch: times (k,) in s, and for every signal an array (k, *shape). The arrays are copied."""
        batch = {}
        for name, signal in self._signals.items():
            if samples[name].shape != (len(times), *signal.shape):
                raise ValueError(f"`{name}`: samples of shape {samples[name].shape}, not (k, *{signal.shape})")
            batch[name] = np.array(samples[name], netcdf_layout.stored_type(signal))
            self._waiting_bytes += batch[name].nbytes
        self._waiting.append((np.array(times, float), batch))
        if self._waiting_bytes > WAITING_BYTES:
            self.flush()

    def flush(self) -> None:
        """Bring everything appended so far into the file, on a full disk as much as it takes. Raises: ResultError."""
        self.flushed = time.perf_counter()
        if not self._waiting:
            return
        times = np.concatenate([times for times, _ in self._waiting])
        samples = {name: np.concatenate([batch[name] for _, batch in self._waiting]) for name in self._signals}
        full, rows = None, len(times)
        with as_result_error("write", self.path):
            while rows:
                try:
                    self._reserve(rows)
                except OSError as error:
                    if error.errno not in files.FULL:
                        raise
                    full, rows = full or error, rows // 2
                    continue
                self._write([times[:rows], *(values[:rows] for values in samples.values())])
                times, samples = times[rows:], {name: values[rows:] for name, values in samples.items()}
                # Only now: what breaks off before has the next flush write the same samples to the same place again.
                self._waiting, rows = [(times, samples)], min(rows, len(times))
            self._waiting, self._waiting_bytes = [], 0
            if full:
                raise full

    def state(self) -> dict[str, Any]:
        """Flush, have it all on the disk, and tell what another writer needs to go on from there.

        Raises: ResultError.
        """
        self.flush()
        with as_result_error("write", self.path):
            self._file.give_back()
            self._file.sync()
            self._sum_up()
            image = result_image.image_of(self._file, self._variables, self._count)
        headers = np.array([variable.header for variable in self._variables])
        sums = np.array(self._sums, np.uint32)
        return {"rows": np.array(self._count), "sums": sums, "headers": headers, "image": image}

    def _reserve(self, rows: int) -> None:
        """Have the disk set aside what so many more rows take. Raises: OSError."""
        self._file.reserve(sum(variable.bytes_for(self._count + rows) for variable in self._variables))

    def _write(self, samples: Sequence[Array]) -> None:
        """Write rows, of time and then of each signal, for which there is space. Raises: OSError."""
        count = self._count + len(samples[0])
        for variable, values in zip(self._variables, samples, strict=True):
            variable.write(self._count, values)
        for variable in reversed(self._variables):  # time is the last
            variable.count(count)
        self._count = count

    def _sum_up(self) -> None:
        """Take the rows that have come since the last time into a checksum of each variable's."""
        for k, variable in enumerate(self._variables):
            for begin in range(self._summed, self._count, SUMMED_ROWS):
                rows = variable.read(begin, min(begin + SUMMED_ROWS, self._count))
                self._sums[k] = zlib.crc32(rows, self._sums[k])
        self._summed = self._count

    def close(
        self,
        status: str,
        message: str = "",
        metrics: Mapping[str, Any] | None = None,
        steps: int = 0,
        seconds: Mapping[str, float] | None = None,
        conditions: Sequence[Mapping[str, Any]] = (),
        inner_steps: Mapping[str, Any] | None = None,
        end: float = 0.0,
        requirements: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """Flush, note how the run ended, and close.

        status: completed, terminated, diverged, interrupted or failed. seconds: wall-clock time of each part.
        conditions: the fields of each `network.Finding`; requirements: of each `Verdict`. inner_steps: of what was
        integrated within a tolerance. end: the simulated time that was reached (s).
        """
        problem = None
        try:
            self.flush()
        except ResultError as error:
            problem, status, message = error, "failed", error.message
        last: dict[str, Any] = {"status": status, "message": message, "steps": steps, "end": end}
        last |= {"metrics": metrics or {}, "conditions": list(conditions), "requirements": list(requirements)}
        last |= {"seconds": seconds or {}, "inner_steps": inner_steps or {}, "accuracy": {}}
        full = self._set_aside(last)
        problem = problem or full
        try:
            with as_result_error("write", self.path):
                attributes.write_last(self._file, last)
                self._file.give_back()
        finally:
            self._file.close()
        if problem:
            raise problem

    def _set_aside(self, last: dict[str, Any]) -> ResultError | None:
        """Take space for what is known at the end; where there is none, leave its figures out, and say so."""
        try:
            with as_result_error("write", self.path):
                self._file.reserve(attributes.size_of(last))
        except ResultError as full:  # the rows are worth more than the figures, which can be made of them
            said = f"{last['message'][:200]} (its figures found no space)".strip()
            last |= {"status": "failed", "message": said, "metrics": {}, "inner_steps": {}}
            last |= {"conditions": [], "requirements": []}
            return full
        return None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        if self._file.closed:
            return
        if error is None:
            self.close("completed")
            return
        with suppress(ResultError):  # the error on its way out says more than the failure to note it
            interrupted = isinstance(error, KeyboardInterrupt)
            self.close("interrupted" if interrupted else "failed", "" if interrupted else str(error))

    def _begin(self, about: Mapping[str, Any]) -> None:
        refuse_foreign(self.path)
        with as_result_error("write", self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content, headers = new_result([*self._signals.values()], about)
            with files.fresh(self.path, keep=previous_path(self.path)) as new, new.open("x+b", buffering=0) as opened:
                file = GrowingFile(opened, len(content))
                file.write(0, content)
                file.reserve(0)
            self._file = GrowingFile(self.path.open("r+b", buffering=0), len(content))
            self._variables = [GrowingVariable(self._file, header) for header in headers]

    def _go_on(self, state: Mapping[str, Any]) -> None:
        """Raises: ResultError where the rows are not those that were written."""
        with as_result_error("write", self.path):
            self._file = GrowingFile(self.path.open("r+b", buffering=0), self.path.stat().st_size)
            result_image.bring_back(self._file, state["image"])
            self._variables = [GrowingVariable(self._file, header) for header in state["headers"].tolist()]
            self._count = int(state["rows"])
            self._sum_up()
            counted = {variable.counted for variable in self._variables}
            same = counted == {self._count} and self._sums == state["sums"].tolist()
        if not same:
            self._file.close()
            message = f"{self.path} is damaged: its samples are not those that the run has recorded"
            raise ResultError(message, fix="leave --resume out to begin anew")


def add_accuracy(path: Path, accuracy: Mapping[str, Any]) -> None:
    """Note in a result that is closed how sure its metrics are, which further runs have told. Raises: ResultError."""
    with as_result_error("write", path), path.open("r+b", buffering=0) as opened:
        file = GrowingFile(opened, path.stat().st_size)
        file.reserve(attributes.size_of({"accuracy": accuracy}))
        attributes.write_accuracy(file, accuracy)
        file.give_back()
