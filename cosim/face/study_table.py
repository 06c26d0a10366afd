"""What came of many runs, as data: a row for each, or an array over the study's axes for each figure."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cosim.errors import BlockFailed, UnknownPort, nearest
from cosim.face.datasets import dataset
from cosim.face.run_tables import aligned, html_table
from cosim.results.formatting import format_value
from cosim.study import dataset as datasets
from cosim.study import plan, running
from cosim.study.dotted_paths import short_name
from cosim.study.running import Results

if TYPE_CHECKING:
    import xarray

SHOWN, WIDEST = 20, 32
"""Rows of a table that shows itself, and characters of a value in it."""
_ALONE = ("variant",)


class StudyTable:
    """The runs of a study. `table["min_gap"]` is a figure of all runs as an array over `dimensions`.

    `rows` has a dict for each run: what it sets, how it ended, its metrics; `dataset` all of it as an xarray Dataset.
    """

    def __init__(self, results: Results) -> None:
        self._results = results
        self._members = list(plan.members(results.study, results.draws))
        self._rows = list(results.rows())

    def completed(self) -> Self:
        """Itself. Raises: BlockFailed, whose `run` it is, where not one run has come to its end."""
        failed = [row for row in self._rows if row["status"] in running.FAILED]
        if failed and len(failed) == len(self._rows):
            error = BlockFailed(f"not one of {len(failed)} runs has come to its end; the first: {failed[0]['reason']}")
            error.run = self
            raise error
        return self

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """A dict for each run: what it sets by path, and names of values; `status`, `reason`; its metrics by name."""
        study = self._results.study
        several, called = len(study.variants) > 1, [axis for axis in study.grid if axis.names]
        return [
            {
                **({"variant": row["variant"]} if several else {}),
                **{axis.name: axis.labels[member.grid[study.grid.index(axis)]] for axis in called},
                **dict(member.settings),
                **{"status": row["status"], "reason": row["reason"]},
                **row["metrics"],
            }
            for member, row in zip(self._members, self._rows, strict=True)
        ]

    @property
    def dimensions(self) -> tuple[str, ...]:
        """The names of the axes of each figure: of variants, where there are several, of the grid, and of draws."""
        named = self._results.study.dimensions
        return named if len(self._results.study.variants) > 1 or len(named) == 1 else named[1:]

    def __getitem__(self, name: str) -> np.ndarray:
        """A figure of all runs, NaN where a run has none; `status`, `reason`, `seconds` and `steps` too.

        Raises: UnknownPort.
        """
        if name not in self._arrays:
            raise UnknownPort(f"there is no figure `{name}`", fix=nearest(name, self._arrays))
        return self._arrays[name]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def failed(self) -> int:
        """How many runs did not come to their end."""
        return sum(row["status"] in running.FAILED for row in self._rows)

    @property
    def warnings(self) -> list[str]:
        """The conditions that some runs do not keep, and why runs failed: in how many, and where first."""
        summary = running.summary(self._results)
        reasons = [f"{count} × {reason}, first in {name}" for reason, (count, name) in summary["reasons"].items()]
        return [*reasons, *summary["conditions"]]

    @property
    def seconds(self) -> float:
        """Wall-clock time of all (s)."""
        return self._results.seconds

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """All figures over the study's axes, as `study.nc` has them. Raises: MissingPackage."""
        coordinates, variables = datasets.arrays(self._results)
        found = dataset(coordinates, variables, {"title": self._results.study.title})
        return found if "variant" in self.dimensions else found.isel(variant=0, drop=True)

    @cached_property
    def _arrays(self) -> dict[str, np.ndarray]:
        _, variables = datasets.arrays(self._results)
        alone = "variant" not in self.dimensions
        return {
            name: values[0] if alone and axes[:1] == _ALONE else values for name, (axes, values, _) in variables.items()
        }

    # ---- words ----

    def _table(self) -> tuple[list[str], list[list[str]], str]:
        rows = self.rows[:SHOWN]
        names = dict.fromkeys(name for row in rows for name in row if name != "reason" or self.failed)
        cells = [[_cell(row[name]) if name in row else "" for name in names] for row in rows]
        more = f"and {len(self) - SHOWN} more; " if len(self) > SHOWN else ""
        return (
            [short_name(name) for name in names],
            cells,
            f"{more}{len(self)} runs, {self.failed or 'none'} failed, {self.seconds:.3g} s",
        )

    def __repr__(self) -> str:
        head, cells, words = self._table()
        return "\n".join([*aligned(head, cells, range(len(head))), "", words])

    def _repr_html_(self) -> str:
        head, cells, words = self._table()
        return f"{html_table(head, cells, range(len(head)))}<p>{words}</p>"


def _cell(value: Any) -> str:
    """A value in a table; of a long list its shape."""
    text = format_value(value)
    if len(text) <= WIDEST or "\n" in text:
        return text
    return f"{' × '.join(map(str, np.shape(value)))} values" if isinstance(value, list) else f"{text[: WIDEST - 1]}…"
