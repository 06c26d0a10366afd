"""How long each part of something took, of wall-clock time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """laps: seconds by part, all of its times together."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}

    @contextmanager
    def lap(self, part: str) -> Iterator[None]:
        """Around a part."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.laps[part] = self.laps.get(part, 0.0) + time.perf_counter() - began


#: Of what a process does before its run begins.
START = Stopwatch()
