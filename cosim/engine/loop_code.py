"""The compiled loop. It is the same for all diagrams, so where there is none yet, a process of its own makes it.

Most diagrams have no algebraic loops, events, tolerances, implicit integrators or histories of inputs, which are two
thirds of its code. Where nothing is in the cache, those get a loop without all that, of the same bits.
"""

from __future__ import annotations

import subprocess
import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from cosim.compiling import kernels
from cosim.compiling.adapters import KernelSource, raw_source
from cosim.machine import cache, notices, parallel
from cosim.master import attempts, histories, integration, loop, newton, rosenbrock
from cosim.master.not_called import not_called

_FUNCTIONS = (loop.run, loop.execute, integration.derive)
#: What is called for those only, by which all their code is reached.
_MORE = (
    *(attempts.attempt, newton.solve, integration.integrate_within_tolerance),
    *(rosenbrock.linearize, rosenbrock.rosenbrock_step, histories.trace, histories.push, histories.forget),
)
_WORDS = "from cosim.engine import loop_code; loop_code.compile_loop({plain})"


def compile_loop(plain: bool = False) -> kernels.Module:
    """The loop's module, from the cache or compiled now; plain: without what most diagrams do not need."""
    return kernels.module(_name(plain), _sources(plain))


def _name(plain: bool) -> str:
    return "engine-plain" if plain else "engine"


def _sources(plain: bool) -> tuple[KernelSource, ...]:
    return tuple(raw_source("engine", f, *((_MORE, not_called) if plain else ())) for f in _FUNCTIONS)


@contextmanager
def compiled_beside(plain: bool) -> Iterator[Callable[[], kernels.Module]]:
    """What gives the loop's module, which is compiled meanwhile if it is not in the cache and a processor is free.

    plain: whether one without what most diagrams do not need will do; the whole one does, too, where it is found.
    Whatever becomes of the other process, the module is as `compile_loop` gives it: what is not in the cache at the end
    is compiled here.
    """
    kept = kernels.kept(_name(False), _sources(False))
    kept = kept or (kernels.kept(_name(True), _sources(True)) if plain else None)
    if kept:
        yield lambda: kept
        return
    if parallel.processors() == 1 or not cache.is_usable():
        yield lambda: compile_loop(plain)
        return
    notices.progress("compiling engine, once…")
    began = clock.perf_counter()
    words = [sys.executable, "-P", "-c", _WORDS.format(plain=plain)]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet) as other:  # noqa: S603  # ours

        def wait() -> kernels.Module:
            other.wait()
            made = compile_loop(plain)
            return replace(made, compiled_now=True, seconds=made.seconds or clock.perf_counter() - began)

        try:
            yield wait
        finally:
            other.kill()
