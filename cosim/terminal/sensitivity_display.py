"""`cosim sensitivity`: runs a study's draws as Sobol indices need them, and shows these."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from cosim.errors import MetricError, MissingKey, Position, WrongValue, nearest
from cosim.results.metrics import for_json
from cosim.results.text_table import TextTable
from cosim.search.evaluator import Evaluator
from cosim.search.sensitivity import CONFIDENCE, Sensitivity, Share, sensitivities
from cosim.study.counter import Counter
from cosim.study.definition import Random, Study
from cosim.terminal import screen, searched, study_display
from cosim.terminal.exits import DONE
from cosim.wiring.network import Network

RUNS = 1024


def show(options: argparse.Namespace) -> int:
    """Run, and print a table for each metric."""
    study = searched.load(options)
    space = _space(study)
    folder = options.results / options.study.stem / "sensitivity"
    evaluator = Evaluator(study, space, folder, options.threads, options.set)
    metrics = _metrics(evaluator, options.metric)
    seed = space.seed if options.seed is None else options.seed
    with Counter() as counter:
        try:
            with evaluator.at_work():
                found = sensitivities(evaluator, metrics, options.runs or RUNS, seed, counter.update)
        except KeyboardInterrupt:
            kept = "all runs are kept, and the same command goes on from there"
            print(f"came as far as {counter.done} of {counter.total} runs; {kept}", file=sys.stderr)
            raise
    if options.json:
        content = {"study": str(options.study), "runs": evaluator.done, "indices": [asdict(one) for one in found]}
        print(json.dumps(for_json(content), ensure_ascii=False))
        return DONE
    for metric in metrics:
        study_display.show(_table(metric, [one for one in found if one.metric == metric]))
    screen.say(f"shares of the variance over {evaluator.done} runs, with {100 * CONFIDENCE:g} % intervals")
    return DONE


def _space(study: Study) -> Random:
    """The study's draws. Raises: MissingKey, WrongValue where they depend on each other."""
    if study.random is None:
        fix = "write random: {count: 1, draws: {blocks.plant.parameters.mass: {uniform: [1, 2]}}}"
        raise MissingKey(f"the study {study.path} has no `random`", None, fix)
    if study.random.accept:
        message = "values of which only some are accepted depend on each other, and have no shares of their own"
        raise WrongValue(message, study.random.accept[0].node.place, "remove `random.accept`")
    return study.random


def _metrics(evaluator: Evaluator, wanted: list[str]) -> list[str]:
    """The figures that are numbers, or those that are wanted. Raises: MetricError."""
    network = evaluator.variants.base(evaluator.variant)
    known = [name for name, made in network.diagram.figures.items() if made != "events" and not _is_list(network, name)]
    for name in wanted:
        if name not in known:
            fix = nearest(name, known) or "a metric that is a number"
            raise MetricError(f"there is no metric `{name}` that is a number", Position(f"--metric {name}"), fix)
    if not known:
        raise MetricError("the diagram has no metric that is a number", None, "define one below `metrics:`")
    return wanted or known


def _is_list(network: Network, name: str) -> bool:
    metric = network.diagram.metrics.get(name)
    return metric is not None and metric.reduce == "final" and network.shape(network.reduced[name]) != ()


def _table(metric: str, found: list[Sensitivity]) -> TextTable:
    ranked = sorted(found, key=lambda one: -one.total.value)
    rows = [[one.name, *_cells(one.first), *_cells(one.total)] for one in ranked]
    return TextTable(metric, ["drawn", "alone", "", "in all", ""], rows)


def _cells(share: Share) -> list[str]:
    return [f"{share.value:.3f}", f"{share.low:.3f} … {share.high:.3f}"]
