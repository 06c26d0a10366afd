"""The files that an editor has open: their texts, what was last read of each, and answers about them."""

from __future__ import annotations

import re
import time as clock
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosim.editor import cursor, homes, hovering, reading, renaming, suggestions
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading
from cosim.editor.renaming import Edit
from cosim.editor.suggestions import Suggestion
from cosim.errors import Position
from cosim.language import unsaved
from cosim.wiring import catalogue
from cosim.wiring.catalogue import Group

_OURS = re.compile(r"^['\"]?(blocks|extends|diagram|run)['\"]?\s*:", re.MULTILINE)
_ANY_KEY = re.compile(r"^['\"]?[^\W\d][^:#\n]*:(\s|$)", re.MULTILINE)


SLOW = 0.05
"""A text that takes longer (s) to read is not read anew at each key: answers are of what the last check found."""


@dataclass(frozen=True)
class _Read:
    """What a file said, when these texts were open; seconds: how long reading took."""

    found: Reading
    texts: dict[Path, str]
    seconds: float


@dataclass
class Workbench:
    """Lines and columns count from 0. project: the folder in which Python files of blocks are looked for."""

    project: Path | None = None
    texts: dict[Path, str] = field(default_factory=dict)
    _read: dict[Path, _Read] = field(default_factory=dict)
    _own: list[Group] | None = None

    def put(self, path: Path, text: str) -> bool:
        """A file's text, as it stands in the editor; whether it is looked at: there is YAML of many kinds."""
        is_new = path not in self._read  # else it was one of ours, and what it says now may be half of it
        if path.suffix not in (".yaml", ".yml") or (is_new and _ANY_KEY.search(text) and not _OURS.search(text)):
            self.texts.pop(path, None)
            return False
        self.texts[path] = text
        self.project = self.project or path.parent
        return True

    def close(self, path: Path) -> None:
        """The file's own text counts again."""
        self.texts.pop(path, None)
        self._read.pop(path, None)

    def _own_blocks(self) -> list[Group]:
        """Of the project's Python files, as they were when one was saved last: there may be many to look through."""
        if self._own is None:
            self._own = catalogue.own(self.project) if self.project else []
        return self._own

    def saved(self) -> None:
        """Files that are not open may have changed: Python files of blocks, for instance."""
        self._own = None
        self._read = {path: replace(last, texts={}) for path, last in self._read.items()}

    def reading(self, path: Path) -> Reading:
        """What a file says, anew if its text or one below has changed; broken YAML has the blocks it had before."""
        last = self._read.get(path)
        if last and all(self.texts.get(file) == last.texts.get(file) for file in last.found.files):
            return last.found
        began = clock.perf_counter()
        with unsaved.counting(self.texts):
            found = reading.read(path).after(last.found if last else None)
        self._read[path] = _Read(found, dict(self.texts), clock.perf_counter() - began)
        return found

    def suggestions(self, path: Path, line: int, column: int) -> tuple[Cursor, list[Suggestion]]:
        """What may be written at a place, and the word whose place it takes."""
        here, found = self._at(path, line, column)
        before = self.texts[path].split("\n")[line][: here.begin]
        if before.endswith("["):
            taken = suggestions.members(before, found)
            if taken:
                return here, taken
        return here, suggestions.suggest(here, found, self._own_blocks)

    def page(self, path: Path, line: int, column: int) -> tuple[Cursor, str]:
        """What the word there means."""
        here, found = self._at(path, line, column)
        return here, hovering.page(here, found)

    def home(self, path: Path, line: int, column: int) -> Position | None:
        """Where what the word there stands for is written."""
        return homes.find(*self._at(path, line, column))

    def renamed_at(self, path: Path, line: int, column: int) -> tuple[Cursor, str]:
        """The block whose name is there; "" for none."""
        here, found = self._at(path, line, column)
        return here, renaming.renamed_at(here, found)

    def renaming(self, old: str, new: str, path: Path) -> list[Edit]:
        """As of `renaming.edits`, in what the editor shows."""
        with unsaved.counting(self.texts):
            return renaming.edits(old, new, path)

    def _at(self, path: Path, line: int, column: int) -> tuple[Cursor, Reading]:
        last = self._read.get(path)
        found = last.found if last and last.seconds > SLOW else self.reading(path)
        return cursor.find(self.texts[path], line, column), found
