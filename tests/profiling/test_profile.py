"""What a run's time goes to: whose is the largest part, how often each is called, and that the parts are the whole."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.engine.run import Run, load
from cosim.engine.simulation import Simulation
from cosim.profiling.profile import REST, profile
from cosim.profiling.timed_rows import TimedRows
from cosim.results.result_file import open_result
from tests.fmu import machine
from tests.fmu.machine import Model
from tests.fmu.test_input_derivatives import FLAGS, NATIVE, TEXT, VARIABLES

SMOOTH = Path(machine.__file__).with_name("smooth.c")
BLOCKS = """
import math
from cosim import Block, Indicator, Input, Output, State


class Heavy(Block):
    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = 0.0
        for k in range(1000):
            y[0] += math.sin(u + k)


class Lag(Block):
    u = Input()
    x = State(output=True, start=1.0)

    def derivatives(u, x, d_x):
        d_x[0] = u - x


class Held(Block):
    u = Input()
    n = State(output=True)

    def update(u, n, next_n):
        next_n[0] = n + u


class Ball(Block):
    h = State(output=True, start=1.0)
    v = State(output=True)
    ground = Indicator(crossing="falling")

    def derivatives(v, d_h, d_v):
        d_h[0] = v
        d_v[0] = -9.81

    def indicators(h, ground):
        ground[0] = h

    def event(ground, v, next_v):
        if ground < 0:
            next_v[0] = -0.5 * v


class Slow(Block, compiled=False):
    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = sum(u for _ in range(100))
"""
RING = """
run: {{stop: 1, step: 0.01, method: {method}, integrator: {integrator}}}
blocks:
  heavy: {{python: own.py:Heavy, inputs: {{u: second.x}}}}
  first: {{python: own.py:Lag, inputs: {{u: heavy.y}}}}
  second: {{python: own.py:Lag, inputs: {{u: first.x}}}}
  held: {{python: own.py:Held, inputs: {{u: first.x}}, period: 0.1}}
record: {{signals: [first.x, second.x, held.n]}}
metrics: {{top: {{signal: first.x, reduce: max}}}}
requirements: {{low: always(held.n < 1e9)}}
"""


@pytest.fixture
def profiled(write, tmp_path):
    """A function that runs a diagram, which it profiles; gives the run, its outcome, and costs by name and function."""
    write(BLOCKS, "own.py")

    def make(text, swaps=()):
        run = Run(load(write(text), swaps=swaps), output=tmp_path / "out.nc")
        outcome = run.execute()
        assert outcome.status == "completed", outcome.error
        found = profile(run)
        assert sum(cost.share for cost in found.costs) == pytest.approx(1.0, abs=1e-12)
        assert sum(cost.microseconds for cost in found.costs) == pytest.approx(found.microseconds, rel=1e-12)
        return run, outcome, {(cost.name, cost.function): cost for cost in found.costs}

    return make


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize(("integrator", "stages"), [("euler", 1), ("rk4", 4)])
def test_a_block_of_a_thousand_sines_is_the_largest_part(profiled, method, integrator, stages):
    """Under `joint` every stage asks for its output; the others hold it over the step."""
    _, _, costs = profiled(RING.format(method=method, integrator=integrator))
    heavy = costs["heavy", "outputs"]
    assert heavy.microseconds > sum(c.microseconds for c in costs.values() if c.function and c != heavy)
    points = 101 / 100  # the last communication point is evaluated too, and no step follows
    assert costs["held", "update"].calls == pytest.approx(0.1)  # from 0 to 0.9 s
    assert costs["first", "derivatives"].calls == stages
    more = stages - 1 if method == "joint" else 0
    if method != "gauss-seidel":
        assert heavy.calls == pytest.approx(points + more)
    assert {"integration", "metrics and conditions", "requirements", "recording", REST} <= {
        name.partition(" of ")[0] for name, _ in costs
    }


def test_a_run_that_was_profiled_has_the_same_bits(profiled, tmp_path):
    """Before the profile, beside it, and after: the timed rows compute what the program's do."""
    text = RING.format(method="gauss-seidel", integrator="rk4, extrapolation: 1")
    run, outcome, _ = profiled(text)
    rows = TimedRows(run.simulation.program)
    timed = Simulation(run.simulation.program, run.simulation.kernels, run.simulation.probes, rows.walked)
    timed.initialize()
    seen = [{s: values.copy() for s, values in recorded.values.items()} for _, recorded in timed.batches()]
    with open_result(tmp_path / "out.nc") as result:
        for signal in run.network.recorded:
            samples = np.concatenate([batch[signal] for batch in seen])
            np.testing.assert_array_equal(samples, result[str(signal)])
    assert timed.steps == outcome.steps


def test_events_loops_and_python_are_told(profiled):
    """The ball falls for 0.45 s, and each flight takes half as long as the one before: it bounces three times."""
    run, _, costs = profiled("""
    run: {stop: 1.2, step: 0.01}
    blocks:
      ball: {python: own.py:Ball}
      slow: {python: own.py:Slow, inputs: {u: ball.h}}
      wave: {expression: cos(u), inputs: {u: half.y}}
      half: {expression: 0.5*u + h, inputs: {u: wave.y, h: ball.h}}
    """)
    assert costs["ball", "event"].calls * run.simulation.steps == pytest.approx(3.0)
    assert costs["keeping steps", ""].calls >= 1.0 and costs["ball", "indicators"].calls >= 1.0
    assert max(cost.calls for (name, _), cost in costs.items() if name in ("wave", "half")) > 2.0  # looks at each point
    assert costs["slow", "outputs"].microseconds > costs["ball", "derivatives"].microseconds  # of a hundred numbers


@pytest.mark.parametrize("isolate", ["", ", isolate: true"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_a_step_of_an_fmu_is_told(profiled, tmp_path, method, isolate):
    (tmp_path / "integral.py").write_text(NATIVE)
    fmu = machine.pack(tmp_path / "fmu", 2, Model("smooth", VARIABLES), SMOOTH, "cs", FLAGS)
    text = TEXT.format(step=0.1, method=method, order=0, fmu=fmu, more=isolate).replace("own.py", "integral.py")
    _, _, costs = profiled(text)
    assert costs["follower", "step"].calls == (2 if method == "iterated" else 1)
    assert costs["follower", "step"].microseconds > 0.0


def test_other_ways_of_integration(profiled):
    """A tolerance takes as many derivatives as it needs; scipy's own is the integration's."""
    _, _, costs = profiled(RING.format(method="joint", integrator="rk45, tolerance: 1.0e-6"))
    assert costs["first", "derivatives"].calls > 6.0 and costs["integration", ""].calls == 1
    _, _, costs = profiled(RING.format(method="joint", integrator="rodas4"))
    assert costs["integration", ""].calls == 1 and costs["first", "derivatives"].calls > 6.0


def test_what_was_compiled_and_what_was_found(write, new_cache):
    write(BLOCKS, "own.py")
    for cached in (False, True):
        run = Run(load(write("run: {stop: 1, step: 0.1}\nblocks: {slow: {python: own.py:Lag, start: {u: 1}}}")))
        run.execute()
        (lag,) = [module for module in profile(run).compiled if module.name == "Lag"]
        assert lag.cached is cached and (lag.seconds > 0.0) is not cached


def test_the_command_prints_a_table_and_json(cosim, write, tmp_path):
    write(BLOCKS, "own.py")
    path = write(RING.format(method="joint", integrator="rk4"))
    plain = json.loads(cosim("run", path, "--json", "-o", "a.nc")[1])
    code, out, _ = cosim("run", path, "--profile", "-o", "b.nc")
    table = out[out.index("spent on") : out.index("100.0 %")].splitlines()
    assert code == 0 and max(map(len, table)) <= 80 and "start: reading" in out
    assert any(line.startswith("heavy, outputs ") for line in table) and table[-1].startswith("in all ")
    answer = json.loads(cosim("run", path, "--profile", "--json", "-o", "c.nc")[1])
    assert answer["metrics"] == plain["metrics"] and "profile" not in plain
    assert ["heavy", "outputs"] in [[cost["name"], cost["function"]] for cost in answer["profile"]["costs"]]
    assert {"reading", "wiring", "building", "compiling", "linking"} <= answer["profile"]["start"].keys()


def test_what_is_not_timed_is_refused(cosim, write, monkeypatch):
    write(BLOCKS, "own.py")
    path = write(RING.format(method="joint", integrator="rk4"))
    for option in ("--resume", "--engine=python"):
        code, _, err = cosim("run", path, "--profile", option)
        assert code == 2 and "--profile times compiled code" in err
    monkeypatch.delattr("time.CLOCK_MONOTONIC")
    code, out, err = cosim("run", path, "--profile")
    assert code == 0 and "no profile: this system has no clock" in err and "spent on" not in out
