"""A table of figures, as text and as numbers."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class TextTable:
    """A table as text, and its cells as numbers: values[row][column], None where there is none.

    notes: sentences to be read with it. deviations: as the values, of those that are means with ± behind them.
    """

    title: str
    head: list[str]
    rows: list[list[str]]
    values: list[list[float | None]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    deviations: list[list[float | None]] = field(default_factory=list)

    @property
    def labels(self) -> int:
        """How many columns, from the left, say what a row is."""
        return len(self.head) - len(self.values[0]) if self.values else 1
