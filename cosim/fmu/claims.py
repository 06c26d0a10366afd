"""How many instances of each FMU live in this process, for those of which there can be only one."""

from __future__ import annotations

import threading
from collections import Counter
from pathlib import Path

_claimed: Counter[Path] = Counter()
_lock = threading.Lock()


def claim(library: Path, count: int, alone: bool) -> bool:
    """Count new instances of a library; alone: unless it has some already. Returns whether they may be made."""
    with _lock:
        if alone and _claimed[library]:
            return False
        _claimed[library] += count
        return True


def give_back(library: Path, count: int) -> None:
    """Count instances no more."""
    with _lock:
        _claimed[library] -= count
