"""Runs a diagram at points of a search, several at once; what has been run before is read from the store."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing.synchronize import Event as SharedEvent
from pathlib import Path

from cosim.errors import CosimError
from cosim.machine import parallel
from cosim.results.metrics import from_json
from cosim.study import executors, member_run
from cosim.study.definition import Random, Study
from cosim.study.member_run import Row
from cosim.study.plan import Member
from cosim.study.store import Store
from cosim.study.variants import Prepared, Settings, Variants

Submit = Callable[[Member, Prepared], "Future[Row]"]
NUMBERS = ("metrics", "bounds")
"""The parts of a row that have numbers which JSON does not have."""


class Evaluator:
    """The runs of one variant of a study over a space. threads: 0 for one each processor; settings: the study's --set.

    watch: told how many runs are done. Raises: DiagramErrors, ResultError for a store that cannot be written.
    """

    def __init__(
        self,
        study: Study,
        space: Random,
        folder: Path,
        threads: int = 0,
        settings: Sequence[str] = (),
        watch: Callable[[int], None] = lambda done: None,
    ) -> None:
        self.variant = next(iter(study.variants))
        self.variants = Variants(study)
        self.variants.check()
        self.draws = self.variants.draws_of(space)
        self.done = self.ran = 0
        self.count = threads or parallel.processors()
        self.origin: executors.Origin = executors.StudyFile(str(study.path.resolve()), tuple(settings))
        self._watch = watch
        self._store = Store(folder / "runs.jsonl")
        self._submit: Submit | None = None

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Have workers; when it is broken off, runs that are under way end, and what is finished is kept."""
        stop: threading.Event | SharedEvent
        try:
            with ExitStack() as stack:
                if self.variants.shareable():
                    stop = threading.Event()
                    self._submit = partial(self._here, stack.enter_context(parallel.threads(self.count)), stop)
                else:  # the code of FMUs, which nobody vouches for
                    stop = shared = executors.shared_event()
                    made = executors.processes(self.count, shared)
                    self._submit = partial(self._elsewhere, stack.enter_context(made))
                try:
                    yield
                except BaseException:
                    stop.set()
                    raise
        finally:
            self._store.close()

    def _here(self, executor: Executor, stop: threading.Event, chosen: Member, prepared: Prepared) -> Future[Row]:
        return executor.submit(member_run.run, self.variants, chosen, None, stop.is_set, prepared)

    def _elsewhere(self, executor: Executor, chosen: Member, prepared: Prepared) -> Future[Row]:
        return executor.submit(executors.run_elsewhere, self.origin, chosen, None, prepared.key)

    def rows(self, points: Sequence[Settings], until: float | None = None) -> list[Row]:
        """The row of each point, as a study has it; until: as of `Member`. Raises: KeyboardInterrupt, ResultError."""
        assert self._submit
        keys: list[str | None] = []
        futures: dict[str, Future[Row]] = {}
        refused: dict[int, Row] = {}
        for number, settings in enumerate(points):
            chosen = Member(self.variant, settings=settings, until=until)
            try:
                prepared = self.variants.prepared(chosen)
            except CosimError as error:
                keys.append(None)
                refused[number] = member_run.lost(error.message)
                continue
            key = prepared.key if until is None else f"{prepared.key} until {until!r}"
            keys.append(key)
            if key not in self._store and key not in futures:
                futures[key] = self._submit(chosen, prepared)
        try:
            for key, future in futures.items():
                self._keep(key, future)
        except BaseException:
            for key, future in futures.items():
                if future.done() and key not in self._store:
                    with suppress(CosimError, KeyboardInterrupt):
                        self._keep(key, future)
            raise
        self.done += len(points)
        self._watch(self.done)
        found = [refused[n] if key is None else self._store[key] for n, key in enumerate(keys)]
        return [{**row, **{part: from_json(row[part]) for part in NUMBERS if part in row}} for row in found]

    def _keep(self, key: str, future: Future[Row]) -> None:
        row = executors.row(future)
        if row["status"] == "interrupted":
            raise KeyboardInterrupt
        self._store.append({"key": key, **row})
        self.ran += 1
