"""The compiled loop. It is the same for all diagrams, so where there is none yet, a process of its own makes it."""

from __future__ import annotations

import subprocess
import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from cosim.compiling import kernels
from cosim.machine import cache, notices, parallel
from cosim.master import integration, loop

_FUNCTIONS = (loop.run, loop.execute, integration.derive)
_WORDS = "from cosim.engine import loop_code; loop_code.compile_loop()"


def compile_loop() -> kernels.Module:
    """The loop's module, from the cache or compiled now."""
    return kernels.raw_module("engine", _FUNCTIONS)


@contextmanager
def compiled_beside() -> Iterator[Callable[[], kernels.Module]]:
    """What gives the loop's module, which is compiled meanwhile if it is not in the cache and a processor is free.

    Whatever becomes of the other process, the module is as `compile_loop` gives it: what is not in the cache at the
    end is compiled here.
    """
    if kept := kernels.kept("engine", kernels.raw_sources("engine", _FUNCTIONS)):
        yield lambda: kept
        return
    if parallel.processors() == 1 or not cache.is_usable():
        yield compile_loop
        return
    notices.progress("compiling engine, once…")
    began = clock.perf_counter()
    words = [sys.executable, "-P", "-c", _WORDS]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet) as other:  # noqa: S603  # ours

        def wait() -> kernels.Module:
            other.wait()
            made = compile_loop()
            return replace(made, compiled_now=True, seconds=made.seconds or clock.perf_counter() - began)

        try:
            yield wait
        finally:
            other.kill()
