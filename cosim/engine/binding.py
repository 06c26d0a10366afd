"""Binds a program to an engine: an address for each call, a control block that says where everything is."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import numpy as np

from cosim.authoring.lowering.block_functions import lowered
from cosim.compiling.kernels import Kernels
from cosim.engine import interpretation
from cosim.engine.probes import Buffers
from cosim.engine.program import Program
from cosim.machine import memory
from cosim.master import integration, loop, tables

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
_handles = count(1)
#: Of the addresses of a program's calls: other rows and phases of the same meaning, and the addresses of their calls.
Walked = Callable[[list[int]], tuple[np.ndarray, np.ndarray, list[int]]]


class Binding:
    """The loop over one arena. kernels: None interprets everything as plain Python.

    commands: the loop's `run` and `execute`, of a time (s) and the addresses of arena and control block. causes: the
    exceptions that interpreted functions raised.
    """

    def __init__(
        self,
        program: Program,
        kernels: Kernels | None,
        arena: np.ndarray,
        control: np.ndarray,
        zeros: Callable[[int], np.ndarray],
    ) -> None:
        self.causes: list[BaseException] = []
        self._program = program
        self._arena = arena
        self._control = control
        self._texts = zeros(interpretation.TEXT_BYTES)
        self._keep: list[Any] = []  # what the loop finds by its address alone
        self._interpreted = kernels is None
        self._handles: list[int] = []
        weakref.finalize(self, _forget, self._handles)
        self.commands: dict[str, Callable[..., int]]
        derive: Callable[..., int]
        if kernels is None:
            _compute_powers()
            self._functions = [self._handed(self._python(n)) for n in range(len(program.calls))]
            self.commands, derive = {"run": loop.run, "execute": loop.execute}, integration.derive
        else:
            self._functions = [self._address(kernels, n) for n in range(len(program.calls))]
            assert kernels.loop is not None
            compiled = kernels.loop.load()
            self.commands = {name: KERNEL(compiled.address(name)) for name in ("run", "execute")}
            derive = KERNEL(compiled.address("derive"))
        self._solver = self._reference(derive) if program.reference else 0

    def _address(self, kernels: Kernels, n: int) -> int:
        call = self._program.calls[n]
        if kernels.modules[call.component] is None:
            return self._handed(self._python(n))
        foreign = self._program.network.components[call.component].declaration.foreign
        return kernels.address(call.component, foreign.kernel.__name__ if foreign else call.function.name)

    def _handed(self, python: Callable[[float], int]) -> int:
        """By what the loop calls a Python function of a time (s)."""
        if self._interpreted:
            handle = next(_handles)
            memory.interpreted[handle] = python
            self._handles.append(handle)
            return handle
        thunk = KERNEL(lambda time, base, frame: python(time))
        self._keep.append(thunk)
        return ctypes.cast(thunk, ctypes.c_void_p).value or 0

    def _reference(self, derive: Callable[..., int]) -> int:
        """By what the loop has scipy integrate all states."""
        from cosim.engine.reference import ReferenceSolver  # with scipy, only where it is named

        base, control = self._arena.ctypes.data, self._control.ctypes.data
        solver = ReferenceSolver(self._program, self._arena, self._control, lambda time: derive(time, base, control))
        return self._handed(solver)

    def _python(self, n: int) -> Callable[[float], int]:
        """The n-th call as plain Python."""
        call = self._program.calls[n]
        component = self._program.network.components[call.component]
        declaration = component.declaration
        if foreign := declaration.foreign:
            base = self._arena.ctypes.data
            return lambda time: foreign.kernel(time, base, base + call.frame)
        function = lowered(declaration, call.function)
        sizes = {name: axis.size for name, axis in component.axes.items()}
        work = [np.zeros([size.of(sizes) for size in t.kind.shape], t.kind.element) for t in function.temporaries]
        run = interpretation.Interpreted(function.python, work, declaration.compiled)
        return interpretation.python_of(self._arena, call, run, self._texts, self.causes)

    def fill(self, buffers: Buffers, walked: Walked | None = None) -> None:
        """Fill the control block; walked: gives what the loop walks in place of the program itself."""
        program, control = self._program, self._control
        rows, phases, functions = program.rows, program.phase_words(), self._functions
        if walked:
            rows, phases, functions = walked(functions)
            self._keep.append(walked)
        control[:] = program.control()
        for word, array in (
            (tables.ROWS, rows),
            (tables.BANKS, program.banks),
            (tables.PHASE, phases),
            (tables.FUNCTIONS, np.array(functions, np.int64)),
            (tables.GROUPS, buffers.groups),
            (tables.PROBES, buffers.rows),
        ):
            control[word] = array.ctypes.data
            self._keep.append(array)
        control[tables.N_GROUPS], control[tables.SOLVER] = len(buffers.groups), self._solver


def _compute_powers() -> None:
    """Have the interpreted loop compute powers as the compiled one does."""
    from cosim.compiling.interpreted.libm import as_compiled  # which compiles them, unless they are in the cache

    memory.powers[0] = as_compiled("pow", 2)


def _forget(handles: Sequence[int]) -> None:
    for handle in handles:
        memory.interpreted.pop(handle, None)
