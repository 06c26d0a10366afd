"""What others maintain: packages that are installed, by version and files, and which of them look at nothing else."""

from __future__ import annotations

import hashlib
import os
import sys
from functools import cache
from pathlib import Path

from cosim.machine import distributions

_KNOWN = (
    "__future__ abc array bisect builtins cmath collections contextlib copy copyreg dataclasses decimal enum fractions "
    "functools heapq itertools logging math numba numbers numpy operator re scipy statistics string struct textwrap "
    "types typing warnings"
)
_ELSEWHERE = (
    "builtins.__import__ builtins.breakpoint builtins.compile builtins.eval builtins.exec builtins.globals "
    "builtins.input numpy.DataSource numpy.ctypeslib numpy.fromfile numpy.fromregex numpy.genfromtxt numpy.lib "
    "numpy.load numpy.loadtxt numpy.memmap numpy.random scipy.datasets scipy.io scipy.stats"
)
#: Packages whose functions look at nothing but their arguments, and what in them does not keep to that.
PURE, IMPURE = frozenset(_KNOWN.split()), frozenset(_ELSEWHERE.split())


def package(module: str) -> str:
    """The package that a module is part of."""
    return module.partition(".")[0]


def is_pure(full: str) -> bool:
    """Whether what is called so, module and name, looks at its arguments only."""
    parts = full.split(".")
    outside = any(".".join(parts[: n + 1]) in IMPURE for n in range(len(parts)))
    whole = full in ("numpy", "scipy", "builtins")  # handed on as a whole, with all that is impure in it
    return not PURE.isdisjoint((parts[0], parts[0].lstrip("_"))) and not outside and not whole


@cache
def text(package: str, file: str | None) -> str:
    """The version of Python for a module of its own; version and files of the installed package that has a file."""
    if package in sys.stdlib_module_names and (file is None or Path(os.__file__).parent in Path(file).parents):
        return f"Python {sys.version}"
    path = Path(file or "")
    folder = next((parent.parent for parent in path.parents if parent.name == package), None)
    if folder is None:
        return ""
    there = distributions.installed_in(str(folder))
    for distribution in sorted(there, key=lambda one: one.name != package.lower()):  # most are called like it
        lines = distribution.text("RECORD").splitlines()  # file, hash, size
        own = [line for line in lines if line.startswith(f"{package}/") and ".pyc," not in line]
        if any(line.startswith(f"{path.relative_to(folder).as_posix()},") for line in own):
            return f"{package} {distribution.version} {hashlib.sha256(' '.join(own).encode()).hexdigest()}"
    return ""
