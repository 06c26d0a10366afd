"""Kernels as C: each instruction of optimised LLVM IR becomes one statement.

Such C computes what object code of the same IR does, to the last bit, as each rounding is taken where the IR has it,
and functions such as sin are those of the C library. What has no translation is refused with its text.
"""

from __future__ import annotations

from collections.abc import Iterable

from cosim.export.c_code.c_function import FunctionWriter, Head
from cosim.export.c_code.c_values import c_type, content
from cosim.export.c_code.llvm_reader import ATTRIBUTES, Tokens, Untranslatable, read


def translate(ir: str, unit: str, kernels: Iterable[str]) -> str:
    """The C text of a module. unit: what its private names begin with. Raises: Untranslatable."""
    module = read(ir)
    names: dict[str, str] = {}
    constants = [_constant(line, f"{unit}_constant{k}", names) for k, line in enumerate(module.constants)]
    kept = {f"@{name}" for name in kernels}
    heads = [Head(function.head) for function in module.functions]
    for k, head in enumerate(heads):
        names[head.name] = head.name[1:] if head.name in kept else f"{unit}_function{k}"
    functions = [
        FunctionWriter(head, text, names, head.name in kept) for head, text in zip(heads, module.functions, strict=True)
    ]
    declared = "\n".join([*constants, *(f"{function.declaration()};" for function in functions)])
    return "\n\n".join(['#include "kernel.h"', declared, *(function.definition() for function in functions)]) + "\n"


def _constant(line: str, name: str, names: dict[str, str]) -> str:
    """A constant of the module, which is an array."""
    tokens = Tokens(line)
    llvm_name = tokens.next()
    tokens.expect("=")
    tokens.skip(ATTRIBUTES)
    kind = tokens.type()
    if kind.kind != "array":
        raise Untranslatable(f"`{line[:100]}` is a constant of the kind {kind.kind}")
    names[llvm_name] = f"((uint8_t *){name})"
    return f"static const {c_type(kind.items[0])} {name}[{kind.count}] = {{{', '.join(content(tokens, kind))}}};"
