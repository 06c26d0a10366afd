"""`cosim study`: runs a study, shows its tables, and says what failed and how to run it again."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.errors import CosimError, ResultError
from cosim.requirements.verdict import WORDS
from cosim.study import dataset, file_names, kept, known, running, study_file, table_files, text_tables
from cosim.study.counter import Counter
from cosim.study.running import Options, Results
from cosim.terminal import screen, study_display
from cosim.terminal.exits import DONE, STOPPED, UNCERTAIN, VIOLATED

REASONS_SHOWN = 5


def study(options: argparse.Namespace) -> int:
    """Run each study. Returns the exit code, as of `exit_code`."""
    check_folders(options.study)
    codes = []
    for path in options.study:
        if options.member:
            study = study_file.load(path, options.set)
            codes.append(_run_member(study, options.member, options.results / path.stem))
            continue
        results = run(path, options)
        _report(results, options.json)
        codes.append(exit_code(results))
    return max(codes)


def exit_code(results: Results) -> int:
    """0, also if some members failed, as that may be what the study is about; 1 if not one has come to its end."""
    if not running.summary(results)["counts"].get("completed"):
        return STOPPED
    return VIOLATED if kept.violated(results.rows()) else DONE


def check_folders(paths: Sequence[Path]) -> None:
    """Each study has a folder of its own. Raises: ResultError if two studies of one call have not."""
    known: dict[str, Path] = {}
    for path in paths:
        if (name := file_names.folded(path.stem)) in known:
            message = f"{known[name]} and {path} would be written to one folder, `{path.stem}`"
            raise ResultError(message, fix="rename one of them, or run them with different --results")
        known[name] = path


def run(path: Path, options: argparse.Namespace) -> Results:
    """Run a study with a progress bar, and write its data set and tables. Raises: DiagramErrors, ResultError."""
    folder = options.results / path.stem
    with Counter() as counter:
        settings = Options(folder, options.threads, options.dask, tuple(options.set), counter.update)
        try:
            results = running.run(study_file.load(path, options.set), settings)
        except KeyboardInterrupt:
            so_far = f"{counter.done} of {counter.total} members" if counter.total else "the preparation"
            kept = "all that is done is kept, and the same command goes on from there"
            print(f"came as far as {so_far}; {kept}", file=sys.stderr)
            raise
    dataset.write(folder / "study.nc", results)
    table_files.write(results, text_tables.tables(results))
    return results


def _report(results: Results, as_json: bool) -> None:
    summary = running.summary(results)
    if as_json:
        content: dict[str, Any] = {"study": str(results.study.path), "results": str(results.kept_in / "study.nc")}
        content |= {"members": results.total, "ran": results.ran, "seconds": round(results.seconds, 3), **summary}
        content["requirements"] = kept.as_json(results.study, results.rows())
        if results.study.until:
            content["until"] = known.as_json(results.study, results.rows())
        content["tables"] = {t.title: [t.head, *t.rows] for t in text_tables.tables(results)}
        print(json.dumps(content, ensure_ascii=False))
        return
    for table in text_tables.tables(results):
        study_display.show(table)
    if judged := kept.table(results.study, results.rows()):
        study_display.show(judged, numbers=False)
    if drawn_for := known.table(results.study, list(results.rows())):
        study_display.show(drawn_for, numbers=False)
    counts = ", ".join(f"{count} {status}" for status, count in summary["counts"].items())
    counts += "" if summary["failed"] else ", none failed"
    before = f", {results.reused} needed no run" if results.reused else ""
    print(f"\n{results.total} members: {counts} (ran {results.ran} in {results.seconds:.3g} s{before})")
    print(f"recorded in {results.kept_in / 'study.nc'}, and its tables beside it as .csv, .md and .tex")
    reasons = list(summary["reasons"].items())
    warnings = [
        CosimError(f"{count} × {reason}", fix=f"replay the first: cosim study {results.study.path} --member {name}")
        for reason, (count, name) in reasons[:REASONS_SHOWN]
    ]
    if len(reasons) > REASONS_SHOWN:
        warnings.append(CosimError(f"{len(reasons) - REASONS_SHOWN} more reasons", fix="--json lists all of them"))
    screen.print_warnings([*warnings, *map(CosimError, summary["conditions"])])


def _run_member(study: Any, name: str, folder: Path) -> int:
    began = time.perf_counter()
    chosen, row = running.run_one(study, name, folder)
    screen.metrics_table(row["metrics"])
    print(f"\n{row['status']} after {row['steps']} steps ({time.perf_counter() - began:.3g} s) {row['reason']}")
    print(f"recorded in {running.member_file(folder, chosen)}")
    if row["status"] != "completed":
        return STOPPED
    for requirement, (holds, place) in row["requirements"].items():
        screen.say(f"{requirement}: {WORDS[holds]}, {place}" if place else f"{requirement}: {WORDS[holds]}")
    judged = [holds for holds, _ in row["requirements"].values()]
    return VIOLATED if False in judged else UNCERTAIN if None in judged else DONE
