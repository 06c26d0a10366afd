"""Where the names in a function's code lead."""

from __future__ import annotations

import builtins
import sys
import types
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cosim.compiling.fingerprint import bytecode
from cosim.compiling.fingerprint.feed import Feed, NoEnd
from cosim.compiling.fingerprint.packages import Packages, has_own_name

_BACK_DOORS = frozenset(("__builtins__", "__globals__", "f_globals"))
_DATA = (type(None), bool, int, float, complex, str, bytes, tuple, np.ndarray, np.generic)
_MISSING = object()


class Roads:
    """Follows what code reads, through modules, which are only roads, to the attribute at the end.

    interpreted: the code runs as plain Python; lines: where it stands counts too.
    """

    def __init__(self, feed: Feed, packages: Packages, interpreted: bool, lines: bool) -> None:
        self._feed = feed
        self._packages = packages
        self._interpreted = interpreted
        self._lines = lines

    def code(self, code: types.CodeType, scope: dict[str, Any]) -> None:
        """Feed code, and all that it reads of its globals. Raises: NoEnd."""
        self._feed_text(code)
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self.code(constant, scope)
            else:
                self._feed.value(constant)
        if self._interpreted and not _BACK_DOORS.isdisjoint(code.co_names):
            raise NoEnd("the globals of a function")
        found, imported = bytecode.reads(code)
        for road in sorted(found):
            self._follow(road, scope)
        for name, level, names in sorted(imported):
            self._import(name, level, names, scope)

    def _feed_text(self, code: types.CodeType) -> None:
        arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        self._feed.put("code", code.co_code, code.co_exceptiontable, *arguments)
        if self._lines:
            self._feed.put(Path(code.co_filename).name, code.co_firstlineno, code.co_linetable)
        self._feed.all("names", (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))

    def _follow(self, road: tuple[str, ...], scope: dict[str, Any]) -> None:
        """A dotted name from the globals to the first value that is no module."""
        self._feed.put("road", ".".join(road))
        self._end(scope.get(road[0], vars(builtins).get(road[0], _MISSING)), road[1:])

    def _end(self, value: Any, names: Iterable[str]) -> None:
        """What the names lead to from a value, through modules."""
        for name in names:
            if not isinstance(value, types.ModuleType):
                break
            module, value = value, _attribute(value, name)
            package = self._packages.of_module(module)
            if package and value is not _MISSING and _is_only_there(value):
                self._put_attribute(package, module.__name__, name, value)
                return
        if value is _MISSING:
            self._feed.put("missing")
        else:
            self._feed.value(value)

    def _put_attribute(self, package: str, module: str, name: str, value: Any) -> None:
        """An attribute of an installed module: plain data by its value, all else by its name and the package."""
        if isinstance(value, _DATA):
            self._feed.value(value)
        else:
            self._packages.put(package, module, name)

    def _import(self, name: str, level: int, names: tuple[str, ...], scope: dict[str, Any]) -> None:
        """A module that the function imports when it runs, or what it takes from it."""
        if level:
            parents = str(scope.get("__package__") or "").split(".")
            name = ".".join([*parents[: len(parents) - level + 1], *([name] if name else [])])
        module = self._imported(name)
        if not names or "*" in names:
            self._feed.value(sys.modules[name.partition(".")[0]])
            self._feed.value(module)
            return
        for part in names:
            self._feed.put("import", name, part)
            if _attribute(module, part) is _MISSING:
                self._feed.value(self._imported(f"{name}.{part}"))
            else:
                self._end(module, (part,))

    def _imported(self, name: str) -> types.ModuleType:
        """A module that is imported already, or that somebody else maintains."""
        try:
            if name not in sys.modules and not self._packages.is_home(name):
                import_module(name)
            return sys.modules[name]
        except Exception:  # noqa: BLE001  # whatever a module raises
            raise NoEnd(f"`import {name}` in a function") from None


def _attribute(module: types.ModuleType, name: str) -> Any:
    try:
        return getattr(module, name)
    except Exception:  # noqa: BLE001  # a module's own __getattr__ may raise anything
        return _MISSING


def _is_only_there(value: Any) -> bool:
    """Whether an attribute of a module is known by no name of its own, or by none that leads back to it."""
    return isinstance(value, types.BuiltinFunctionType | types.MethodType) or not has_own_name(value)
