"""What others maintain: an installed package, or Python itself, is known by its version and files."""

from __future__ import annotations

import sys
import types
from typing import Any

from cosim.compiling.fingerprint.feed import Feed, NoEnd
from cosim.machine import installed


class Packages:
    """The packages of which something is reached.

    home: the one whose own functions are followed. interpreted: what is called may look at files, the clock and the
    like; what is not known to be pure has no end then.
    """

    def __init__(self, feed: Feed, home: str, interpreted: bool) -> None:
        self._feed = feed
        self._home = home
        self._interpreted = interpreted

    def put(self, package: str, module: str, name: str) -> None:
        """Feed something of an installed package by its name and the package. Raises: NoEnd."""
        full = f"{module}.{name}".strip(".")
        if self._interpreted and not installed.is_pure(full):
            raise NoEnd(f"`{full}`")
        self._feed.put("installed", package, full)

    def is_home(self, module: str) -> bool:
        """Whether a module of that name is the author's own."""
        return installed.package(module) == self._home

    def of_module(self, module: types.ModuleType) -> str:
        """The installed package that a module is part of, with version and files; "" for an author's own module."""
        name = getattr(module, "__name__", "")
        if sys.modules.get(name) is not module or self.is_home(name):
            return ""
        return installed.text(installed.package(name), getattr(module, "__file__", None))

    def of(self, value: Any) -> str:
        """The installed package where a value is found under its own name; "" for anything else."""
        if not has_own_name(value):
            return ""
        module = sys.modules.get(value.__module__)
        found: Any = module
        for part in value.__qualname__.split("."):
            found = getattr(found, part, None)
        return self.of_module(module) if module is not None and found is value else ""


def has_own_name(value: Any) -> bool:
    """Whether a value is a module, class, function or the like, not an object that only has a class."""
    if isinstance(value, types.ModuleType):
        return True
    try:
        return isinstance(value.__qualname__, str) and isinstance(value.__module__, str)
    except Exception:  # noqa: BLE001  # an author's __getattr__ may raise anything
        return False
