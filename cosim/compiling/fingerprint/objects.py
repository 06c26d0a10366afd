"""What code reaches and is no plain data: each by what could make it compute something else."""

from __future__ import annotations

import copyreg
import functools
import sys
import types
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from cosim.compiling.fingerprint.feed import Feed, NoEnd
from cosim.compiling.fingerprint.jitted import made_of
from cosim.compiling.fingerprint.packages import Packages
from cosim.compiling.fingerprint.roads import Roads
from cosim.machine import memory

#: Members of a class or module that say nothing of what its code computes.
_NOTHING_SAID = (
    "__abstractmethods__ __annotations__ __annotations_cache__ __annotate__ __annotate_func__ __builtins__ __cached__ "
    "__conditional_annotations__ __dict__ __doc__ __file__ __firstlineno__ __loader__ __module__ __path__ __spec__ "
    "__static_attributes__ __weakref__ _abc_impl"
)
_SILENT = frozenset(_NOTHING_SAID.split())

_LRU = type(functools.lru_cache(maxsize=1)(lambda: None))
_SLOTS = (
    types.MemberDescriptorType,
    types.GetSetDescriptorType,
    types.WrapperDescriptorType,
    types.MethodDescriptorType,
    types.ClassMethodDescriptorType,
)


class ObjectFeed:
    """Feeds functions by their code, classes by their members, containers by their elements, others by their state."""

    def __init__(self, feed: Feed, packages: Packages, roads: Roads) -> None:
        self._feed = feed
        self._packages = packages
        self._roads = roads

    def follow(self, value: Any) -> None:
        """Feed anything but plain data. Raises: NoEnd."""
        if isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.CodeType):
            self._roads.code(value, {})
        elif isinstance(value, types.ModuleType):
            self._module(value)
        elif isinstance(value, type):
            self._class(value)
        elif held := _held(value):
            self._feed.all(*held)
        elif package := self._packages.of(value):
            self._packages.put(package, value.__module__, value.__qualname__)
        elif isinstance(value, types.BuiltinFunctionType):
            self._feed.all("builtin", (value.__name__, value.__self__))
        else:
            self._instance(value)

    def _function(self, function: types.FunctionType) -> None:
        if function.__module__ == memory.__name__ and vars(memory).get(function.__name__) is function:
            # what it is in compiled code, `cosim.compiling.intrinsics` says
            self._feed.put("memory", function.__name__)
            return
        scope = function.__globals__
        module = sys.modules.get(str(scope.get("__name__")))
        package = self._packages.of_module(module) if module and vars(module) is scope else ""
        cells = [_content(cell) for cell in function.__closure__ or ()]
        if package:
            home = function.__module__ if self._packages.of(function) else str(scope["__name__"])
            self._packages.put(package, home, function.__qualname__)
            self._feed.all("closure", cells)
            return
        self._feed.all("function", (function.__defaults__, function.__kwdefaults__, vars(function), *cells))
        self._roads.code(function.__code__, scope)

    def _module(self, module: types.ModuleType) -> None:
        """A module from which anything may be read."""
        if package := self._packages.of_module(module):
            self._packages.put(package, module.__name__, "")
        else:
            self._members("module", module)

    def _class(self, value: type) -> None:
        if package := self._packages.of(value):
            self._packages.put(package, value.__module__, value.__qualname__)
            return
        self._feed.all(value.__qualname__, (type(value), *value.__bases__))
        self._members("class", value)

    def _members(self, kind: str, value: Any) -> None:
        members = {name: member for name, member in vars(value).items() if name not in _SILENT}
        self._feed.all(kind, (part for item in sorted(members.items(), key=lambda item: str(item[0])) for part in item))

    def _instance(self, value: Any) -> None:
        """An object by its class, its state, and what it says of itself to be copied, which C code may hold."""
        kind = type(value)
        self._feed.put("instance")
        self._feed.value(kind)
        if not self._packages.of(kind):
            self._feed.all("state", (getattr(value, "__dict__", None), *_slots(value)))
        try:
            reduce = copyreg.dispatch_table.get(kind)
            parts = reduce(value) if reduce else value.__reduce_ex__(4)
            listed = (parts,) if isinstance(parts, str) else [list(p) if isinstance(p, Iterator) else p for p in parts]
        except Exception:  # noqa: BLE001  # whatever an author's or a package's own method raises
            raise NoEnd(f"a {kind.__module__}.{kind.__qualname__}") from None
        self._feed.all("reduced", listed)


def _held(value: Any) -> tuple[str, Iterable[Any]] | None:
    """The name of what only holds other values, and those; None for anything else."""
    kind = type(value)
    if kind is list:
        return "list", value
    if kind is np.ndarray:
        return "ndarray", (*value.shape, *value.flat)
    if kind in (dict, types.MappingProxyType):
        return kind.__name__, (part for item in value.items() for part in item)
    if isinstance(value, types.MethodType):
        return "method", (value.__func__, value.__self__)
    if isinstance(value, _SLOTS):
        return "slot", (value.__objclass__, value.__name__)
    if isinstance(value, (staticmethod, classmethod)):
        return kind.__name__, (value.__func__,)
    if isinstance(value, property):
        return "property", (value.fget, value.fset, value.fdel)
    if isinstance(value, functools.cached_property):
        return "cached", (value.func,)
    if kind is _LRU:
        return "lru", (value.__wrapped__,)
    jitted = made_of(value)
    return (kind.__name__, jitted) if jitted else None


def _content(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _slots(value: Any) -> Iterator[Any]:
    for base in type(value).__mro__:
        for name, slot in vars(base).items():
            if isinstance(slot, types.MemberDescriptorType):
                yield name
                yield getattr(value, name, None)
