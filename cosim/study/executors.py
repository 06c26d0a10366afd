"""Where members run: on threads of this process, in processes of their own, or on a Dask cluster.

All three are `concurrent.futures` executors, and all run the same function on the same table, so they give the same
bits. Threads share the kernels, and the compiled loop lets go of the interpreter's lock.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from multiprocessing.synchronize import Event as SharedEvent
from pathlib import Path
from threading import Thread
from typing import Any

from cosim.errors import ClusterError, CosimError
from cosim.machine import interruption, parallel
from cosim.study import member_run, study_file
from cosim.study.definition import Study
from cosim.study.member_run import Row
from cosim.study.plan import Member
from cosim.study.variants import Variants

RETRIES = 8
"""How often a member is given to another worker when its worker dies."""


@contextmanager
def processes(count: int, stop: SharedEvent) -> Iterator[Executor]:
    """Processes of their own, for blocks that a process can have only once. stop: a shared mark, which ends runs."""
    with parallel.ending(ProcessPoolExecutor(count, _CONTEXT, _begin, (stop,))) as executor:
        yield executor


def shared_event() -> SharedEvent:
    """A mark that other processes see."""
    return _CONTEXT.Event()


class _Process(SpawnProcess):
    """A process that does not run the program's own script once more: its work comes from this package alone."""

    @staticmethod
    def _Popen(process_obj: Any) -> Any:  # noqa: N802  # the standard library's name
        main = vars(sys.modules["__main__"])
        kept: dict[str, Any] = {name: main.pop(name) for name in ("__file__", "__spec__") if name in main}
        main["__spec__"] = None
        try:
            return SpawnProcess._Popen(process_obj)  # noqa: SLF001
        finally:
            main.update(kept)


class _Context(SpawnContext):
    Process = _Process


_CONTEXT = _Context()
_stop: SharedEvent | None = None  # of a process among `processes`


def _begin(stop: SharedEvent) -> None:
    """In a new process: signals are the first one's affair, which tells the others by the mark."""
    global _stop  # noqa: PLW0603  # a new process has no other place for it
    _stop = stop
    interruption.ignore()
    Thread(target=_follow, args=(parent_process(),), daemon=True).start()


def _follow(parent: BaseProcess) -> None:
    """End with the first process, whatever ends it."""
    parent.join()
    os._exit(1)


def _is_stopped() -> bool:
    return _stop is not None and _stop.is_set()


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """A Dask cluster, and how many threads its workers have. Raises: ClusterError."""
    try:
        from distributed import Client
    except ImportError:
        message = "Dask's distributed scheduler is not installed"
        raise ClusterError(message, fix="pip install distributed") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        fix = "start it with `dask scheduler`, and workers with `dask worker ADDRESS`"
        raise ClusterError(f"there is no Dask scheduler at {address}: {error}", fix=fix) from None
    with client:
        count = sum(client.nthreads().values())
        with parallel.ending(client.get_executor(pure=False, retries=RETRIES)) as executor:
            yield executor, max(count, 1)


def row(future: Future[Row]) -> Row:
    """The row of a finished job; what nobody foresaw, such as workers that keep dying, is that member's failure.

    Raises: what is no member's own, such as ResultError.
    """
    try:
        return future.result()
    except CosimError:
        raise
    except Exception as error:  # noqa: BLE001  # a lost member does not end the rest
        return member_run.lost(f"{type(error).__name__}: {error}")


def finished(
    jobs: Iterable[Any], submit: Callable[[Any], Future[Row]], window: int, pending: dict[Future[Row], Any]
) -> Iterator[tuple[Any, Future[Row]]]:
    """Each job with its future when that is done, in any order; never more than `window` are under way.

    pending: holds those whose turn has not come yet, also when this is broken off.
    """
    for job in jobs:
        pending[submit(job)] = job
        if len(pending) >= window:
            yield from _done(pending)
    while pending:
        yield from _done(pending)


def _done(pending: dict[Future[Row], Any]) -> Iterator[tuple[Any, Future[Row]]]:
    done, _ = wait(pending, return_when=FIRST_COMPLETED)
    for future in done:
        yield pending[future], future
        del pending[future]


@dataclass(frozen=True)
class StudyFile:
    """A study to be read elsewhere from its file."""

    path: str
    settings: tuple[str, ...]

    def load(self) -> Study:
        """The study, as the file is now. Raises: DiagramErrors."""
        return study_file.load(self.path, self.settings)


@dataclass(frozen=True)
class PickledStudy:
    """A study that a program has made, to be taken elsewhere as it is."""

    content: bytes

    def load(self) -> Study:
        """The study."""
        study: Study = pickle.loads(self.content)  # noqa: S301  which this very program has written
        return study


Origin = StudyFile | PickledStudy


def run_elsewhere(origin: Origin, chosen: Member, file: Path | None, key: str) -> Row:
    """Run a member in another process, which reads the study itself, and again if its copy is not up to date."""
    variants = _variants(origin)
    prepared = variants.prepared(chosen)
    if prepared.key != key:
        _variants.cache_clear()
        variants = _variants(origin)
        prepared = variants.prepared(chosen)
    return member_run.run(variants, chosen, file, _is_stopped, prepared)


@lru_cache(maxsize=4)
def _variants(origin: Origin) -> Variants:
    return Variants(origin.load())
