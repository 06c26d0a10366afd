"""What numba makes of one function, and how such pieces become one module: each is linked once.

numba's own libraries take in all that their functions call as soon as one is finished, so that what lies deep is copied
and looked through again at every level above it: more than half of the time that it took to compile the loop.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import AOTCodeLibrary, AOTCPUCodegen


class FunctionIR(AOTCodeLibrary):
    """The IR of one function, unoptimised, and which others it calls."""

    _codegen: Any
    _final_module: Any
    _linking_libraries: list[FunctionIR]

    def add_llvm_module(self, module: Any) -> None:
        """Take in a module."""
        module.data_layout = self._codegen._data_layout
        self._final_module.link_in(module)

    def finalize(self) -> None:
        """Say that nothing more comes; nothing is linked yet."""
        self._finalized = True

    def linked(self) -> Any:
        """A module of this and of all that it reaches, each once; what others call may be dropped where nobody does."""
        module = self._final_module.clone()
        for library in self._reached():
            if library is not self:
                module.link_in(_shared(library._final_module))
        return module

    def _reached(self) -> dict[FunctionIR, None]:
        """All that are reached from here, each once, callers first."""
        found: dict[FunctionIR, None] = {}
        waiting = [self]
        while waiting:
            library = waiting.pop()
            if library not in found:
                found[library] = None
                waiting += reversed(library._linking_libraries)
        return found


def _shared(module: Any) -> Any:
    """A copy of which nothing need be kept, and of which the same may be in other modules."""
    copy = module.clone()
    for function in copy.functions:
        if not function.is_declaration and function.linkage == llvm.Linkage.external:
            function.linkage = "linkonce_odr"
    return copy


class Codegen(AOTCPUCodegen):
    """numba's code generator without a processor of its own, whose libraries are linked last."""

    _library_class = FunctionIR
