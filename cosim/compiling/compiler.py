"""Python functions -> LLVM IR -> object code, without running anything. The one file that drives numba.

numba's ahead-of-time code generator is internal API (hence the version bounds in pyproject.toml): it gives IR that
was never run, so that the same text can become object code for this machine and for an exported FMU's platforms.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm
from llvmlite.binding.ffi import lib
from numba.core.compiler_lock import global_compiler_lock

from cosim.compiling import emission
from cosim.compiling.tiles import kernel_ir, tiling
from cosim.errors import CosimError, Problems
from cosim.machine import object_code
from cosim.plain_math import definitions

if TYPE_CHECKING:
    from cosim.compiling.adapters import KernelSource


#: What keeps threads from being inside of LLVM or numba at once.
LOCKS = (global_compiler_lock, lib._lock)


def compile_object(name: str, sources: Iterable[KernelSource]) -> bytes:
    """Object code of the sources for this machine.

    Raises: KernelError, DeclarationError, DiagramErrors with several: each at its line in the author's file.
    """
    triple, cpu, features = object_code.host()
    sources = tuple(sources)
    symbols = [symbol for source in sources for symbol in source.symbols]
    return emission.emit(compile_ir(name, sources), triple, cpu, features, symbols, name)


def compile_ir(name: str, sources: Iterable[KernelSource]) -> str:
    """Plain LLVM IR of the sources, each as ``int32 symbol(double, uint8 *, int64 *)``. Raises: as `compile_object`."""
    from cosim.compiling import checks, helpers

    sources, problems, good = tuple(sources), Problems(), []
    with global_compiler_lock, helpers.unoptimised(), checks.checking():
        library = helpers.target().target_context.codegen().create_library(name)
        library.add_llvm_module(llvm.parse_assembly(_NO_REFERENCE_COUNTS + checks.RECORD))
        for source in sources:
            try:
                _add(source, library)
            except Exception as error:  # noqa: BLE001  # numba raises all sorts
                problems.add(_explain(error, source, name))
                continue
            good.append(source)
        if not problems.errors:
            library.finalize()
    if problems.errors:
        if good:
            problems.attempt(compile_object, name, good)  # what is wrong with the others
        problems.raise_one_or_all()
    ir = definitions.renamed(str(library.linked())) + "".join(map(_shims, sources))
    return definitions.with_definitions(tiling.in_tiles(ir, [s for s in sources if s.lanes]))


def _add(source: KernelSource, library: Any) -> None:
    """Compile a source into a library of numba's. Raises: CosimError, and whatever the compiler does."""
    from numba import types

    base, frame, word = types.CPointer(types.uint8), types.CPointer(types.int64), types.int64
    if source.lanes is None:
        _compile(source, source.build(), (types.float64, base, frame), f"{source.symbol}.numba", library)
        return
    _compile(source, source.build(), (types.float64, base, frame, word, word), f"{source.symbol}.numba", library)
    _compile(source, source.lanes(), (types.float64, base, word), f"{source.symbol}.lane.numba", library)


def _compile(source: KernelSource, adapter: Any, arguments: tuple[Any, ...], symbol: str, library: Any) -> None:
    """Compile an adapter of a source under a symbol."""
    from numba import types
    from numba.core.compiler import Compiler, Flags, compile_extra

    from cosim.compiling import arithmetic, checks, helpers

    flags: Any = Flags()
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.nrt = True
    flags.error_model = "numpy"
    flags.noalias, flags.boundscheck = source.disjoint, source.checked
    target = helpers.target()
    with arithmetic.wrapping() if source.checked else nullcontext():
        result = compile_extra(
            target.typing_context,
            target.target_context,
            helpers.with_compiled_globals(adapter, source.disjoint, source.checked, absent=source.absent),
            arguments,
            types.int32,
            flags,
            locals={},
            library=library,
            pipeline_class=checks.Compiler if source.checked else Compiler,
        )
    library.get_function(result.fndesc.llvm_func_name).name = symbol


#: numba's array views are typed with a reference count; those that kernels see own nothing.
_NO_REFERENCE_COUNTS = """
define void @NRT_incref(ptr %object) alwaysinline { ret void }
define void @NRT_decref(ptr %object) alwaysinline { ret void }
"""

#: numba returns through pointers and reports an exception by its return value; the kernel ABI wants a status. A fault
#: is written to the frame, of which the function itself sees no word before the instances; its last word is the time.
_SHIM = """
define i32 @{symbol}(double %time, ptr %base, ptr %frame{range}) {{
  %result = alloca i32
  %raised = call i32 @{made}(ptr %result, ptr %frame, double %time, ptr %base, ptr %frame{range})
  %ok = icmp eq i32 %raised, 0
  br i1 %ok, label %returned, label %failed
returned:
  %status = load i32, ptr %result
  ret i32 %status
failed:
  %when = getelementptr double, ptr %frame, i64 4
  store double %time, ptr %when
  ret i32 3
}}
"""


def _shims(source: KernelSource) -> str:
    symbol, made = source.symbol, f"{source.symbol}.numba"
    if source.lanes is None:
        return _SHIM.format(symbol=symbol, made=made, range="")
    some = _SHIM.format(symbol=f"{symbol}.range", made=made, range=", i64 %first, i64 %last")
    return some + kernel_ir.LANE.format(symbol=symbol)


def _explain(error: Exception, source: KernelSource, name: str) -> CosimError:
    """A mistake of the author's as it is, and the compiler's message in the author's words."""
    if isinstance(error, CosimError):
        return error
    from cosim.compiling import diagnosis

    return diagnosis.explained(error, source.who or f"{name}: {source.symbol}()", source.place)
