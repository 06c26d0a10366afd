"""One run under two engines in turn: compiled up to a communication point, as plain Python from there, and back."""

from __future__ import annotations

from collections.abc import Iterator

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
    before.resting = run.resting = True
    run_state.restore(run, run_state.state_of(before))
    return run


def interpreted_at(program: Program, kernels: Kernels, tick: int) -> HandRun:
    """A run as plain Python at a communication point, to which compiled code goes.

    What is published there is computed anew, so that authors' functions are called at that very time.
    Raises: BlockFailed, Diverged, Terminated.
    """
    compiled = begun(program, kernels)
    compiled.go_to(0)
    if tick:
        compiled.go_to(tick)
    run = handed_over(compiled, None)
    run.forget_point()
    return run


def points_ahead(run: HandRun) -> Iterator[int]:
    """The ticks of the communication points that are still to be computed, that at which it is first."""
    grid = run.program.network.schedule.grid
    yield run.done
    while run.done < run.ticks and run.termination is None:
        yield min(run.done - run.done % grid + grid, run.ticks)
