"""What a search has found, kept beside its runs for a report to show."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.errors import ResultError
from cosim.machine import files
from cosim.results.metrics import for_json, from_json
from cosim.study.definition import Study

FOLDER, NAME = "falsify", "found.json"
"""Of the folder in that of a study's results, and of the file in it."""


def keep(folder: Path, study: Study, answers: Sequence[dict[str, Any]]) -> None:
    """Write the answers of a search, in the place of what an earlier search of these requirements said.

    answers: as JSON has them, each with its `requirement`. Raises: ResultError, such as for a full disk.
    """
    known = {answer["requirement"]: answer for answer in (*read(folder, study), *answers)}
    content = {"study": _mark(study), "answers": known}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with files.fresh(folder / NAME) as path:
            path.write_text(json.dumps(for_json(content), ensure_ascii=False), encoding="utf-8")
    except OSError as error:
        message = f"cannot write {folder / NAME}: {error.strerror}"
        raise ResultError(message, fix=files.usual_fix(error)) from None


def read(folder: Path, study: Study) -> list[dict[str, Any]]:
    """The answers of a search of the study as it is now; none where there was none."""
    try:
        content = json.loads((folder / NAME).read_text(encoding="utf-8"))
        return list(from_json(content["answers"]).values()) if content["study"] == _mark(study) else []
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


def _mark(study: Study) -> str:
    """By what a study is known again."""
    return hashlib.sha256(study.text.encode()).hexdigest()
