"""Object code in memory: loads what was compiled and hands out addresses. Imports llvmlite only."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import llvmlite.binding as llvm


@cache
def _prepare() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


@cache
def host() -> tuple[str, str, str]:
    """Triple, processor and features of this machine, as LLVM names them.

    Vectors are as wide as the processor has them: LLVM takes half of that on some, as others' code would run slower.
    """
    _prepare()
    features = llvm.get_host_cpu_features()
    wide = ",-prefer-256-bit" if features.get("avx512f") else ""
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), features.flatten() + wide


class Library:
    """One loaded object file; its functions stay valid as long as it lives."""

    def __init__(self, code: bytes) -> None:
        """code: an ELF, Mach-O or COFF object for this machine."""
        _prepare()
        machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
        self._engine: Any = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._addresses: dict[str, int] = {}

    def address(self, symbol: str) -> int:
        """The address of a function. Raises: KeyError where the object has no such symbol."""
        if symbol not in self._addresses:
            address = self._engine.get_function_address(symbol)
            if not address:
                raise KeyError(symbol)
            self._addresses[symbol] = address
        return self._addresses[symbol]

    def text(self, symbol: str) -> str | None:
        """A text that the object has; None where it has no such symbol."""
        address = self._engine.get_global_value_address(symbol)
        return ctypes.string_at(address).decode() if address else None
