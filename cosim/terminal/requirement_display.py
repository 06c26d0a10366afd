"""What a person sees of requirements: whether a run keeps them, by how much, and where the margin is smallest."""

from __future__ import annotations

from collections.abc import Iterable

from cosim.requirements.verdict import Verdict
from cosim.results.text_table import TextTable
from cosim.terminal import study_display


def show(verdicts: Iterable[Verdict]) -> None:
    """Print a line for each requirement."""
    rows = [[v.name, v.word, v.margin_text, v.unit, v.place] for v in verdicts]
    study_display.show(TextTable("", ["requirement", "", "margin", "unit", "smallest at"], rows), numbers=False)
