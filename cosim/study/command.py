"""`cosim study`: runs a study, shows its tables, and says what failed and how to run it again."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from cosim import terminal
from cosim.errors import CosimError
from cosim.study import dataset, description, display, running, tables
from cosim.study.running import Options, Results

REASONS_SHOWN = 5


def study(options: argparse.Namespace) -> int:
    """Run each study. Returns the exit code: 0 also if members failed, as that is a result."""
    for path in options.study:
        if options.member:
            _run_member(description.load(path, options.set), options.member, options.results / path.stem)
            continue
        results = run(path, options)
        _report(results, options.json)
    return 0


def run(path: Path, options: argparse.Namespace) -> Results:
    """Run a study with a progress bar, and write its data set and tables. Raises: DiagramErrors, ResultError."""
    folder = options.results / path.stem
    with display.Counter() as counter:
        settings = Options(folder, options.threads, options.dask, tuple(options.set), counter.update)
        try:
            results = running.run(description.load(path, options.set), settings)
        except KeyboardInterrupt:
            done = f"{counter.done} of {counter.total} members are done"
            print(f"{done}; the same command goes on from there", file=sys.stderr)
            raise
    dataset.write(folder / "study.nc", results)
    tables.write(results, tables.tables(results))
    return results


def _report(results: Results, as_json: bool) -> None:
    summary = running.summary(results)
    if as_json:
        content: dict[str, Any] = {"study": str(results.study.path), "results": str(results.folder / "study.nc")}
        content |= {"members": results.total, "ran": results.ran, "seconds": round(results.seconds, 3), **summary}
        content["tables"] = {t.title: [t.head, *t.rows] for t in tables.tables(results)}
        print(json.dumps(content, ensure_ascii=False))
        return
    for table in tables.tables(results):
        display.show(table)
    counts = ", ".join(f"{count} {status}" for status, count in summary["counts"].items())
    before = f", {results.reused} needed no run" if results.reused else ""
    print(f"\n{results.total} members: {counts} (ran {results.ran} in {results.seconds:.3g} s{before})")
    print(f"recorded in {results.folder / 'study.nc'}")
    warnings = [
        CosimError(f"{count} × {reason}", fix=f"replay the first: cosim study {results.study.path} --member {name}")
        for reason, (count, name) in list(summary["reasons"].items())[:REASONS_SHOWN]
    ]
    terminal.print_warnings(warnings)


def _run_member(study: Any, name: str, folder: Path) -> None:
    began = time.perf_counter()
    chosen, row = running.run_one(study, name, folder)
    terminal.metrics_table(row["metrics"])
    print(f"\n{row['status']} after {row['steps']} steps ({time.perf_counter() - began:.3g} s) {row['reason']}")
    print(f"recorded in {running.member_file(folder, chosen)}")
