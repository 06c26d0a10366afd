"""Tables of a study as files: CSV with all digits, Markdown, and LaTeX."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from cosim.errors import ResultError
from cosim.machine import files
from cosim.results.latex_tables import latex
from cosim.results.text_table import TextTable
from cosim.study import file_names
from cosim.study.running import Results


def write(results: Results, made: Sequence[TextTable]) -> None:
    """Write each table in each form, beside the study's data set. Raises: ResultError."""
    for table in made:
        stem = file_names.stem(table.title)
        for ending, text in (("md", markdown(table)), ("tex", f"{latex(table)}\n"), ("csv", _csv(table))):
            path = results.kept_in / f"{stem}.{ending}"
            try:
                with files.fresh(path) as new:
                    new.write_text(text, encoding="utf-8", newline="")
            except OSError as error:
                raise ResultError(f"cannot write {path}: {error.strerror}", fix=files.usual_fix(error)) from None


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


def _csv(table: TextTable) -> str:
    text = io.StringIO()
    csv.writer(text).writerows(_numbers(table))
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
