"""A program's modules are compiled by several processes side by side; whatever becomes of those, all is as by one."""

import os
import signal

import pytest

from cosim.compiling import compiler
from cosim.engine import compilation, loop_code, program
from cosim.errors import DiagramErrors
from cosim.machine import cache, parallel, siblings, supervision

SIGNALS = ("lag.x", "filter.y", "counter.held", "probe.x")
DIAGRAM = """
run: {stop: 1, step: 0.01, integrator: rk4}
fleets: {robot: 9}
blocks:
  source: {type: Sine, per: robot, parameters: {f: "i / 3"}}
  lag: {type: Lag, per: robot, inputs: {u: source.y}}
  filter: {type: Lag, per: robot, inputs: {u: lag.y}}
  counter: {type: Counter, period: 0.03, inputs: {u: probe.x}}
  probe: {type: Oscillator}
"""
WRONG = """
import math

from cosim import Block, Input, Output


class Root(Block):
    \"\"\"What the compiler lacks.\"\"\"
    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = math.sqrt(u, 2)


class Sine(Root):
    \"\"\"The same, of another function.\"\"\"

    def outputs(u, y):
        y[0] = math.sin(u, 2)
"""


def built(network):
    return program.build(network, network.diagram.run.method)


@pytest.fixture
def begun(monkeypatch):
    """The processes that have been forked; there are two processors."""
    processes, fork = [], supervision.forked

    def noted(work):
        processes.append(fork(work))
        return processes[-1]

    monkeypatch.setattr(supervision, "forked", noted)
    monkeypatch.setattr(parallel, "processors", lambda: 2)
    return processes


def test_two_processes_compile_the_same_bits_as_one(
    wired, trajectories, new_cache, monkeypatch, tmp_path, begun, loop_entry
):
    network = wired(DIAGRAM)
    by_two = trajectories(network, *SIGNALS)
    assert len(begun) == 1
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "another"))
    cache.write(*loop_entry)
    monkeypatch.setattr(parallel, "processors", lambda: 1)
    by_one = trajectories(network, *SIGNALS)
    assert len(begun) == 1
    for name in SIGNALS:
        assert by_two[name].tobytes() == by_one[name].tobytes(), name
    assert {f.name for f in new_cache.iterdir()} == {f.name for f in (tmp_path / "another").iterdir()}


def test_what_another_process_compiled_counts_as_compiled_and_takes_its_time(wired, new_cache, begun):
    table = built(wired(DIAGRAM))
    first = compilation.compile_program(table)
    assert len(begun) == 1
    modules = {module.key: module for module in first.modules.values()}
    assert first.compiled == len(modules) == 4  # of the two lags one
    assert all(module.seconds > 0 for module in modules.values())
    assert not first.loop.compiled_now
    again = compilation.compile_program(table)
    assert again.compiled == 0 and len(begun) == 1
    assert {module.code for module in again.modules.values()} == {module.code for module in modules.values()}


def test_a_process_that_is_killed_leaves_its_part_to_this_one(wired, new_cache, begun, monkeypatch, caplog):
    parent, compile_object = os.getpid(), compiler.compile_object

    def deadly(*what):
        if os.getpid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)
        return compile_object(*what)

    monkeypatch.setattr(compiler, "compile_object", deadly)
    kernels = compilation.compile_program(built(wired(DIAGRAM)))
    assert kernels.compiled == 4 and len(begun) == 1
    assert "a process beside this one has ended" in caplog.text


def test_mistakes_in_two_blocks_are_told_as_by_one_process(wired, new_cache, begun, monkeypatch, tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    text = DIAGRAM + "  b: {python: wrong.py:Sine, inputs: {u: probe.x}}\n"
    text += "  a: {python: wrong.py:Root, inputs: {u: probe.x}}\n"
    table, told = built(wired(text)), []
    for processors in (1, 2):
        monkeypatch.setattr(parallel, "processors", lambda count=processors: count)
        with pytest.raises(DiagramErrors) as caught:
            compilation.compile_program(table)
        told.append([(type(one), str(one)) for one in caught.value.each])
    assert told[0] == told[1]
    assert ["block a" in text for _, text in told[0]] == [True, False]
    assert ["block b" in text for _, text in told[0]] == [False, True]


@pytest.mark.parametrize("why", ["one processor", "no cache", "no fork"])
def test_without_another_process_all_is_compiled_here(wired, new_cache, begun, monkeypatch, tmp_path, why):
    allowed = os.sched_getaffinity(0)
    if why == "one processor":
        monkeypatch.undo()
        monkeypatch.setenv("COSIM_CACHE", str(new_cache))
        os.sched_setaffinity(0, {min(allowed)})
    elif why == "no fork":
        monkeypatch.setattr(supervision, "AVAILABLE", False)
    else:
        (tmp_path / "file").write_text("no folder")
        monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "file"))
        monkeypatch.setattr(loop_code, "_FUNCTIONS", (short,))
    monkeypatch.setattr(siblings, "shared_out", None)
    try:
        kernels = compilation.compile_program(built(wired(DIAGRAM)))
    finally:
        os.sched_setaffinity(0, allowed)
    assert kernels.compiled == 4 + (why == "no cache")


def short(time: float, base: int, frame: int) -> int:
    """A loop that is soon compiled."""
    return 7
