"""Periods, offsets and ticks: what is due when, against schedules written by hand as exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from cosim.engine.run import Run, load
from cosim.errors import DiagramErrors
from cosim.wiring.clocks import Clock, common, exact, schedule

BLOCKS = '''
from cosim import Block, Input, Output, State


class Count(Block):
    """How often it has been due before, when it last was, and its period."""

    n = State(output=True, dtype=int, start=0)
    last = State(output=True, start=-1.0)
    own = Output()

    def outputs(period, own):
        own[0] = period

    def update(n, time, next_n, next_last):
        next_n[0] = n + 1
        next_last[0] = time


class Ramp(Block):
    y = Output()

    def outputs(time, y):
        y[0] = time


class Pass(Block):
    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = u


class Asking(Block):
    y = Output()

    def outputs(period, y):
        y[0] = period


class Lag(Block):
    """dx/dt = u - x, through an output that its derivative reads."""

    u = Input()
    x = State(output=True)
    e = Output()

    def outputs(u, x, e):
        e[0] = u - x

    def derivatives(e, d_x):
        d_x[0] = e
'''


@pytest.fixture
def wired(tmp_path):
    """Wire a diagram of these blocks, whose types are written `own:Name`."""
    (tmp_path / "own.py").write_text(BLOCKS)

    def wire(text, *settings):
        path = tmp_path / "d.yaml"
        path.write_text(text.replace("own:", "python: own.py:"))
        return load(path, settings)

    return wire


@pytest.fixture
def columns(wired, tmp_path):
    """The recorded signals of a run, by name."""

    def run(text, *settings, engine="native"):
        from cosim.results.result_file import open_result

        output = tmp_path / f"{engine}.nc"
        outcome = Run(wired(text, *settings), engine, output).execute()
        assert outcome.status == "completed", outcome.error
        with open_result(output) as result:
            return outcome, {name: result[name] for name in result.signals}

    return run


@pytest.mark.parametrize(
    ("time", "fraction"),
    [
        (0.001, Fraction(1, 1000)),
        (1 / 3, Fraction(1, 3)),
        (0.1, Fraction(1, 10)),
        (7.3e-5, Fraction(73, 1_000_000)),
        (2.5, Fraction(5, 2)),
        (1e-12, Fraction(1, 10**12)),
    ],
)
def test_a_number_stands_for_its_simplest_fraction(time, fraction):
    assert exact(time) == fraction and float(fraction) == time


def test_a_multiple_of_the_step_up_to_rounding_is_one():
    assert exact(0.1 + 0.2, 0.1) == Fraction(3, 10)


def test_the_tick_is_the_largest_common_measure():
    assert common([Fraction(1, 1000), Fraction(3, 1000), Fraction(1, 3)]) == Fraction(1, 3000)
    several = schedule(0.001, [Clock(Fraction(1, 3)), None, Clock(Fraction(3, 1000), Fraction(1, 2000))])
    assert (several.tick, several.grid) == (Fraction(1, 6000), 6)
    assert schedule(0.001, [Clock(Fraction(1, 100))]).grid == 1  # a step that divides all periods is the tick


CLOCKS = {"a": ("1", 0), "b": ("2", 0), "c": ("3", "1/2"), "d": ("1000/3", 0)}
"""Periods and offsets in ms."""
MANY = """
run: {stop: 2, step: 0.001}
blocks:
  a: {own:Count, period: 0.001}
  b: {own:Count, period: 0.002}
  c: {own:Count, period: 0.003, offset: 0.0005}
  d: {own:Count, period: 1/3}
record: {signals: [a.n, b.n, c.n, d.n, a.last, b.last, c.last, d.last, d.own]}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_blocks_of_several_rates_keep_the_schedule_written_by_hand(columns, method, engine):
    outcome, got = columns(MANY, f"run.method={method}", "run.stop=1", engine=engine)
    points = {Fraction(k, 1000) for k in range(1001)}
    for name, (period, offset) in CLOCKS.items():
        every, first = Fraction(period) / 1000, Fraction(offset) / 1000
        due = [first + k * every for k in range(int((1 - first) / every) + 1)]
        points |= {*due}
        for k in range(1001):
            before = sum(time <= Fraction(k, 1000) for time in due)
            before = max(0, before - 1)  # what is computed at one sample is published at the next
            assert got[f"{name}.n"][k] == before, (name, k)
            wanted = float(due[before - 1]) if before else -1.0
            assert got[f"{name}.last"][k] == pytest.approx(wanted, rel=1e-15), (name, k)
    assert (got["d.own"] == 1 / 3).all()
    assert outcome.steps == len(points) - 1


HELD = """
run: {stop: 1, step: 0.01}
blocks:
  ramp: {own:Ramp}
  held: {own:Pass, inputs: {u: ramp.y}, period: 0.05, offset: 0.02}
  lag: {own:Lag, inputs: {u: ramp.y}, period: 0.1}
  behind: {own:Pass, inputs: {u: lag.x}}
record: {signals: [held.y, lag.x, lag.e, behind.y]}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_any_block_may_be_sampled_and_holds_its_outputs(columns, method, engine):
    """What goes on in it sees its inputs as they were at the last sample: dx/dt = u_k - x, by Euler's method."""
    _, got = columns(HELD, f"run.method={method}", engine=engine)
    x = sampled = 0.0
    for k in range(101):
        time = k * 0.01
        if k % 10 == 0:
            sampled, published, error = time, x, time - x
        due = (k - 2) // 5 * 5 + 2
        assert got["held.y"][k] == pytest.approx(max(due, 0) * 0.01, rel=1e-14), k
        assert got["lag.x"][k] == pytest.approx(published, rel=1e-13), k
        assert got["lag.e"][k] == pytest.approx(error, rel=1e-13), k
        assert got["behind.y"][k] == got["lag.x"][k]
        x += 0.01 * (sampled - x)


def test_inner_steps_of_a_sampled_block_see_its_held_inputs(columns):
    """x(t + T) = u + (x - u) exp(-T), to the order of the integrator, with a communication step of a tenth of T."""
    _, got = columns(HELD, "run.integrator=rk4")
    x = 0.0
    for k in range(1, 11):
        u = (k - 1) * 0.1
        x = u + (x - u) * np.exp(-0.1)
        assert got["lag.x"][10 * k] == pytest.approx(x, abs=1e-10), k


def test_the_papers_controller_is_sampled_by_one_line(formation, trajectories):
    network = load(formation, ["run.stop=0.2", "blocks.controller.period=0.01"])
    got = trajectories(network, "controller.u")["controller.u"]
    changes = np.flatnonzero((np.diff(got, axis=0) != 0).any(axis=(1, 2))) + 1
    assert set(changes) <= set(range(0, 201, 10)) and len(changes) > 10


def test_a_block_that_asks_for_its_period_needs_one(wired):
    with pytest.raises(DiagramErrors, match="block a: Count is sampled, and has no `period`"):
        wired("run: {stop: 1, step: 0.1}\nblocks:\n  a: {own:Count}\n")
    with pytest.raises(DiagramErrors, match="block a: Asking asks for its `period`, and has no `period`"):
        wired("run: {stop: 1, step: 0.1}\nblocks:\n  a: {own:Asking}\n")
