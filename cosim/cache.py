"""Object code on disk, in the user's cache folder: keyed by all that it depends on, written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from functools import cache
from importlib.metadata import version
from pathlib import Path


def folder() -> Path:
    """Where object code is kept: $COSIM_CACHE, else the user's cache folder of this operating system."""
    if chosen := os.environ.get("COSIM_CACHE"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "cosim" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "cosim"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "cosim"


@cache
def toolchain() -> tuple[str, ...]:
    """The versions of all that turns a function into code, our own part of it included."""
    own = b"".join(
        Path(__file__).with_name(f"{name}.py").read_bytes()
        for name in ("adapters", "checks", "compiler", "helpers", "intrinsics")
    )
    versions = (version("numba"), version("llvmlite"), f"{sys.version_info[:2]}")
    return (*versions, hashlib.sha256(own).hexdigest())


def write(path: Path, code: bytes) -> None:
    """Write so that another process sees the whole file or none. A read-only cache costs time, not the run."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".tmp", delete=False) as file:
            file.write(code)
        os.replace(file.name, path)
    except OSError:
        return
