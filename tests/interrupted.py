"""Runs that are killed and resumed, and what has to be the same of two runs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.engine.outcome import Outcome
from cosim.engine.run import Run
from cosim.master import tables
from cosim.results.metrics import for_json
from cosim.results.result_file import open_result
from cosim.wiring.network import Network

KILLED = 77
#: What the caller of the loop sets for each batch, and where the loop was last.
HANDED_OVER = (tables.LAST, tables.FINAL, tables.STOP, tables.FIRST_ROW, tables.END_ROW, tables.AT, tables.ALIVE)


def executed(
    network: Network,
    output: Path,
    every: str | None = None,
    resume: bool = False,
    engine: str = "native",
    watch: Callable[[float], None] = lambda time: None,
) -> tuple[Run, Outcome]:
    """A run, with checkpoints if `every` or `resume` asks for them."""
    one = Run(network, engine, output, checkpoint=every, resume=resume)
    return one, one.execute(watch)


def killed(network: Network, output: Path, at: float, **options) -> None:
    """A run that is killed before the batch that reaches a time (s) is looked at any further."""

    def watch(time: float) -> None:
        if time >= at:
            os._exit(KILLED)

    pid = os.fork()
    if pid == 0:
        try:
            executed(network, output, watch=watch, **options)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == KILLED


def assert_same(one: tuple[Run, Outcome], other: tuple[Run, Outcome]) -> None:
    """All that two runs computed, recorded and judged is the same, bit for bit."""
    (a, of_a), (b, of_b) = one, other
    assert of_a.status == of_b.status and of_a.steps == of_b.steps, (of_a.error, of_b.error)
    assert for_json(of_a.metrics) == for_json(of_b.metrics)
    assert of_a.events == of_b.events and of_a.verdicts == of_b.verdicts
    assert list(map(str, of_a.warnings)) == list(map(str, of_b.warnings))
    changing = a.simulation.program.layout.changing
    assert a.simulation.arena[:changing].tobytes() == b.simulation.arena[:changing].tobytes()
    words = [w for w in range(tables.CONTROL_WORDS) if w not in (*tables.ADDRESSES, *HANDED_OVER)]
    assert a.simulation.control[words].tolist() == b.simulation.control[words].tolist()
    assert_same_results(Path(a.output), Path(b.output))


def assert_same_results(one: Path, other: Path) -> None:
    """Two result files have the same rows, figures and verdicts."""
    with open_result(one) as a, open_result(other) as b:
        assert a.times.tobytes() == b.times.tobytes() and list(a.signals) == list(b.signals)
        for name in a.signals:
            assert a[name].tobytes() == b[name].tobytes(), name
        for name in ("status", "message", "metrics", "steps", "end", "conditions", "diagram", "reductions", "settings"):
            assert repr(a.attrs[name]) == repr(b.attrs[name]), name
        assert len(np.unique(a.times)) == len(a.times) > 1
