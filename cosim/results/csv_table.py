"""All signals of a result as one table in a CSV file."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from cosim.machine import files
from cosim.results.recorded import Recorded
from cosim.results.result_errors import as_result_error
from cosim.results.result_file import Result

ROWS = 1024  # that are read at once
HEAD = 1 << 24  # characters of the first line that are looked at, to tell whose table it is


def write_csv(path: str | Path, result: Result) -> None:
    """A row a sample, a column an element, `plant.x[1,2]` counting from 1.

    Floats are written with as many digits as it takes to read back the same float. It replaces another such table, and
    nothing else. Raises: ResultError.
    """
    path = Path(path)
    refuse_foreign_csv(path)
    with (
        as_result_error("write", path),
        files.fresh(path) as new,
        new.open("x", newline="", encoding="utf-8") as file,
    ):
        table = csv.writer(file)
        table.writerow(["time", *(column for signal in result.signals.values() for column in _columns(signal))])
        for first in range(0, len(result.times), ROWS):
            blocks = [result.read(name, first, first + ROWS) for name in result.signals]
            times = result.times[first : first + ROWS, np.newaxis]
            parts = [block.reshape(len(times), -1).tolist() for block in (times, *blocks)]
            table.writerows([value for part in row for value in part] for row in zip(*parts, strict=True))


def refuse_foreign_csv(path: Path) -> None:
    """Raises: ResultError where something stands that `write_csv` did not write."""
    files.refuse_foreign(path, "a table of a run's signals", _is_ours)


def _is_ours(path: Path) -> bool:
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        try:
            head = next(csv.reader([file.readline(HEAD)]), [])
        except csv.Error:
            return False
    return head[:1] == ["time"] and all("." in column for column in head[1:])


def _columns(signal: Recorded) -> list[str]:
    subscripts = (",".join(str(q + 1) for q in index) for index in np.ndindex(*signal.shape))
    return [f"{signal.name}[{subscript}]" if subscript else signal.name for subscript in subscripts]
