"""Calls of LLVM's own functions and of the C library's, in C."""

from __future__ import annotations

import re
from collections.abc import Sequence

from cosim.export.c_code.c_values import narrowed, signed
from cosim.export.c_code.llvm_reader import LlvmType, Untranslatable

#: Say something to an optimiser, and compute nothing.
SILENT = ("lifetime.", "assume", "experimental.noalias", "dbg.", "donothing", "sideeffect")
#: Of real numbers, exact, so that a compiler may put in what it knows.
_EXACT = "fabs sqrt floor ceil trunc rint round nearbyint copysign fmin fmax fma roundeven"
EXACT = frozenset(_EXACT.split())
_NAMES = {"minnum": "fmin", "maxnum": "fmax"}
#: Whose last bits are the C library's.
_LIBRARY = (
    "tan asin acos atan sinh cosh asinh acosh atanh exp2 expm1 log2 log10 log1p cbrt erf erfc tgamma lgamma hypot fmod "
    "ldexp"
)
LIBRARY = frozenset(_LIBRARY.split())
_APART = {"frexp": "int", "modf": "double"}  # exact, and the type of what they leave at an address
_MEMORY = frozenset(["memcpy", "memmove", "memset"])
OVERFLOWING = re.compile(r"llvm\.([su])(add|sub|mul)\.with\.overflow\.i(8|16|32|64)")


def of_library(name: str, kind: LlvmType, values: Sequence[str]) -> str:
    """A call of a function that is no kernel's. Raises: Untranslatable."""
    intrinsic = re.fullmatch(r"llvm\.([a-z0-9.]+?)((?:\.(?:f32|f64|p0|i\d+))+)", name)
    plain = intrinsic[1] if intrinsic else name
    single = kind.kind == "float" and intrinsic
    called = _NAMES.get(plain, plain)
    arguments = ", ".join(values[:3] if called in _MEMORY else values)
    if called in EXACT:
        return f"__builtin_{called}{'f' if single else ''}({arguments})"
    if called in LIBRARY and not single:
        return f"m_{called}({arguments})"
    if called in _MEMORY:
        return f"{called}({arguments})"
    if called in _APART:
        return f"{called}({values[0]}, ({_APART[called]} *){values[1]})"
    if intrinsic and called == "is.fpclass" and not single and ".f64" in intrinsic[2]:
        return f"(uint8_t)((class_of_double({values[0]}) & {values[1]}) != 0)"
    if intrinsic and (found := _of_integers(plain, kind, values)):
        return found
    raise Untranslatable(f"it calls `{name}`")


def _of_integers(name: str, kind: LlvmType, values: Sequence[str]) -> str:
    """LLVM's functions of integers, "" for others."""
    if kind.kind != "int":
        return ""
    first, second = values[0], values[1] if len(values) > 1 else "0"
    if name in ("smax", "smin", "umax", "umin"):
        compared = [signed(v, kind) if name[0] == "s" else v for v in (first, second)]
        return f"({compared[0]} {'>' if name.endswith('max') else '<'} {compared[1]} ? {first} : {second})"
    if name == "abs":
        return narrowed(f"{signed(first, kind)} < 0 ? 0 - {first} : {first}", kind)
    if name in ("ctpop", "ctlz", "cttz", "bswap", "fshl", "fshr", "usub.sat") and kind.bits == kind.container == 64:
        return {
            "ctpop": f"(uint64_t)__builtin_popcountll({first})",
            "ctlz": f"({first} ? (uint64_t)__builtin_clzll({first}) : 64)",
            "cttz": f"({first} ? (uint64_t)__builtin_ctzll({first}) : 64)",
            "bswap": f"__builtin_bswap64({first})",
            "fshl": _funnel(first, second, values[-1], left=True),
            "fshr": _funnel(first, second, values[-1], left=False),
            "usub.sat": f"({first} > {second} ? {first} - {second} : 0)",
        }[name]
    return ""


def _funnel(high: str, low: str, by: str, left: bool) -> str:
    """64 bits out of 128, after a shift."""
    joined = f"((uint128_t){high} << 64 | {low})"
    return f"(uint64_t)({joined} << ({by} & 63) >> 64)" if left else f"(uint64_t)({joined} >> ({by} & 63))"
