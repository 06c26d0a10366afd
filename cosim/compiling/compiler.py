"""Python functions -> LLVM IR -> object code, without running anything. The one file that drives numba.

numba's ahead-of-time code generator is internal API (hence the version bounds in pyproject.toml): it gives IR that
was never run, so that the same text can become object code for this machine and for an exported FMU's platforms.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm

from cosim.errors import CosimError, KernelError, Problems
from cosim.compiling import tiles
from cosim.machine import object_code

if TYPE_CHECKING:
    from cosim.compiling.adapters import KernelSource

#: Functions of the C library that object code may call; anything else would need a run time of numba's.
_LIBC = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10 log1p pow sqrt "
    "cbrt hypot floor ceil trunc rint round fabs fmod erf erfc tgamma lgamma ldexp frexp fma fmin fmax sincos memset "
    "memcpy memmove nearbyint copysign modf snprintf vsnprintf strncpy write"
)
LIBC = frozenset(_LIBC.split())


def compile_object(name: str, sources: Iterable[KernelSource]) -> bytes:
    """Object code of the sources for this machine.

    Raises: KernelError, DeclarationError, DiagramErrors with several: each at its line in the author's file.
    """
    triple, cpu, features = object_code.host()
    sources = tuple(sources)
    ir = _in_tiles(compile_ir(name, sources), [s for s in sources if s.lanes], name)
    return emit(ir, triple, cpu, features, [s.symbol for s in sources], name)


def _in_tiles(ir: str, sources: Sequence[KernelSource], name: str) -> str:
    """The IR with the kernels of fleets, which do eight members at a time where that is worth it."""
    if not sources:
        return ir
    _, alone = _optimised(ir, *object_code.host(), [f"{s.symbol}.member" for s in sources], name, vectors=False, unrolled=True)
    worthy = [s for s in sources if tiles.worth(alone, s.symbol)]
    for source in sources:
        ir = ir.replace(f"define i32 @{source.symbol}.member(", f"define internal i32 @{source.symbol}.alone(")
    module = llvm.parse_assembly(ir + "".join(tiles.one_by_one(s.symbol) for s in sources if s not in worthy))
    if worthy:
        module.link_in(llvm.parse_assembly(tiles.kernels(str(alone), {s.symbol: s.parts for s in worthy})))
    return str(module)


def compile_ir(name: str, sources: Iterable[KernelSource]) -> str:
    """Plain LLVM IR of the sources, each as ``int32 symbol(double, uint8 *, int64 *)``. Raises: as `compile_object`."""
    from numba.core.compiler_lock import global_compiler_lock

    from cosim.compiling import checks, helpers

    problems, good = Problems(), []
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
    linked = _powers_of_c(str(library.linked()))
    return linked + "".join(map(_shims, sources))


def _add(source: KernelSource, library: Any) -> None:
    """Compile a source into a library of numba's. Raises: CosimError, and whatever the compiler does."""
    from numba import types

    base, frame, word = types.CPointer(types.uint8), types.CPointer(types.int64), types.int64
    if source.lanes is None:
        _compile(source, source.build(), (types.float64, base, frame), f"{source.symbol}.numba", library)
        return
    _compile(source, source.build(), (types.float64, base, frame, word, word), f"{source.symbol}.numba", library)
    _compile(source, source.lanes(), (types.float64, base, word), f"{source.symbol}.member.numba", library)


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
            helpers.with_compiled_globals(adapter, source.disjoint, source.checked),
            arguments,
            types.int32,
            flags,
            locals={},
            library=library,
            pipeline_class=checks.Compiler if source.checked else Compiler,
        )
    library.get_function(result.fndesc.llvm_func_name).name = symbol


def _powers_of_c(ir: str) -> str:
    """The IR with powers as the C library computes them, as the interpreter asks it to.

    LLVM makes a root of `x**0.5`, a product of `x**2.0` and an exp2 of `2.0**x`, which differ in the last bit, wherever
    it sees the constant.
    """
    called = ir.replace("@llvm.pow.f64(", "@pow(")
    return re.sub(r"^declare double @pow\(.*$", _POW, called, flags=re.MULTILINE)


_POW = "declare double @pow(double, double) nobuiltin nocallback nofree nosync nounwind willreturn memory(none)"

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
    return some + tiles.MEMBER.format(symbol=symbol)


def emit(ir: str, triple: str, cpu: str, features: str, keep: Iterable[str], name: str) -> bytes:
    """Optimised object code of an IR text for any triple; all symbols but `keep` become private.

    Raises: KernelError where the code needs more than the C library, with the missing symbol's name.
    """
    machine, module = _optimised(ir, triple, cpu, features, keep, name, vectors=True, unrolled=True)
    compiled: bytes = machine.emit_object(module)
    return compiled


def plain_ir(ir: str, triple: str, cpu: str, keep: Iterable[str], name: str) -> str:
    """The same, as IR of scalars, which is shorter, and computes the same numbers. Raises: KernelError."""
    return str(_optimised(ir, triple, cpu, "", keep, name, vectors=False, unrolled=False)[1])


def _optimised(
    ir: str, triple: str, cpu: str, features: str, keep: Iterable[str], name: str, vectors: bool, unrolled: bool
) -> tuple[Any, Any]:
    """LLVM's machine for a triple, and the optimised module. vectors: and unrolled loops."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    llvm.initialize_native_asmparser()
    target = llvm.Target.from_triple(triple)
    machine = target.create_target_machine(cpu=cpu, features=features, opt=3, reloc="pic", codemodel="default")
    ir = re.sub(r"^target (triple|datalayout) = .*$", "", ir, flags=re.MULTILINE)
    module = llvm.parse_assembly(f'target datalayout = "{machine.target_data}"\ntarget triple = "{triple}"\n{ir}')
    kept = set(keep)
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name not in kept:
            value.linkage = "internal"
            value.visibility = "default"
    tuning = llvm.create_pipeline_tuning_options(speed_level=3 if unrolled else 2)
    tuning.loop_vectorization = tuning.slp_vectorization = vectors
    tuning.loop_unrolling = unrolled
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    _refuse_foreign(module, name)
    return machine, module


def _refuse_foreign(module: Any, name: str) -> None:
    """What authors may write leads to nothing else; this makes sure of it. Raises: KernelError."""
    undefined = {v.name for v in (*module.functions, *module.global_variables) if v.is_declaration}
    foreign = sorted(n for n in undefined if not n.startswith("llvm.") and n not in LIBC)
    if foreign:
        fix = "write it with loops and `math`, or declare the class with `compiled=False`"
        raise KernelError(f"{name} cannot be compiled: it needs `{foreign[0]}`, which the C library lacks", fix=fix)


def _explain(error: Exception, source: KernelSource, name: str) -> CosimError:
    """A mistake of the author's as it is, and the compiler's message in the author's words."""
    if isinstance(error, CosimError):
        return error
    from cosim.compiling import diagnosis

    return diagnosis.explained(error, source.who or f"{name}: {source.symbol}()", source.place)
