"""LLVM IR -> object code, for any triple, or IR again. numba has no part in it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import llvmlite.binding as llvm

from cosim.errors import KernelError

#: Functions of the C library that object code may call: none of those that `plain_math` has, whose bits are the same
#: everywhere; anything else would need a run time of numba's.
_LIBC = (
    "tan asin acos atan sinh cosh asinh acosh atanh exp2 expm1 log2 log10 log1p sqrt cbrt hypot floor ceil trunc rint "
    "round fabs fmod erf erfc tgamma lgamma ldexp frexp fma fmin fmax memset memcpy memmove nearbyint copysign modf "
    "snprintf vsnprintf strncpy write"
)
LIBC = frozenset(_LIBC.split())
#: LLVM's own names of what `plain_math` has, which it would make calls of the C library of.
_ELEMENTARY = re.compile(r"llvm\.(sin|cos|exp|log|pow)\.")


def emit(ir: str, triple: str, cpu: str, features: str, keep: Iterable[str], name: str) -> bytes:
    """Optimised object code of an IR text for any triple; all symbols but `keep` become private.

    Raises: KernelError where the code needs more than the C library, with the missing symbol's name.
    """
    machine, module = _optimised(ir, triple, cpu, features, keep)
    _refuse_foreign(module, name)
    compiled: bytes = machine.emit_object(module)
    return compiled


def plain_ir(ir: str, triple: str, cpu: str, keep: Iterable[str], name: str) -> str:
    """The same, as IR of scalars, which is shorter, and computes the same numbers. Raises: KernelError."""
    _, module = _optimised(ir, triple, cpu, "", keep, vectors=False, unrolled=False)
    _refuse_foreign(module, name)
    return str(module)


def scalars(ir: str, triple: str, cpu: str, features: str, keep: Iterable[str]) -> Any:
    """The optimised module of an IR text that vectors are made of later."""
    return _optimised(ir, triple, cpu, features, keep, vectors=False)[1]


def _optimised(
    ir: str, triple: str, cpu: str, features: str, keep: Iterable[str], vectors: bool = True, unrolled: bool = True
) -> tuple[Any, Any]:
    """LLVM's machine for a triple, and the optimised module, with vectors and unrolled loops or without."""
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
    return machine, module


def _refuse_foreign(module: Any, name: str) -> None:
    """What authors may write leads to nothing else; this makes sure of it. Raises: KernelError."""
    undefined = {v.name for v in (*module.functions, *module.global_variables) if v.is_declaration}
    foreign = sorted(n for n in undefined if (n not in LIBC if not n.startswith("llvm.") else _ELEMENTARY.match(n)))
    if foreign:
        fix = "write it with loops and `math`, or declare the class with `compiled=False`"
        raise KernelError(f"{name} cannot be compiled: it needs `{foreign[0]}`, which it may not call", fix=fix)
