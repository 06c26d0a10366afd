"""Versions of what computed a result."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib import metadata

import numpy as np


def versions() -> dict[str, str]:
    """Of this program, Python, the system and the packages that a result may depend on; without importing them."""
    found = {"python": platform.python_version(), "platform": platform.platform(terse=True), "numpy": np.__version__}
    for package in ("cosim", "numba", "llvmlite"):
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found
