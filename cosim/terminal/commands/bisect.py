"""`cosim bisect`: where the runs of two diagrams part, what that comes from, and which key explains how much."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.engine import run as engine
from cosim.results.formatting import format_value
from cosim.results.metrics import for_json
from cosim.results.text_table import TextTable
from cosim.terminal import study_display
from cosim.terminal.exits import DIFFERENT, DONE, STOPPED
from cosim.terminal.screen import print_rows, say
from cosim.tracing import causes, forks, shares
from cosim.tracing.causes import Trail
from cosim.tracing.forks import Branch, Fork
from cosim.tracing.shares import Shares
from cosim.wiring.network import Signal

SHOWN = 12
"""Of more signals that differ, the first are shown."""
SMALL = 0.005
"""What explains less of a metric's change is not shown."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("first", type=Path, metavar="A.yaml", help="a diagram")
    parser.add_argument("second", type=Path, nargs="?", metavar="B.yaml", help="another one (default: A, changed)")
    parser.add_argument("--set", action="append", default=[], metavar="a.b.c=VALUE", help="change one value of B")
    parser.add_argument(
        "--swap", action="append", default=[], metavar="BLOCK=TYPE", help="another type for a block of B"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run(options: argparse.Namespace) -> int:
    """Run both side by side up to where they part, and then with each key of the other; 1 where they part, or fail."""
    a = engine.load(options.first)
    b = engine.load(options.second or options.first, options.set, options.swap)
    found = forks.fork(a, b)
    if not found.is_one:
        _tell_same(found, options.json)
        return STOPPED if found.failed else DONE
    trail = causes.trail(a, b, found)
    explained = shares.shares(a, b)
    if options.json:
        print(json.dumps(for_json(_as_json(found, trail, explained)), ensure_ascii=False))
    else:
        _show_fork(found, trail)
        _show_shares(explained)
    return DIFFERENT


def _tell_same(found: Fork, in_json: bool) -> None:
    if in_json:
        content = {"same": True, "until": found.time, "signals": found.same, "alone": _names(found.alone)}
        print(json.dumps(for_json({**content, "ends": list(found.ends)}), ensure_ascii=False))
        return
    begin = f"up to t = {found.time:g} s" if math.isfinite(found.time) else "with no communication point reached,"
    say(f"{begin} the runs are the same in all {found.same} signals that both have, to the bit")
    if found.ends[0]:
        say(f"both end there: {found.ends[0]}")
    if found.alone:
        say(f"only one has {', '.join(_names(found.alone))}")


def _show_fork(found: Fork, trail: Trail) -> None:
    if not found.same:
        say("the runs have no signal in common that could be compared")
    for signal, kinds in found.unlike.items():
        say(f"{signal} cannot be compared: {' → '.join(kinds)}")
    if not found.branches:
        for name, end in zip("AB", found.ends, strict=True) if found.ends[0] != found.ends[1] else ():
            say(f"{name}: {end or 'comes to its end'}")
        say(
            f"nothing else differs up to t = {found.time:g} s"
            if math.isfinite(found.time)
            else "nothing else is reached"
        )
        return
    step = f"after {found.step} step{'' if found.step == 1 else 's'}" if found.step else "at the start"
    say(f"the runs part at t = {found.time:g} s, {step}:")
    for cause in trail.causes:
        print_rows([_row(cause.signal, found.branches[cause.signal])], "  ")
        for change in cause.changes:
            say(f"    {cause.signal.component}: {change}")
    if trail.carried:
        say("and from there at the same time:")
        rows = [
            [*_row(signal, found.branches[signal]), f"by {', '.join(map(str, dict.fromkeys(by)))}"]
            for signal, by in trail.carried[:SHOWN]
        ]
        print_rows(rows, "  ")
        if len(trail.carried) > SHOWN:
            say(f"  and {len(trail.carried) - SHOWN} more")


def _row(signal: Signal, branch: Branch) -> list[str]:
    where = f"[{','.join(map(str, branch.element))}]" if branch.element else ""
    return [f"{signal}{where}", " → ".join(map(repr, branch.values))]


def _show_shares(explained: Shares) -> None:
    print()
    if explained.too_many:
        say(f"{explained.too_many} keys differ: too many to be changed one by one")
    for share in explained.shares:
        say(f"{share.key}: {' → '.join(share.texts)}" + (f"; not changed alone: {share.why}" if share.why else ""))
    first, second = explained.metrics
    rows = [
        [name, format_value(first[name]), format_value(second[name]), _explained(explained, name)]
        for name in first
        if first[name] != second[name]
    ]
    if rows:
        print()
        study_display.show(TextTable("", ["metric", "A", "B", "explained by"], rows), numbers=False)


def _explained(explained: Shares, metric: str) -> str:
    """The shares of the keys in a metric's change, the largest first."""
    change = explained.metrics[1][metric] - explained.metrics[0][metric]
    parts = [(share.key, share.changes[metric]) for share in explained.shares if share.changes]
    parts = [*sorted(parts, key=lambda part: -abs(part[1])), ("together", explained.together(metric))]
    told = [f"{key} {100.0 * part / change:.0f} %" for key, part in parts if abs(part) > SMALL * abs(change)]
    return ", ".join(told)


def _as_json(found: Fork, trail: Trail, explained: Shares) -> dict[str, Any]:
    return {
        "same": False,
        "step": found.step if found.branches else None,
        "time": found.time if found.branches else None,
        "ends": list(found.ends),
        "causes": [
            {**_branch(cause.signal, found.branches[cause.signal]), "changes": list(cause.changes)}
            for cause in trail.causes
        ],
        "carried": [
            {**_branch(signal, found.branches[signal]), "by": [str(s) for s in by]} for signal, by in trail.carried
        ],
        "metrics": {name: [value, explained.metrics[1][name]] for name, value in explained.metrics[0].items()},
        "shares": {share.key: share.changes for share in explained.shares},
        "alone": _names(found.alone),
        "unlike": {str(signal): list(kinds) for signal, kinds in found.unlike.items()},
    }


def _branch(signal: Signal, branch: Branch) -> dict[str, Any]:
    return {"signal": str(signal), "element": list(branch.element), "values": list(branch.values)}


def _names(signals: Sequence[Signal]) -> list[str]:
    return [str(signal) for signal in signals]
