"""One run under two engines in turn: compiled up to a communication point, as plain Python from there, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from cosim.compiling.kernels import Kernels
from cosim.engine import run_state
from cosim.engine.hand_run import HandRun
from cosim.engine.program import Program


def begun(program: Program, kernels: Kernels | None) -> HandRun:
    """A run at time zero; kernels: None for plain Python. Raises: BlockFailed, Diverged."""
    run = HandRun(program, kernels)
    run.initialize()
    return run


def handed_over(before: HandRun, kernels: Kernels | None) -> HandRun:
    """A run that goes on where another one is, with other code. Both engines compute the same bits.

    Raises: BlockFailed, Diverged.
    """
    run = begun(before.program, kernels)
    run_state.restore(run, run_state.state_of(before))
    return run


def interpreted_at(program: Program, kernels: Kernels, tick: int | None) -> HandRun:
    """A run as plain Python at a communication point, to which compiled code goes; None: before it is initialized.

    What is published there is computed anew, so that authors' functions are called at that very time.
    Raises: BlockFailed, Diverged, Terminated.
    """
    if tick is None:
        return HandRun(program, None)
    compiled = begun(program, kernels)
    compiled.go_to(tick)
    run = handed_over(compiled, None)
    run.forget_point()
    return run


def ahead(run: HandRun) -> Iterator[Callable[[], None]]:
    """What is still to be done: to initialize, to compute the communication point at which it is, and each to come."""
    if run.host is None:
        yield run.initialize
    grid = run.program.network.schedule.grid
    yield partial(run.go_to, run.done)
    while run.done < run.ticks and run.termination is None:
        yield partial(run.go_to, min(run.done - run.done % grid + grid, run.ticks))
