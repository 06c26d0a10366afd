"""Sees that one of some files has another content: asked often when it was written, and what it holds where it was."""

from __future__ import annotations

import hashlib
import threading
import time as clock
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

LOOK = 0.05
"""Seconds between two looks."""
GONE = 0.5
"""Seconds for which a file may be away, or empty: editors save so."""
_Stamp = tuple[int, int, int] | None


@dataclass
class _Seen:
    stamp: _Stamp
    content: bytes
    away: float | None = None  # since when


class WatchedFiles:
    """changed: is called, by a thread of its own, as soon as any file is another."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._seen: dict[Path, _Seen] = {}
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def look_at(self, files: Iterable[Path], since: float) -> None:
        """Watch these files from now on. One that is new here and was written since a time (s) has changed."""
        wanted = list(files)
        with self._lock:
            new = {path: _Seen(_stamp(path), _content(path)) for path in wanted if path not in self._seen}
            self._seen = {path: self._seen.get(path) or new[path] for path in wanted}
        if any(seen.stamp and seen.stamp[0] >= 1e9 * since for seen in new.values()):
            self._changed()

    def stop(self) -> None:
        """Look at nothing any more."""
        self._stopped.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._stopped.wait(LOOK):
            with self._lock:
                found = [_is_another(path, seen) for path, seen in self._seen.items()]
            if any(found):
                self._changed()


def _is_another(path: Path, seen: _Seen) -> bool:
    """Whether a file's content is not what it was; notes what it is."""
    stamp = _stamp(path)
    if stamp == seen.stamp and seen.away is None:
        return False
    if stamp is None or stamp[1] == 0:
        seen.away = seen.away or clock.monotonic()
        if clock.monotonic() - seen.away < GONE:
            return False
    before, seen.stamp, seen.content, seen.away = seen.content, stamp, _content(path), None
    return seen.content != before


def _stamp(path: Path) -> _Stamp:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _content(path: Path) -> bytes:
    """A digest of a file's content; nothing where there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).digest()
    except OSError:
        return b""
