"""Python functions -> LLVM IR -> object code, without running anything. The one file that drives numba.

numba's ahead-of-time code generator is internal API (hence the version bounds in pyproject.toml): it gives IR that
was never run, so that the same text can become object code for this machine and for an exported FMU's platforms.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm

from cosim import native
from cosim.errors import KernelError

if TYPE_CHECKING:
    from cosim.adapters import Source

#: Functions of the C library that object code may call; anything else would need a run time of numba's.
_LIBC = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10 log1p pow sqrt "
    "cbrt hypot floor ceil trunc rint round fabs fmod erf erfc tgamma lgamma ldexp frexp fma fmin fmax sincos memset "
    "memcpy memmove nearbyint copysign modf vsnprintf strncpy"
)
LIBC = frozenset(_LIBC.split())


def compile_object(name: str, sources: Iterable[Source]) -> bytes:
    """Object code of the sources for this machine. Raises: KernelError."""
    triple, cpu, features = native.host()
    return emit(compile_ir(name, sources), triple, cpu, features, [s.symbol for s in sources], name)


def compile_ir(name: str, sources: Iterable[Source]) -> str:
    """Plain LLVM IR of the sources, each as ``int32 symbol(double, uint8 *, int64 *)``. Raises: KernelError."""
    from numba import types
    from numba.core.compiler import Compiler, Flags, compile_extra
    from numba.core.compiler_lock import global_compiler_lock

    from cosim import checks, helpers

    signature = (types.float64, types.CPointer(types.uint8), types.CPointer(types.int64))
    flags: Any = Flags()
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.nrt = True
    flags.error_model = "numpy"
    with global_compiler_lock, helpers.unoptimised(), checks.checking():
        target = helpers.target()
        library = target.target_context.codegen().create_library(name)
        library.add_llvm_module(llvm.parse_assembly(_NO_REFERENCE_COUNTS + checks.RECORD))
        for source in sources:
            adapter = helpers.with_compiled_globals(source.build(), source.disjoint, source.checked)
            flags.noalias, flags.boundscheck = source.disjoint, source.checked
            try:
                result = compile_extra(
                    target.typing_context,
                    target.target_context,
                    adapter,
                    signature,
                    types.int32,
                    flags,
                    locals={},
                    library=library,
                    pipeline_class=checks.Compiler if source.checked else Compiler,
                )
            except Exception as error:
                raise _explain(error, f"{name}: {source.symbol}()", source.place) from error
            library.get_function(result.fndesc.llvm_func_name).name = f"{source.symbol}.numba"
        library.finalize()
        return str(library._final_module) + "".join(_SHIM.format(symbol=s.symbol) for s in sources)


#: numba's array views are typed with a reference count; those that kernels see own nothing.
_NO_REFERENCE_COUNTS = """
define void @NRT_incref(ptr %object) alwaysinline { ret void }
define void @NRT_decref(ptr %object) alwaysinline { ret void }
"""

#: numba returns through pointers and reports an exception by its return value; the kernel ABI wants a status. A fault
#: is written to the frame, of which the function itself sees no word before the instances; its last word is the time.
_SHIM = """
define i32 @{symbol}(double %time, ptr %base, ptr %frame) {{
  %result = alloca i32
  %raised = call i32 @{symbol}.numba(ptr %result, ptr %frame, double %time, ptr %base, ptr %frame)
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


def emit(ir: str, triple: str, cpu: str, features: str, keep: Iterable[str], name: str) -> bytes:
    """Optimised object code of an IR text for any triple; all symbols but `keep` become private.

    Raises: KernelError where the code needs more than the C library, with the missing symbol's name.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    llvm.initialize_native_asmparser()
    target = llvm.Target.from_triple(triple)
    machine = target.create_target_machine(cpu=cpu, features=features, opt=3, reloc="pic", codemodel="default")
    ir = re.sub(r"^target (triple|datalayout) = .*$", "", ir, flags=re.M)
    module = llvm.parse_assembly(f'target datalayout = "{machine.target_data}"\ntarget triple = "{triple}"\n{ir}')
    kept = set(keep)
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name not in kept:
            value.linkage = "internal"
            value.visibility = "default"
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = tuning.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    _refuse_foreign(module, name)
    return machine.emit_object(module)


def _refuse_foreign(module: Any, name: str) -> None:
    undefined = {v.name for v in (*module.functions, *module.global_variables) if v.is_declaration}
    foreign = sorted(n for n in undefined if not n.startswith("llvm.") and n not in LIBC)
    if foreign:
        why = "it allocates memory" if any("NRT" in n or "nrt" in n for n in foreign) else "it is not in the C library"
        raise KernelError(
            f"{name} cannot be a kernel: it needs `{foreign[0]}` ({why})",
            fix="write results in place, declare work space as Local, or declare the class with `compiled=False`",
        )


#: What numba says of a function that writes to what it only reads: by index, as an output, by fill(), by `u += 1`.
_WRITES = (
    "Cannot modify readonly array",
    "explicit output that is read-only",
    r"array\.fill.*readonly",
    "object has no attribute 'args'",
)


def _explain(error: Exception, name: str, place: str) -> KernelError:
    """The compiler's message, cut to what an author can use, with the line it names or the function's own."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    found = [re.sub(r'^File "(.*)", line (\d+).*', r"\1:\2", line) for line in lines if line.startswith("File ")]
    named = [line for line in found if not line.startswith("<adapter")]
    text = next((line for line in lines if not line.startswith(("Failed in", "During:"))), type(error).__name__)
    if any(re.search(words, str(error)) for words in _WRITES):
        text = "it writes to an input, a parameter or another array that is read-only"
    return KernelError(
        f"{name} cannot be compiled: {text} ({named[-1] if named else place})",
        fix="write results in place with loops and `math`, or declare the class with `compiled=False`",
    )
