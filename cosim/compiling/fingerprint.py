"""A text that changes whenever a function could compute something else: its code and all that the code reaches.

What a function reads is found in its bytecode: each name of its globals, and through modules, which are only roads, the
attribute at the end (of ``a.b.SCALE`` the number). A value is followed to its ground: containers to their elements,
functions and jitted functions to their code, defaults and closures, classes to their members, objects to their state.
What an installed package or Python itself has is known by the package's version and files.

Where a road cannot be followed to its end (an open file, a C library's function pointer), no text would be right: the
one that is given then is unlike any other, so that nothing is ever found under it. Comments are not part of the text.
"""

from __future__ import annotations

import builtins
import copyreg
import functools
import hashlib
import struct
import sys
import types
import uuid
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cosim.compiling import bytecode
from cosim.machine import installed, memory

_ONCE = "once: "

_BACK_DOORS = frozenset(("__builtins__", "__globals__", "f_globals"))

#: Members of a class or module that say nothing of what its code computes.
_NOTHING_SAID = (
    "__abstractmethods__ __annotations__ __annotations_cache__ __annotate__ __annotate_func__ __builtins__ __cached__ "
    "__conditional_annotations__ __dict__ __doc__ __file__ __firstlineno__ __loader__ __module__ __path__ __spec__ "
    "__static_attributes__ __weakref__ _abc_impl"
)
_SILENT = frozenset(_NOTHING_SAID.split())


def fingerprint(function: Any, interpreted: bool = False, lines: bool = False) -> str:
    """The text of a function (or any other value).

    lines: where the code stands counts too, for what tells it in messages. interpreted: the function runs as plain
    Python, so that what it calls may look at files, the clock and the like; a function of a package that is not known
    to look at its arguments only is then a road without an end.
    """
    home = installed.package(getattr(function, "__module__", None) or "")
    try:
        return _Walk(home, interpreted, lines).digest(function).hex()
    except (_NoEnd, RecursionError) as found:
        reason = str(found) if isinstance(found, _NoEnd) else "values that are nested too deep"
        return f"{_ONCE}{reason}\n{uuid.uuid4().hex}"


def obstacle(text: str) -> str:
    """What keeps a fingerprint, or a text that one is part of, from holding for longer than now; "" if nothing does."""
    return text.partition(_ONCE)[2].partition("\n")[0]


_MISSING = object()


class _NoEnd(Exception):
    """A road that cannot be followed to its end."""


class _Walk:
    """Feeds a hash with a value and all that it reaches.

    What may be reached twice has a number, and is fed when its turn comes: so circles end, and long roads need no deep
    recursion. home: the package whose own functions are followed even if it is installed.
    """

    def __init__(self, home: str, interpreted: bool, lines: bool) -> None:
        self.home = home
        self.interpreted = interpreted
        self.lines = lines
        self._hash = hashlib.sha256()
        self._numbers: dict[int, int] = {}
        self._reached: list[Any] = []

    def digest(self, value: Any) -> bytes:
        """The digest of a value. Raises: _NoEnd."""
        self.value(value)
        for reached in self._reached:  # which grows meanwhile
            self._object(reached)
        return self._hash.digest()

    def value(self, value: Any) -> None:
        """Plain data at once, anything else by its number."""
        kind = type(value)
        if kind in _GROUND:
            self._put(kind.__name__, _GROUND[kind](value))
        elif kind is tuple:
            self._all("tuple", value)
        elif kind is slice:
            self._all("slice", (value.start, value.stop, value.step))
        elif kind in (frozenset, set):
            self._unordered(kind.__name__, value)
        elif isinstance(value, np.dtype):
            self._all("dtype", value.__reduce__()[1:])
        elif kind is np.ndarray and not value.dtype.hasobject:
            self._array(value)
        elif isinstance(value, np.generic) and not value.dtype.hasobject:
            self.value(value.dtype)
            self._put("scalar", value.tobytes())
        else:
            if id(value) not in self._numbers:
                self._numbers[id(value)] = len(self._reached)
                self._reached.append(value)
            self._put("object", self._numbers[id(value)])

    def _object(self, value: Any) -> None:
        kind = type(value)
        if isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.CodeType):
            self._code(value, {})
        elif isinstance(value, types.ModuleType):
            self._module(value)
        elif isinstance(value, type):
            self._class(value)
        elif kind in (list, np.ndarray):
            self._all(kind.__name__, (*getattr(value, "shape", ()), *(value.flat if kind is np.ndarray else value)))
        elif kind in (dict, types.MappingProxyType):
            self._all(kind.__name__, (part for item in value.items() for part in item))
        elif isinstance(value, types.MethodType):
            self._all("method", (value.__func__, value.__self__))
        elif isinstance(value, _SLOTS):
            self._all("slot", (value.__objclass__, value.__name__))
        elif isinstance(value, (staticmethod, classmethod)):
            self._all(kind.__name__, (value.__func__,))
        elif isinstance(value, property):
            self._all("property", (value.fget, value.fset, value.fdel))
        elif isinstance(value, functools.cached_property):
            self._all("cached", (value.func,))
        elif kind is _LRU:
            self._all("lru", (value.__wrapped__,))
        elif jitted := _jitted(value):
            self._all(kind.__name__, jitted)
        elif package := self._installed(value):
            self._named(package, value.__module__, value.__qualname__)
        elif isinstance(value, _BUILTIN):
            self._all("builtin", (value.__name__, value.__self__))
        else:
            self._instance(value)

    def _put(self, *parts: str | bytes | int) -> None:
        for part in parts:
            data = part if isinstance(part, bytes) else str(part).encode("utf-8", "surrogatepass")
            self._hash.update(b"%d:" % len(data) + data)

    def _all(self, kind: str, values: Iterable[Any]) -> None:
        values = list(values)
        self._put(kind, len(values))
        for value in values:
            self.value(value)

    def _unordered(self, kind: str, values: Iterable[Any]) -> None:
        """The elements of a set come in an order that differs between processes."""
        digests = sorted(_Walk(self.home, self.interpreted, self.lines).digest(value) for value in values)
        self._put(kind, len(digests), *digests)

    def _array(self, value: np.ndarray) -> None:
        flags = value.flags
        self.value(value.dtype)
        self._all("array", (*value.shape, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned))
        self._put(value.tobytes())

    # ---- code ----

    def _function(self, function: types.FunctionType) -> None:
        if function.__module__ == memory.__name__ and vars(memory).get(function.__name__) is function:
            self._put("memory", function.__name__)  # what it is in compiled code, `cosim.compiling.intrinsics` says
            return
        scope = function.__globals__
        module = sys.modules.get(str(scope.get("__name__")))
        package = self._package(module) if module and vars(module) is scope else ""
        cells = [_content(cell) for cell in function.__closure__ or ()]
        if package:
            public = self._installed(function)
            self._named(package, function.__module__ if public else str(scope["__name__"]), function.__qualname__)
            self._all("closure", cells)
            return
        self._all("function", (function.__defaults__, function.__kwdefaults__, vars(function), *cells))
        self._code(function.__code__, scope)

    def _code(self, code: types.CodeType, scope: dict[str, Any]) -> None:
        arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        self._put("code", code.co_code, code.co_exceptiontable, *arguments)
        if self.lines:
            self._put(Path(code.co_filename).name, code.co_firstlineno, code.co_linetable)
        self._all("names", (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._code(constant, scope)
            else:
                self.value(constant)
        if self.interpreted and not _BACK_DOORS.isdisjoint(code.co_names):
            raise _NoEnd("the globals of a function")
        found, imported = bytecode.reads(code)
        for road in sorted(found):
            self._follow(road, scope)
        for name, level, names in sorted(imported):
            self._import(name, level, names, scope)

    def _follow(self, road: tuple[str, ...], scope: dict[str, Any]) -> None:
        """A dotted name from the globals to the first value that is no module."""
        self._put("road", ".".join(road))
        self._end(scope.get(road[0], vars(builtins).get(road[0], _MISSING)), road[1:])

    def _end(self, value: Any, names: Iterable[str]) -> None:
        """What the names lead to from a value, through modules."""
        for name in names:
            if not isinstance(value, types.ModuleType):
                break
            module, value = value, _attribute(value, name)
            package = self._package(module)
            if (
                package
                and (isinstance(value, (_BUILTIN, types.MethodType)) or not _has_own_name(value))
                and value is not _MISSING
            ):
                self._named(package, module.__name__, name, value)
                return
        if value is _MISSING:
            self._put("missing")
        else:
            self.value(value)

    def _import(self, name: str, level: int, names: tuple[str, ...], scope: dict[str, Any]) -> None:
        """A module that the function imports when it runs, or what it takes from it."""
        if level:
            parents = str(scope.get("__package__") or "").split(".")
            name = ".".join([*parents[: len(parents) - level + 1], *([name] if name else [])])
        module = self._imported(name)
        if not names or "*" in names:
            self.value(sys.modules[name.partition(".")[0]])
            self.value(module)
            return
        for part in names:
            self._put("import", name, part)
            if _attribute(module, part) is _MISSING:
                self.value(self._imported(f"{name}.{part}"))
            else:
                self._end(module, (part,))

    def _imported(self, name: str) -> types.ModuleType:
        """A module that is imported already, or that somebody else maintains."""
        try:
            if name not in sys.modules and installed.package(name) != self.home:
                import_module(name)
            return sys.modules[name]
        except Exception:  # whatever a module raises
            raise _NoEnd(f"`import {name}` in a function") from None

    # ---- modules, classes, objects ----

    def _module(self, module: types.ModuleType) -> None:
        """A module from which anything may be read."""
        if package := self._package(module):
            self._named(package, module.__name__, "")
        else:
            self._members("module", module)

    def _class(self, value: type) -> None:
        if package := self._installed(value):
            self._named(package, value.__module__, value.__qualname__)
            return
        self._all(value.__qualname__, (type(value), *value.__bases__))
        self._members("class", value)

    def _members(self, kind: str, value: Any) -> None:
        members = {name: member for name, member in vars(value).items() if name not in _SILENT}
        self._all(kind, (part for item in sorted(members.items(), key=lambda item: str(item[0])) for part in item))

    def _instance(self, value: Any) -> None:
        """An object by its class, its state, and what it says of itself to be copied, which C code may hold."""
        kind = type(value)
        self._put("instance")
        self.value(kind)
        if not self._installed(kind):
            self._all("state", (getattr(value, "__dict__", None), *_slots(value)))
        try:
            reduce = copyreg.dispatch_table.get(kind)
            parts = reduce(value) if reduce else value.__reduce_ex__(4)
            listed = (parts,) if isinstance(parts, str) else [list(p) if isinstance(p, Iterator) else p for p in parts]
        except Exception:  # whatever an author's or a package's own method raises
            raise _NoEnd(f"a {kind.__module__}.{kind.__qualname__}") from None
        self._all("reduced", listed)

    # ---- what others maintain ----

    def _named(self, package: str, module: str, name: str, value: Any = _MISSING) -> None:
        """Something of an installed package: plain data by its value, all else by its name and the package."""
        if isinstance(value, _DATA):
            self.value(value)
            return
        full = f"{module}.{name}".strip(".")
        if self.interpreted and not installed.is_pure(full):
            raise _NoEnd(f"`{full}`")
        self._put("installed", package, full)

    def _package(self, module: types.ModuleType) -> str:
        """The installed package that a module is part of, with version and files; "" for an author's own module."""
        name = getattr(module, "__name__", "")
        if sys.modules.get(name) is not module or installed.package(name) == self.home:
            return ""
        return installed.text(installed.package(name), getattr(module, "__file__", None))

    def _installed(self, value: Any) -> str:
        """The installed package where a value is found under its own name; "" for anything else."""
        if not _has_own_name(value):
            return ""
        module = sys.modules.get(value.__module__)
        found: Any = module
        for part in value.__qualname__.split("."):
            found = getattr(found, part, None)
        return self._package(module) if module is not None and found is value else ""


_LRU = type(functools.lru_cache(maxsize=1)(lambda: None))
_BUILTIN = types.BuiltinFunctionType
_SLOTS = (
    types.MemberDescriptorType,
    types.GetSetDescriptorType,
    types.WrapperDescriptorType,
    types.MethodDescriptorType,
    types.ClassMethodDescriptorType,
)
_DATA = (type(None), bool, int, float, complex, str, bytes, tuple, np.ndarray, np.generic)
_GROUND: dict[type, Callable[[Any], str | bytes]] = {
    type(None): str,
    type(...): str,
    type(NotImplemented): str,
    bool: str,
    int: hex,
    float: lambda value: struct.pack("<d", value),
    complex: lambda value: struct.pack("<dd", value.real, value.imag),
    str: str,
    bytes: bytes,
    range: str,
}


def _jitted(value: Any) -> tuple[Any, ...]:
    """What numba makes a jitted function, ufunc or callback of; () for anything else. Does not import numba."""
    if not type(value).__module__.startswith("numba."):
        return ()
    from numba.core import ccallback, dispatcher, extending, types
    from numba.np.ufunc import dufunc, gufunc

    made: Any = value
    if isinstance(value, dispatcher.Dispatcher):
        signatures = None if made._can_compile else [str(s) for s in made.nopython_signatures]
        return made.py_func, made.targetoptions, made.locals, signatures
    if isinstance(value, dufunc.DUFunc):
        return made._dispatcher.py_func, made.targetoptions, made.identity, made.types if made._frozen else None
    if isinstance(value, gufunc.GUFunc):
        builder = made.gufunc_builder
        return builder.py_func, builder.signature, builder.targetoptions, made.types if made._frozen else None
    if isinstance(value, ccallback.CFunc):
        return made._pyfunc, str(made._sig)
    if isinstance(value, extending._Intrinsic):
        return (made._defn,)
    return (str(made),) if isinstance(value, types.Type) else ()


def _content(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _attribute(module: types.ModuleType, name: str) -> Any:
    try:
        return getattr(module, name)
    except Exception:  # a module's own __getattr__ may raise anything
        return _MISSING


def _has_own_name(value: Any) -> bool:
    """Whether a value is a module, class, function or the like, not an object that only has a class."""
    if isinstance(value, types.ModuleType):
        return True
    try:
        return isinstance(value.__qualname__, str) and isinstance(value.__module__, str)
    except Exception:  # an author's __getattr__ may raise anything
        return False


def _slots(value: Any) -> Iterator[Any]:
    for base in type(value).__mro__:
        for name, slot in vars(base).items():
            if isinstance(slot, types.MemberDescriptorType):
                yield name
                yield getattr(value, name, None)
