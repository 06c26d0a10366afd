"""Versions of what computed a result."""

from __future__ import annotations

import platform

import numpy as np

from cosim.machine import distributions


def versions() -> dict[str, str]:
    """Of this program, Python, the system and the packages that a result may depend on; without importing them."""
    found = {"python": platform.python_version(), "platform": platform.platform(terse=True), "numpy": np.__version__}
    ours = distributions.versions("cosim", "numba", "llvmlite")
    return found | {package: version for package, version in ours.items() if version}
