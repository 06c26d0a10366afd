"""Runs a study: what is done is read from the store, the rest is run and added to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.synchronize import Event as SharedEvent
from pathlib import Path
from typing import Any

from cosim.errors import CosimError
from cosim.language.source import Node
from cosim.machine import parallel
from cosim.results.metrics import from_json
from cosim.study import executors, member_run, plan, sequential
from cosim.study.definition import Study
from cosim.study.draws import Draws
from cosim.study.member_run import Row
from cosim.study.plan import Member
from cosim.study.store import MemoryStore, Store
from cosim.study.variants import Prepared, Variants

FAILED = ("failed", "diverged", "terminated")
"""How a run ends that does not come to its end."""
FIRST_DRAWS = 32
"""Of a study that ends when a probability is known: after so many, and then a quarter more each time, it is asked."""
WINDOW = 3
"""Members under way for each worker: one runs, the next ones wait beside it."""


@dataclass
class Job:
    """A member that is to run."""

    number: int
    member: Member
    prepared: Prepared
    key: str
    file: Path | None


@dataclass
class Options:
    """How to run. threads: 0 for one each processor. cluster: a scheduler's address. settings: the study's --set.

    folder: where everything is kept; None: in memory.
    """

    folder: Path | None
    threads: int = 0
    cluster: str = ""
    settings: tuple[str, ...] = ()
    watch: Callable[[int, int], None] = lambda done, total: None
    origin: executors.Origin | None = None  # where other processes have the study from, if not from its file
    here: bool = False  # whether members run one by one in this process, as no other can have their code


@dataclass
class Results:
    """What a study gave. ran, reused: how many members this call ran, and how many needed no run.

    first: the draw that `keys` and `refused` begin with.
    """

    study: Study
    variants: Variants
    draws: Draws | None
    folder: Path | None
    total: int
    ran: int = 0
    reused: int = 0
    seconds: float = 0.0
    keys: list[str | None] = field(default_factory=list)
    refused: dict[int, Row] = field(default_factory=dict)
    store: Store | MemoryStore | None = None
    first: int = 0

    @property
    def kept_in(self) -> Path:
        """The folder where all of it is kept."""
        assert self.folder, "it is kept in memory"
        return self.folder

    @property
    def reductions(self) -> dict[str, str]:
        """How each figure of a run is made, as of `Diagram.figures`."""
        bases = [self.variants.base(name) for name in reversed(self.study.variants)]
        return {name: made for base in bases for name, made in base.diagram.figures.items()}

    def take(self, keys: list[list[str | None]], refused: list[dict[int, Row]], count: int) -> None:
        """Be what the first draws of each variant and grid point gave; their keys, and rows without one, by draw."""
        assert self.draws is not None
        assert self.study.random is not None
        self.draws.count, self.total = count, len(keys) * count
        self.study = replace(self.study, random=replace(self.study.random, count=count))
        self.keys = [key for group in keys for key in group[:count]]
        self.refused = {
            k * count + draw: row for k, group in enumerate(refused) for draw, row in group.items() if draw < count
        }

    def files(self) -> dict[str, Path]:
        """The files with the signals of those members that have recorded them."""
        members = zip(plan.members(self.study, self.draws), self.keys, strict=True)
        named = [(chosen.name, member_file(self.folder, chosen), key) for chosen, key in members]
        return {name: file for name, file, key in named if key and member_run.holds(file, key)}

    def rows(self) -> Iterator[Row]:
        """Every member's row, read from the store one by one."""
        assert self.store is not None
        for number, chosen in enumerate(plan.members(self.study, self.draws, self.first)):
            key = self.keys[number]
            row = self.refused[number] if key is None else self.store[key]
            yield {**row, "metrics": from_json(row["metrics"]), **identity(chosen)}


def identity(chosen: Member) -> Row:
    """Which member a row belongs to; two members that are the same run share their other fields."""
    return {"name": chosen.name, "variant": chosen.variant, "grid": list(chosen.grid), "draw": chosen.draw}


def run(study: Study, options: Options) -> Results:
    """Run what is not done, and return everything. Raises: DiagramErrors, ResultError, ClusterError.

    A Ctrl-C keeps what is finished.
    """
    began = time.perf_counter()
    variants = Variants(study)
    variants.check()
    draws = variants.draws()
    results = Results(study, variants, draws, options.folder, plan.size(study))
    results.store = Store(options.folder / "members.jsonl") if options.folder else MemoryStore()
    try:
        _run(results, options)
    finally:
        results.seconds = time.perf_counter() - began
        results.store.close()
    return results


def run_one(study: Study, name: str, folder: Path) -> tuple[Member, Row]:
    """Run one member again, recording its signals. Raises: UnknownSetting."""
    variants = Variants(study)
    chosen = plan.find(study, variants.draws(), name)
    if study.record is None:
        study.record = Node({}, next(iter(study.variants.values())).diagram_position)
    row = member_run.run(variants, chosen, member_file(folder, chosen))
    return chosen, {**row, "metrics": from_json(row["metrics"])}


def member_file(folder: Path | None, chosen: Member) -> Path:
    """Where a member's signals are recorded."""
    assert folder, "in memory, nothing is recorded"
    return folder / "members" / f"{chosen.name}.nc"


def _run(results: Results, options: Options) -> None:
    count = min(options.threads or parallel.processors(), results.total)
    if options.cluster:
        with executors.cluster(options.cluster) as (executor, workers):
            submit = partial(_run_elsewhere, executor, results.study, options)
            _work(results, options, submit, WINDOW * workers, executor, threading.Event())
    elif results.variants.shareable() or options.here:
        with parallel.threads(1 if options.here else count) as executor:
            stop = threading.Event()
            _work(results, options, partial(_run_here, executor, results, stop), WINDOW * count, executor, stop)
    else:
        shared = executors.shared_event()
        with executors.processes(count, shared) as executor:
            submit = partial(_run_elsewhere, executor, results.study, options)
            _work(results, options, submit, WINDOW * count, executor, shared)


def _run_here(executor: Executor, results: Results, stop: threading.Event, job: Job) -> Future[Row]:
    return executor.submit(member_run.run, results.variants, job.member, job.file, stop.is_set, job.prepared)


def _run_elsewhere(executor: Executor, study: Study, options: Options, job: Job) -> Future[Row]:
    origin = options.origin or executors.StudyFile(str(study.path.resolve()), options.settings)
    return executor.submit(executors.run_elsewhere, origin, job.member, job.file, job.key)


def _work(
    results: Results,
    options: Options,
    submit: Callable[[Job], Future[Row]],
    window: int,
    executor: Executor,
    stop: threading.Event | SharedEvent,
) -> None:
    """Run all jobs, or those of as many draws as it takes until what is to be known is known."""
    study, draws = results.study, results.draws
    if not study.until or draws is None:
        _collect(results, options, submit, window, executor, stop)
        return
    groups, most = results.total // draws.count, draws.count
    keys: list[list[str | None]] = [[] for _ in range(groups)]
    refused: list[dict[int, Row]] = [{} for _ in range(groups)]
    needed: int | None = None
    while needed is None and results.first < most:
        width = min(max(FIRST_DRAWS, results.first // 4), most - results.first)
        draws.count = results.first + width
        results.keys, results.refused = [], {}
        _collect(results, options, submit, window, executor, stop)
        for number, key in enumerate(results.keys):
            keys[number // width].append(key)
        for number, row in results.refused.items():
            refused[number // width][results.first + number % width] = row
        results.first = 0
        results.take(keys, refused, draws.count)
        needed = sequential.draws_needed(sequential.trials(study, results.rows()))
        results.first = draws.count
    results.first = 0
    results.take(keys, refused, needed or most)


def _collect(
    results: Results,
    options: Options,
    submit: Callable[[Job], Future[Row]],
    window: int,
    executor: Executor,
    stop: threading.Event | SharedEvent,
) -> None:
    """Run all jobs and keep their rows; where that is broken off, of those that are finished. stop: ends their runs."""
    pending: dict[Future[Row], Job] = {}
    try:
        for job, future in executors.finished(_jobs(results, options.folder), submit, window, pending):
            _keep(results, options, job, future)
    except BaseException:
        stop.set()
        executor.shutdown(wait=True, cancel_futures=True)
        for future, job in pending.items():
            if future.done() and not future.cancelled() and results.store and job.key not in results.store:
                with suppress(CosimError, KeyboardInterrupt):
                    _keep(results, options, job, future)
        raise


def _keep(results: Results, options: Options, job: Job, future: Future[Row]) -> None:
    """Keep the row of a finished job. Raises: KeyboardInterrupt if it was interrupted, ResultError."""
    assert results.store is not None
    row = {"key": job.key, **identity(job.member), **executors.row(future)}
    if row["status"] == "interrupted":
        raise KeyboardInterrupt
    results.store.append(row)
    results.ran += 1
    options.watch(results.reused + results.ran + len(results.refused), results.total)


def _jobs(results: Results, folder: Path | None) -> Iterator[Job]:
    """The members that have to run; those whose values a block refuses are noted and never run."""
    store, study = results.store, results.study
    assert store is not None
    under_way: set[str] = set()
    for number, chosen in enumerate(plan.members(study, results.draws, results.first)):
        try:
            prepared = results.variants.prepared(chosen)
        except CosimError as error:
            results.keys.append(None)
            results.refused[number] = member_run.lost(error.message)
            continue
        key = prepared.key
        results.keys.append(key)
        file = member_file(folder, chosen) if study.records else None
        done = key in store or key in under_way if file is None else key in store and member_run.holds(file, key)
        if done:
            results.reused += 1
            continue
        under_way.add(key)
        yield Job(number, chosen, prepared, key, file)


def summary(results: Results) -> dict[str, Any]:
    """Counts of members by status, the reasons of those that failed with how often and where first, and `broken`."""
    counts: dict[str, int] = {}
    reasons: dict[str, list[Any]] = {}
    for row in results.rows():
        counts[row["status"]] = counts.get(row["status"], 0) + 1
        if row["status"] in FAILED:
            entry = reasons.setdefault(row["reason"], [0, row["name"]])
            entry[0] += 1
    failed = sum(counts.get(status, 0) for status in FAILED)
    return {"counts": counts, "failed": failed, "reasons": reasons, "conditions": list(broken(results.rows()))}


def broken(rows: Iterable[Row]) -> Iterator[str]:
    """Each condition of a theorem that some runs do not keep: in how many of those that judge it, and where first."""
    verdicts: dict[str, list[tuple[bool | None, str]]] = {}
    for row in rows:
        for name, holds in row.get("conditions", {}).items():  # rows of earlier versions have none
            verdicts.setdefault(name, []).append((holds, row["name"]))
    for name, found in verdicts.items():
        if failing := [member for holds, member in found if holds is False]:
            yield f"{name} fails in {len(failing)} of {len(found)} runs, first in {failing[0]}"
