"""Runs a study: what is done is read from the store, the rest is run and added to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.errors import CosimError
from cosim.study import executors, member, plan
from cosim.study.draws import Draws
from cosim.study.member import Row
from cosim.study.model import Study
from cosim.study.plan import Member
from cosim.study.store import Store
from cosim.study.variants import Prepared, Variants

FAILED = ("failed", "diverged")
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
    """How to run. threads: 0 for one each processor. cluster: a scheduler's address. settings: the study's --set."""

    folder: Path
    threads: int = 0
    cluster: str = ""
    settings: tuple[str, ...] = ()
    watch: Callable[[int, int], None] = lambda done, total: None


@dataclass
class Results:
    """What a study gave. ran, reused: how many members this call ran, and how many needed no run."""

    study: Study
    variants: Variants
    draws: Draws | None
    folder: Path
    total: int
    ran: int = 0
    reused: int = 0
    seconds: float = 0.0
    keys: list[str | None] = field(default_factory=list)
    refused: dict[int, Row] = field(default_factory=dict)
    store: Store | None = None

    def rows(self) -> Iterator[Row]:
        """Every member's row, read from the store one by one."""
        assert self.store is not None
        for number, chosen in enumerate(plan.members(self.study, self.draws)):
            key = self.keys[number]
            row = self.refused[number] if key is None else self.store[key]
            yield {**row, **identity(chosen)}


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
    results.store = Store(options.folder / "members.jsonl")
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
        from cosim.source import Node

        study.record = Node({}, next(iter(study.variants.values())).diagram_position)
    return chosen, member.run(variants, chosen, member_file(folder, chosen), lambda time: None)


def member_file(folder: Path, chosen: Member) -> Path:
    """Where a member's signals are recorded."""
    return folder / "members" / f"{chosen.name}.nc"


def _run(results: Results, options: Options) -> None:
    stop = threading.Event()

    def watch(time: float) -> None:
        if stop.is_set():
            raise KeyboardInterrupt

    def here(job: Job) -> Future[Row]:
        return executor.submit(_run_here, results.variants, job, watch)

    def elsewhere(job: Job) -> Future[Row]:
        arguments = (str(results.study.path.resolve()), options.settings, job.member, job.file, job.key)
        return executor.submit(executors.run_elsewhere, *arguments)

    if options.cluster:
        with executors.cluster(options.cluster) as (executor, count):
            _collect(results, options, elsewhere, WINDOW * count)
        return
    count = options.threads or executors.processors()
    shared = results.variants.shareable()
    with (executors.threads if shared else executors.processes)(count) as executor:
        try:
            _collect(results, options, here if shared else elsewhere, WINDOW * count)
        except BaseException:
            stop.set()
            raise


def _run_here(variants: Variants, job: Job, watch: Callable[[float], None]) -> Row:
    return member.run(variants, job.member, job.file, watch, job.prepared)


def _collect(results: Results, options: Options, submit: Callable[[Job], Future[Row]], window: int) -> None:
    assert results.store is not None
    for job, future in executors.finished(_jobs(results, options.folder), submit, window):
        row = _row(job, future)
        if row["status"] == "interrupted":
            raise KeyboardInterrupt
        results.store.append(row)
        results.ran += 1
        options.watch(results.reused + results.ran, results.total)


def _row(job: Job, future: Future[Row]) -> Row:
    """The row of a finished job. What nobody foresaw, such as workers that keep dying, is that member's failure."""
    try:
        row = future.result()
    except CosimError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        row = {"status": "failed", "reason": reason, "steps": 0, "seconds": 0.0, "metrics": {}}
    file = {"file": str(job.file)} if job.file else {}
    return {"key": job.key, **identity(job.member), **row, **file}


def _jobs(results: Results, folder: Path) -> Iterator[Job]:
    """The members that have to run; those whose values a block refuses are noted and never run."""
    store, study = results.store, results.study
    assert store is not None
    under_way: set[str] = set()
    for number, chosen in enumerate(plan.members(study, results.draws)):
        try:
            prepared = results.variants.prepared(chosen)
        except CosimError as error:
            row = {"status": "failed", "reason": error.message, "steps": 0, "seconds": 0.0, "metrics": {}}
            results.keys.append(None)
            results.refused[number] = row
            results.reused += 1
            continue
        key = member.key(prepared)
        results.keys.append(key)
        file = member_file(folder, chosen) if study.records else None
        if key in under_way or (key in store and (file is None or Path(store[key].get("file", "")).is_file())):
            results.reused += 1
            continue
        under_way.add(key)
        yield Job(number, chosen, prepared, key, file)


def summary(results: Results) -> dict[str, Any]:
    """Counts of members by status, and the reasons of those that failed with how often and where first."""
    counts: dict[str, int] = {}
    reasons: dict[str, list[Any]] = {}
    for row in results.rows():
        counts[row["status"]] = counts.get(row["status"], 0) + 1
        if row["status"] in FAILED:
            entry = reasons.setdefault(row["reason"], [0, row["name"]])
            entry[0] += 1
    return {"counts": counts, "reasons": reasons}
