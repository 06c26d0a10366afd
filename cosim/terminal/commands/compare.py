"""`cosim compare`: results side by side, where they part, and what their diagrams say otherwise."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from cosim.results import comparison, diagram_differences, latex_tables, result_names
from cosim.results.comparison import Comparison
from cosim.results.diagram_differences import Difference
from cosim.results.metrics import for_json
from cosim.results.result_file import open_result
from cosim.results.verdicts import verdict
from cosim.terminal import comparing, requirement_display, study_display
from cosim.terminal.exits import DIFFERENT, DONE
from cosim.terminal.screen import say


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("first", type=Path, metavar="A.nc", help="a result")
    parser.add_argument("second", type=Path, metavar="B.nc", help="the result that it is compared with")
    parser.add_argument("more", type=Path, nargs="*", metavar="C.nc", help="more results, each compared with A.nc")
    help_ = "relative to a signal's largest value (default: 1e-6)"
    parser.add_argument("--tolerance", type=_tolerance, default=1e-6, metavar="X", help=help_)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    form.add_argument("--latex", action="store_true", help="print the metrics as a LaTeX table and nothing else")


def run(options: argparse.Namespace) -> int:
    """Print metrics with their differences, and where the results part. 1 where they differ beyond the tolerance."""
    paths = [options.first, options.second, *options.more]
    pairs = [comparison.compare(options.first, other, options.tolerance) for other in paths[1:]]
    names = result_names.names(paths)
    unread, found = _differences(paths, names)
    metrics = [pairs[0].metrics[0], *(pair.metrics[1] for pair in pairs)]
    judged = [pairs[0].requirements[0], *(pair.requirements[1] for pair in pairs)]
    if options.json:
        content = _pair(pairs[0]) if len(pairs) == 1 else _several(pairs)
        content["differences"] = {item.key: list(item.values) for item in found}
        print(json.dumps(for_json(content), ensure_ascii=False))
    elif options.latex:
        say(latex_tables.latex(comparing.metrics_table(names, metrics)))
    else:
        study_display.show(comparing.metrics_table(names, metrics))
        if any(judged):
            study_display.show(requirement_display.table(names, judged))
        print()
        comparing.show_differences([name for name in names if name not in unread], unread, found)
        print()
        if len(pairs) == 1:
            for line in comparison.lines(pairs[0], options.tolerance):
                say(line)
        else:
            comparing.show_verdicts(names, [verdict(pair, options.tolerance) for pair in pairs])
    return DONE if all(pair.agrees for pair in pairs) else DIFFERENT


def _differences(paths: list[Path], names: list[str]) -> tuple[list[str], list[Difference]]:
    """The results that do not say what diagram they come from, and what differs in those of the others."""
    diagrams = []
    for path in paths:
        with open_result(path) as result:
            diagrams.append(diagram_differences.read(result))
    unread = [name for name, one in zip(names, diagrams, strict=True) if one is None]
    return unread, diagram_differences.differences([one for one in diagrams if one is not None])


def _several(pairs: list[Comparison]) -> dict[str, Any]:
    return {
        "same": all(pair.same for pair in pairs),
        "agree": all(pair.agrees for pair in pairs),
        "results": [str(path) for path in (pairs[0].paths[0], *(pair.paths[1] for pair in pairs))],
        "comparisons": [_pair(pair) for pair in pairs],
    }


def _pair(result: Comparison) -> dict[str, Any]:
    return {
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
        "requirements": list(result.requirements),
        "verdicts": result.verdicts,
    }


def _tolerance(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise ValueError(text)
    return value
