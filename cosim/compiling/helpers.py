"""Plain-Python helpers of kernels, as numba sees them: typed and lowered on demand, but never made machine code.

`numba.njit` would optimise each helper by itself, wrap it for Python and emit code that nobody calls. Here a helper
stays unoptimised IR in the library of whoever calls it, and LLVM optimises the whole once. See
`cosim.compiling.compiler`.
"""

from __future__ import annotations

import gc
import types as python_types
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numba.core import config as numba_config
from numba.core import sigutils
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.types import BooleanLiteral, IntegerLiteral, unliteral

from cosim.authoring.author_source import shown
from cosim.authoring.lowering import routines
from cosim.compiling import checks, intrinsics
from cosim.compiling.fingerprint.text import fingerprint
from cosim.compiling.known_calls import KnownCalls
from cosim.compiling.linking import Codegen
from cosim.errors import KernelError, Position
from cosim.machine import memory


class Target:
    """What a dispatcher asks for: numba's own processor target, with ahead-of-time code generation and our faults."""

    options = cpu_target.options

    def __init__(self) -> None:
        codegen: Any = Codegen
        self.typing_context = KnownCalls.beside(cpu_target.typing_context)
        self.target_context = cpu_target.target_context.subtarget(
            _internal_codegen=codegen("cosim"), aot_mode=True, typing_context=self.typing_context
        )
        self.target_context.__class__ = checks.Context
        self.target_context.refresh()


@cache
def target() -> Target:
    """One target for all kernels of a process."""
    return Target()


@contextmanager
def unoptimised() -> Iterator[None]:
    """Keep numba from optimising what `cosim.compiling.emission.emit` optimises anyway. Needs numba's compiler lock.

    Garbage is not collected meanwhile: numba's graphs of objects are large, and there is none among them.
    """
    config: Any = numba_config
    level, collects = config.OPT, gc.isenabled()
    config.OPT = type(level)(0)
    gc.disable()
    try:
        yield
    finally:
        config.OPT = level
        if collects:
            gc.enable()


class Helper(CPUDispatcher):
    """A Python function that compiled functions may call.

    disjoint: arrays that it writes share no memory with its other arguments; checked: see `cosim.compiling.checks`.
    """

    def __init__(self, function: Callable[..., Any], disjoint: bool, checked: bool) -> None:
        self.targetdescr: Any = target()
        options = {"nopython": True, "error_model": "numpy"}
        super().__init__(function, targetoptions=options, pipeline_class=checks.Compiler if checked else Compiler)
        self._compiler: Any
        self._compiler._customize_flags = self._flags
        self._disjoint = disjoint
        self.checked = checked

    def _flags(self, flags: Any) -> Any:
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        flags.noalias = self._disjoint
        flags.boundscheck = self.checked
        return flags

    def add_overload(self, result: Any) -> None:
        """Make a compiled signature known to callers; its descriptor is the key, as there is no machine code."""
        self.overloads[tuple(result.signature.args)] = result
        self.targetctx.insert_user_function(result.fndesc, result.fndesc, [result.library])

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """numba's own; the framework's own code is compiled once for all constants, which LLVM puts in anyway."""
        if not self.checked:
            args = tuple(_width(a) for a in args)
        return super().get_call_template(args, kws)

    def get_overload(self, signature: Any) -> Any:
        """The key of a compiled signature."""
        arguments, _ = sigutils.normalize_signature(signature)
        found: Any = self.overloads[tuple(arguments)]
        return found.fndesc


def _width(kind: Any) -> Any:
    """The type of a constant whole number or truth value; any other type as it is."""
    return unliteral(kind) if isinstance(kind, (IntegerLiteral, BooleanLiteral)) else kind


_helpers: dict[Any, Helper] = {}


def with_compiled_globals(
    function: Callable[..., Any],
    disjoint: bool = False,
    checked: bool = False,
    inside: tuple[Any, ...] = (),
    absent: Mapping[Any, Any] = MappingProxyType({}),
) -> Callable[..., Any]:
    """A copy of a function whose plain-Python helpers are compiled and whose memory access is machine code.

    disjoint, checked: of the helpers, see `Helper`; inside: the functions that are being looked through. absent: as of
    `KernelSource`. Raises: KernelError for a recursion.
    """
    scope = dict(function.__globals__)
    for name in _names(function.__code__):
        value = _plain(scope.get(name))
        if name in scope:
            scope[name] = value
        value = absent.get(value, value) if isinstance(value, python_types.FunctionType) else value
        value = getattr(value, "py_func", value)  # an author's jitted function is compiled as the others are
        if not isinstance(value, python_types.FunctionType) or value.__module__.startswith("numba."):
            continue
        if value is routines.same_size:
            scope[name] = intrinsics.same_size
            continue
        if value.__module__ == memory.__name__:
            value = getattr(intrinsics, value.__name__)
            if not isinstance(value, python_types.FunctionType):
                scope[name] = value
                continue
        if value in inside:
            code = value.__code__
            place = Position(shown(code.co_filename), code.co_firstlineno, 1)
            raise KernelError(f"{name}() calls itself", place, "write the recursion as a loop")
        scope[name] = _helper(value, disjoint, checked, (*inside, value), absent)
    cells = tuple(map(_widened, function.__closure__ or ())) or None
    copy = python_types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__, cells)
    copy.__module__ = function.__module__
    return copy


def _plain(value: Any) -> Any:
    """Python's own number for one of numpy's, of which numba would keep the width; also inside a tuple."""
    if isinstance(value, np.generic):
        return value.item()
    if type(value) is tuple:
        plain = tuple(map(_plain, value))
        return plain if any(a is not b for a, b in zip(plain, value, strict=True)) else value
    return value


def _widened(cell: Any) -> Any:
    """A cell of a closure, with a number of Python's own for one of numpy's."""
    try:
        value = cell.cell_contents
    except ValueError:  # nothing is in it yet
        return cell
    plain = _plain(value)
    return cell if plain is value else python_types.CellType(plain)


def _helper(
    function: Callable[..., Any], disjoint: bool, checked: bool, inside: tuple[Any, ...], absent: Mapping[Any, Any]
) -> Helper:
    """One helper for all functions of the same code that see the same values, so that blocks share its IR.

    The framework's own functions stay as they are, so each is its own.
    """
    file = function.__code__.co_filename
    code = (function.__qualname__, file, fingerprint(function, lines=True)) if checked else function
    key = (code, disjoint, checked, *absent)
    if key not in _helpers:
        compiled = with_compiled_globals(function, checked=checked, inside=inside, absent=absent)
        _helpers[key] = Helper(compiled, disjoint, checked)
    return _helpers[key]


def _names(code: python_types.CodeType) -> set[str]:
    inner = (c for c in code.co_consts if isinstance(c, python_types.CodeType))
    return set(code.co_names).union(*(_names(c) for c in inner))
