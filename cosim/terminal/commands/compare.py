"""`cosim compare`: two results side by side, and where they part."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from cosim.results import comparison
from cosim.results.comparison import Comparison
from cosim.results.formatting import format_change, format_value
from cosim.results.metrics import for_json
from cosim.study.text_tables import TextTable
from cosim.terminal import study_display
from cosim.terminal.exits import DIFFERENT, DONE
from cosim.terminal.screen import say


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("first", type=Path, metavar="A.nc", help="a result")
    parser.add_argument("second", type=Path, metavar="B.nc", help="the result that it is compared with")
    help_ = "relative to a signal's largest value (default: 1e-6)"
    parser.add_argument("--tolerance", type=_tolerance, default=1e-6, metavar="X", help=help_)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def run(options: argparse.Namespace) -> int:
    """Print metrics with their differences, and where the results part. 1 where they differ beyond the tolerance."""
    result = comparison.compare(options.first, options.second, options.tolerance)
    if options.json:
        content: dict[str, Any] = {
            "same": result.same,
            "agree": result.agrees,
            "status": [ending.status for ending in result.endings],
            "message": [ending.message for ending in result.endings],
            "parted": result.parted and vars(result.parted),
            "beyond": result.beyond and vars(result.beyond),
            "metrics": list(result.metrics),
            "only": list(result.only),
            "shapes": result.shapes,
            "units": result.units,
            "types": result.types,
            "ends": result.ends,
            "figures": result.figures,
        }
        print(json.dumps(for_json(content), ensure_ascii=False))
        return _exit_code(result)
    study_display.show(_metrics(result))
    print()
    for line in comparison.lines(result, options.tolerance):
        say(line)
    return _exit_code(result)


def _exit_code(result: Comparison) -> int:
    return DONE if result.agrees else DIFFERENT


def _tolerance(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise ValueError(text)
    return value


def _metrics(result: Comparison) -> TextTable:
    """The metrics of both, and what changed from the first to the second."""
    first, second = result.metrics
    rows = []
    for name in dict.fromkeys((*first, *second)):
        values = [format_value(metrics[name]) if name in metrics else "" for metrics in result.metrics]
        change = format_change(second[name], first, name) if name in first and name in second else ""
        rows.append([name, *values, change])
    stems = [path.stem for path in result.paths]
    names = stems if stems[0] != stems[1] else map(str, result.paths)
    return TextTable("", ["metric", *names, "change"], rows)
