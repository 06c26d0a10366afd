"""What a file holds, as a digest."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path


def content_digest(path: Path) -> bytes:
    """The SHA-256 of a file's content, read anew where anything about the file has changed. Raises: OSError."""
    about = path.stat()
    return _digest(path.absolute(), about.st_mtime_ns, about.st_ctime_ns, about.st_size, about.st_ino)


@lru_cache(maxsize=1024)
def _digest(path: Path, *_about: int) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()
