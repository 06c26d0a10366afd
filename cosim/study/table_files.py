"""Tables of a study as files: CSV with all digits, Markdown, and LaTeX."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from cosim.errors import ResultError
from cosim.results.latex_tables import latex
from cosim.results.text_table import TextTable
from cosim.study import file_names
from cosim.study.running import Results


def write(results: Results, made: Sequence[TextTable]) -> None:
    """Write each table in each form, beside the study's data set. Raises: ResultError."""
    for table in made:
        path = results.kept_in / f"{file_names.stem(table.title)}.md"
        try:
            path.write_text(markdown(table), encoding="utf-8")
            path = path.with_suffix(".tex")
            path.write_text(f"{latex(table)}\n", encoding="utf-8")
            path = path.with_suffix(".csv")
            with path.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows(_numbers(table))
        except OSError as error:
            fix = "choose a folder that you may write to"
            raise ResultError(f"cannot write {path}: {error.strerror}", fix=fix) from None


def markdown(table: TextTable) -> str:
    """The table in Markdown."""
    text = io.StringIO()
    lines = [table.head, ["---"] * len(table.head), *table.rows]
    text.write(f"**{table.title}**\n\n")
    for line in lines:
        text.write("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n")
    for note in table.notes:
        text.write(f"\n{note}\n")
    return text.getvalue()


def _numbers(table: TextTable) -> list[list[str | float | None]]:
    """The head and the rows, with all digits; deviations have columns of their own, behind all others."""
    spread = [k for k in range(len(table.head) - table.labels) if any(row[k] is not None for row in table.deviations)]
    heads = [table.head[table.labels + k] for k in spread]
    named = [h.replace("mean ± std", "std") if "mean ± std" in h else f"{h}, std" for h in heads]
    lines: list[list[str | float | None]] = [[*table.head, *named]]
    for at, (texts, values) in enumerate(zip(table.rows, table.values, strict=True)):
        lines.append([*texts[: table.labels], *values, *(table.deviations[at][k] for k in spread)])
    return lines
