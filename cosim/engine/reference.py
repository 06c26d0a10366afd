"""scipy's methods in place of an integrator of ours: a reference for `joint` that shares no code with it.

    y ← the states X of all blocks; a method of scipy's begins anew at every communication point, or event
    until the step's end: y, t ← a step of the method, which asks for dy/dt = D as often as it likes:
        X ← y; D ← what the loop itself evaluates at t
    X ← y

Nothing but the derivatives is ours: step sizes, errors and linear equations are scipy's. Every one that is asked for
has to be a number, as implicit methods of scipy's take one that is none for no error at all.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock

import numpy as np
from scipy import integrate

from cosim.engine.program import Program
from cosim.master import tables
from cosim.master.integration import MOST_STEPS

#: One for each process that is forked. LSODA has one memory for all who use it, up to scipy 1.16.
_turns: dict[int, Lock] = {}


class _Stopped(Exception):
    """The derivatives cannot be had."""

    def __init__(self, status: int) -> None:
        super().__init__()
        self.status = status


class ReferenceSolver:
    """What the loop calls to have all states integrated over a step. derive: D of X at a time (s), with its status."""

    def __init__(
        self, program: Program, arena: np.ndarray, control: np.ndarray, derive: Callable[[float], int]
    ) -> None:
        assert program.reference
        self._method = getattr(integrate, program.reference.solver)
        self._tolerances = program.network.diagram.run.integration.tolerances
        self._derive = derive
        self._control = control
        vectors, bank, n = program.layout.vectors, program.banks[0], 8 * program.layout.states
        self._at = vectors["X"]
        self._x, self._d = (arena[vectors[name] :][:n].view(float) for name in ("X", "D"))
        memory = arena[int(bank[tables.MEMORY]) :][: 8 * tables.MEMORY_WORDS]
        self._numbers, self._counts = memory.view(float), memory.view(np.int64)

    def __call__(self, begun: float) -> int:
        """Integrate from a time (s) over the step that the loop asks for. Returns the status of the loop."""
        end = begun + float(self._numbers[tables.NEXT_STEP])
        with self._turn(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # LSODA's words on why it fails
            try:
                return self._integrate(begun, end)
            except _Stopped as stopped:
                return stopped.status
            except Exception:  # noqa: BLE001  # as a matrix of infinities is not factorized; none may be lost
                return self._stalled(0.0)

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Inside, nobody else in this process uses scipy's integrators. To wait is a sign of life."""
        turn = _turns.setdefault(os.getpid(), Lock())
        while not turn.acquire(timeout=1.0):
            self._control[tables.ALIVE] += 1
        try:
            yield
        finally:
            turn.release()

    def _integrate(self, begun: float, end: float) -> int:
        relative, absolute = self._tolerances
        self._numbers[tables.REACHED] = begun
        solver = self._method(self._derivatives, begun, self._x.copy(), end, rtol=relative, atol=absolute)
        for _ in range(MOST_STEPS):
            solver.step()
            self._numbers[tables.REACHED] = solver.t
            if solver.status == "failed":
                return self._stalled(10.0 * np.spacing(solver.t))  # shorter ones scipy does not take
            self._counts[tables.TAKEN] += 1
            if solver.status == "finished":
                self._x[:] = solver.y
                return tables.OK
        return self._stalled(end - begun)

    def _derivatives(self, time: float, y: np.ndarray) -> np.ndarray:
        """The derivatives of the states. Raises: _Stopped."""
        self._x[:] = y
        status = self._derive(time)
        if status > tables.WARNING:
            raise _Stopped(status)
        if not np.isfinite(self._d).all():
            self._numbers[tables.REACHED] = time
            raise _Stopped(self._stalled(np.nan))
        return self._d.copy()

    def _stalled(self, step: float) -> int:
        """Say where no step is kept, and by which state; step: the shortest (s), or no number for no derivative."""
        relative, absolute = self._tolerances
        with np.errstate(all="ignore"):
            over = np.abs(self._d) / (absolute + relative * np.abs(self._x))
        self._control[tables.ELEMENT] = self._at + 8 * int(np.argmax(np.where(np.isfinite(over), over, np.inf)))
        self._numbers[tables.NEXT_STEP] = step
        return tables.STALLED
