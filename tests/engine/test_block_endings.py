"""A block ends the run where an indicator crosses zero that says so: against the closed form, with its last sample."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DeclarationError, DiagramErrors
from cosim.results.result_file import open_result
from cosim.terminal import cli

BLOCKS = '''
from cosim import Block, Indicator, Input, Parameter, State


class Stone(Block):
    """d2h/dt2 = -g, to the ground."""

    g = Parameter(default=9.81)
    h = State(output=True, start=1.0)
    v = State(output=True)
    ground = Indicator(crossing="falling", terminal=True)

    def derivatives(v, g, d_h, d_v):
        d_h[0] = v
        d_v[0] = -g

    def indicators(h, ground):
        ground[0] = h


class Ball(Block):
    """Bounces at the ground, and ends the run at the third bounce."""

    h = State(output=True, start=1.0)
    v = State(output=True)
    n = State(output=True, dtype=int, start=0)
    ground = Indicator(crossing="falling")
    enough = Indicator(crossing="rising", terminal=True)

    def derivatives(v, d_h, d_v):
        d_h[0] = v
        d_v[0] = -9.81

    def indicators(h, n, ground, enough):
        ground[0] = h
        enough[0] = n - 2.5

    def event(ground, v, n, next_v, next_n):
        if ground < 0:
            next_v[0] = -0.7 * v
            next_n[0] = n + 1


class Sum(Block):
    u = Input()
    x = State(output=True)

    def derivatives(u, d_x):
        d_x[0] = u
'''
STONE = """
run: {{stop: {stop}, step: {step}, method: {method}, integrator: heun}}
blocks:
  s: {{python: own.py:Stone}}
  way: {{python: own.py:Sum, inputs: {{u: s.v}}}}
record: {{period: {period}, signals: [s.h, s.v, way.x]}}
metrics: {{speed: {{signal: s.v, reduce: min}}, end: {{signal: s.h, reduce: final}}}}
"""
METHODS = ("jacobi", "gauss-seidel", "iterated", "joint")
FALL = math.sqrt(2 / 9.81)


@pytest.fixture
def written(tmp_path):
    (tmp_path / "own.py").write_text(BLOCKS)

    def write(text):
        path = tmp_path / "d.yaml"
        path.write_text(text)
        return path

    return write


def stone(method="jacobi", step=0.01, stop=2, period=None):
    return STONE.format(method=method, step=step, stop=stop, period=period or step)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("step", "every"), [(0.01, 1), (0.1, 1), (0.01, 10), (2.0, 1)])
def test_the_run_ends_at_the_crossing_with_its_sample(written, tmp_path, method, step, every, engine):
    """Heun's method is exact for a fall, so that the end is that of the closed form up to rounding."""
    path = written(stone(method, step, period=step * every))
    outcome = run.Run(run.load(path), engine, tmp_path / "d.nc").execute()
    assert outcome.status == "completed"
    assert outcome.time == pytest.approx(FALL, abs=1e-12)
    assert outcome.steps == math.ceil(FALL / step)
    assert outcome.reason == f"block s: `ground` ended the simulation at t = {FALL:.9g} s"
    with open_result(tmp_path / "d.nc") as result:
        assert result.times[-1] == outcome.time == result.attrs["end"]
        assert result.times[:-1] == pytest.approx(step * every * np.arange(math.ceil(FALL / (step * every))))
        assert result["s.h"] == pytest.approx(1 - 9.81 / 2 * result.times**2, abs=1e-12)
        assert result["s.v"] == pytest.approx(-9.81 * result.times, abs=1e-11)
        if method in ("iterated", "joint"):
            assert result["way.x"] == pytest.approx(-9.81 / 2 * result.times**2, abs=1e-11)
    assert outcome.metrics["speed"] == pytest.approx(-9.81 * FALL, abs=1e-11)
    assert outcome.metrics["end"] == pytest.approx(0, abs=1e-11)


def test_what_is_told(written, tmp_path, capfd):
    path = written(stone())
    assert cli.main(["run", str(path), "-o", str(tmp_path / "r.nc")]) == 0
    out = capfd.readouterr().out
    assert "completed after 46 steps" in out and "block s: `ground` ended the simulation at t = 0.451523641 s" in out
    assert cli.main(["run", str(path), "-o", str(tmp_path / "r.nc"), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["status"] == "completed" and told["time"] == pytest.approx(FALL, abs=1e-12)
    assert "`ground` ended the simulation" in told["ended"] and "warnings" not in told


@pytest.mark.parametrize("engine", ["native", "python"])
def test_the_first_of_a_fleet_ends_it_for_all(written, engine):
    text = """
run: {stop: 5, step: 0.1, integrator: heun}
fleets: {stone: 3}
blocks: {s: {python: own.py:Stone, per: stone, parameters: {g: [9.81, 19.62, 1.0]}}}
"""
    outcome = run.Run(run.load(written(text)), engine).execute()
    assert outcome.time == pytest.approx(math.sqrt(2 / 19.62), abs=1e-12)
    assert outcome.reason.startswith("block s: `ground` of stone 2 ended the simulation")


@pytest.mark.parametrize("engine", ["native", "python"])
def test_an_event_may_cause_the_end(written, engine):
    """The third bounce: 1 + 2 (0.7 + 0.49) times the first fall; what is reset there is in the last sample."""
    text = "run: {stop: 5, step: 0.05, integrator: heun}\nblocks: {b: {python: own.py:Ball}}\n"
    text += "metrics: {n: {signal: b.n, reduce: final}, v: {signal: b.v, reduce: final}}\n"
    outcome = run.Run(run.load(written(text)), engine).execute()
    assert outcome.status == "completed" and "`enough`" in outcome.reason
    assert outcome.time == pytest.approx(FALL * (1 + 2 * (0.7 + 0.49)), abs=1e-11)
    assert outcome.metrics["n"] == 3 and outcome.metrics["v"] == pytest.approx(9.81 * FALL * 0.7**3, abs=1e-9)


def test_what_is_not_reached_ends_nothing(written):
    outcome = run.Run(run.load(written(stone(stop=0.4)))).execute()
    assert (outcome.status, outcome.termination, outcome.time) == ("completed", None, pytest.approx(0.4))


def test_a_crossing_at_the_end_is_the_end(written):
    """Of the last step, at whose end all is as if nobody had ended the run."""
    text = stone(step=0.25, stop=0.5)
    outcome = run.Run(run.load(written(text), ["blocks.s.parameters.g=8"])).execute()  # sqrt(2 / 8) s is 0.5 s
    assert outcome.status == "completed" and outcome.time == pytest.approx(0.5, abs=1e-12)


def test_a_metric_beyond_the_end_is_no_figure(written):
    text = stone().replace("reduce: min", "reduce: min, from: 1, to: 2")
    outcome = run.Run(run.load(written(text))).execute()
    assert outcome.metrics.get("speed") is None or math.isnan(outcome.metrics["speed"])


def test_a_study_has_the_members_that_end_early(written, tmp_path):
    from cosim.study import running, study_file

    written(stone())
    (tmp_path / "s.yaml").write_text("{diagram: d.yaml, grid: {blocks.s.parameters.g: [9.81, 0.1]}}")
    rows = list(running.run(study_file.load(tmp_path / "s.yaml"), running.Options(tmp_path / "results")).rows())
    assert [row["status"] for row in rows] == ["completed", "completed"]
    assert "ended the simulation" in rows[0]["reason"] and not rows[1]["reason"]
    assert rows[0]["metrics"]["speed"] == pytest.approx(-9.81 * FALL, abs=1e-9)


def test_terminal_is_a_truth_value(tmp_path):
    (tmp_path / "own.py").write_text(BLOCKS.replace("terminal=True", 'terminal="yes"'))
    (tmp_path / "d.yaml").write_text(stone())
    with pytest.raises((DeclarationError, DiagramErrors), match="terminal"):
        run.load(tmp_path / "d.yaml")
