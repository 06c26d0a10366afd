"""Steps that are repeated or shortened: orders as theory has them, tolerances, and both engines alike."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.engine import run
from cosim.errors import DiagramErrors
from cosim.results.result_file import open_result

BLOCKS = '''
import math
from cosim import Block, Input, Output, Parameter, State


class Tied(Block):
    """dx/dt = r (u - x) - s x"""

    u = Input()
    r = Parameter(default=1.0)
    s = Parameter(default=0.0)
    x = State(output=True)

    def derivatives(u, r, s, x, d_x):
        d_x[0] = r * (u - x) - s * x


class Mass(Block):
    """A mass that a spring ties to another: m dv/dt = k_12 (X - x) - k x"""

    X = Input()
    m = Parameter(default=1.0)
    k = Parameter(default=1.0)
    k_12 = Parameter(default=5.0)
    x = State(output=True)
    v = State(output=True)

    def derivatives(X, m, k, k_12, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = (k_12 * (X - x) - k * x) / m


class Controller(Block):
    """-k y, which a sampled controller holds."""

    y = Input()
    k = Parameter(default=2.0)
    u = Output()

    def outputs(y, k, u):
        u[0] = -k * y


class Sum(Block):
    a = Input()
    b = Input()
    y = Output()

    def outputs(a, b, y):
        y[0] = a + b


class Root(Block):
    """dx/dt = sqrt(u) - x, of an input that may not be extrapolated below zero."""

    u = Input()
    x = State(output=True)

    def derivatives(u, x, d_x):
        if u < 0.0:
            raise ValueError("the level is negative")
        d_x[0] = math.sqrt(u) - x
'''
MASSES = """
run: {stop: 4, step: 0.02, integrator: rk4, inner_steps: 4}
blocks:
  a: {own:Mass, start: {x: 1}, inputs: {X: b.x}}
  b: {own:Mass, parameters: {m: 2, k: 3}, inputs: {X: a.x}}
record: {signals: [a.x]}
"""
TRANSIENT = """
run:
  {stop: 10, step: 0.5, integrator: rk4, inner_steps: 4, method: iterated, extrapolation: 2,
   coupling_tolerance: 1.0e-3, smallest_step: 1.0e-5}
blocks:
  a: {own:Tied, parameters: {r: 100}, start: {x: 1}, inputs: {u: b.x}}
  b: {own:Tied, parameters: {r: 50, s: 0.3}, start: {x: -1}, inputs: {u: a.x}}
record: {period: 0.5, signals: [a.x]}
"""


@pytest.fixture
def wired(tmp_path):
    (tmp_path / "own.py").write_text(BLOCKS)

    def wire(text, *settings):
        path = tmp_path / "d.yaml"
        path.write_text(text.replace("own:", "python: own.py:"))
        return run.load(path, settings)

    return wire


@pytest.fixture
def ran(wired, tmp_path):
    """The outcome of a run, and its times and one recorded signal."""

    def go(text, *settings, engine="native", signal="a.x"):
        output = tmp_path / f"{engine}.nc"
        outcome = run.Run(wired(text, *settings), engine, output).execute()
        assert outcome.status == "completed", outcome.error
        with open_result(output) as result:
            return outcome, result.times, result[signal]

    return go


def masses(times):
    matrix = np.array([[0, 1, 0, 0], [-6, 0, 5, 0], [0, 0, 0, 1], [2.5, 0, -4, 0]])
    return np.array([(expm(matrix * t) @ [1, 0, 0, 0])[0] for t in times])


def transient(times):
    return np.array([(expm(np.array([[-100, 100], [50, -50.3]]) * t) @ [1, -1])[0] for t in times])


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("method", "extrapolation", "order"),
    [("iterated", 0, 2), ("iterated", 1, 3), ("jacobi", 2, 3), ("gauss-seidel", 2, 3)],
)
def test_a_repeated_step_is_of_one_order_more(ran, method, extrapolation, order, engine):
    """Quadratic extrapolation is of order 3 as its first step, which has nothing to extrapolate from, is repeated."""
    errors = []
    for step in (0.02, 0.01, 0.005):
        settings = f"run.step={step}", f"run.method={method}", f"run.extrapolation={extrapolation}"
        _, times, x = ran(MASSES, *settings, engine=engine)
        errors.append(np.abs(x - masses(times)).max())
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders == pytest.approx([order] * 2, abs=0.15), errors


def test_a_transient_takes_a_fifth_of_the_steps(ran):
    """At the same error as with fixed steps, whose error goes with the third power of their size."""
    outcome, times, x = ran(TRANSIENT)
    error = np.abs(x - transient(times)).max()
    fixed = "run.coupling_tolerance=~", "run.smallest_step=~", "run.step=0.005"
    plain, times, x = ran(TRANSIENT, *fixed)
    steps = plain.steps * (np.abs(x - transient(times)).max() / error) ** (1 / 3)
    tried = outcome.steps + outcome.stepping.rejected
    assert 5 * tried < steps and error < 2e-3
    assert outcome.stepping.longest > 1000 * outcome.stepping.shortest and plain.stepping is None


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_the_error_follows_the_tolerance(ran, method):
    """Inputs are wrong by the tolerance at most, which the slow mode adds up at 100/3 a second for two seconds."""
    errors = []
    for tolerance in (1e-4, 1e-5, 1e-6):
        settings = f"run.coupling_tolerance={tolerance}", f"run.method={method}", "run.smallest_step=1e-7"
        _, times, x = ran(TRANSIENT, *settings, "run.stop=2", "run.extrapolation=1")
        errors.append(np.abs(x - transient(times)).max())
        assert errors[-1] < 67 * tolerance
    assert errors[2] < errors[0] / 10


CHAIN = """
run: {stop: 4, step: 0.5, integrator: rk4, inner_steps: 20, smallest_step: 1.0e-5}
blocks:
  a: {own:Mass, parameters: {k: 4, k_12: 0}, start: {x: 1}, inputs: {X: 0}}
  b: {block: Integrator, inputs: {u: a.x}}
record: {signals: [b.x]}
"""


@pytest.mark.parametrize("extrapolation", [0, 1, 2])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_inputs_of_a_chain_keep_the_tolerance_too(ran, method, extrapolation):
    """x' = cos 2 t, whose largest value is 1: an input that is off by the tolerance adds up to four times it in 4 s.

    Under Gauss-Seidel a value at a step's end is known before it is read, but not what was between.
    """
    for tolerance in (1e-2, 1e-3):
        settings = f"run.method={method}", f"run.extrapolation={extrapolation}", f"run.coupling_tolerance={tolerance}"
        _, times, x = ran(CHAIN, *settings, signal="b.x")
        assert np.abs(x - np.sin(2.0 * times) / 2.0).max() < 4.0 * tolerance


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_both_engines_try_the_same_steps(ran, method):
    settings = f"run.method={method}", "run.stop=2"
    (one, _, x), (two, _, y) = ran(TRANSIENT, *settings), ran(TRANSIENT, *settings, engine="python")
    assert np.array_equal(x, y) and (one.steps, one.stepping) == (two.steps, two.stepping)


def test_without_rollback_only_the_next_step_is_shorter(ran):
    outcome, times, x = ran(TRANSIENT, "run.rollback=false", "run.method=jacobi", "run.extrapolation=1", "run.stop=2")
    assert outcome.stepping.rejected == 0 and outcome.stepping.coarse > 0
    assert np.abs(x - transient(times)).max() < 0.05
    assert any("steps miss run.coupling_tolerance" in warning.message for warning in outcome.warnings)


def test_a_wire_that_jumps_begins_anew(ran):
    """Of order 2 in spite of a sampled controller, beside the joint solution of a hundredth of the step."""
    text = """
    run: {stop: 2, step: 0.02, integrator: rk4, inner_steps: 2, extrapolation: 1}
    blocks:
      a: {own:Tied, start: {x: 1}, inputs: {u: sum.y}}
      b: {own:Tied, parameters: {r: 3}, inputs: {u: a.x}}
      sum: {own:Sum, inputs: {a: b.x, b: held.u}}
      held: {own:Controller, inputs: {y: a.x}, period: 0.1}
    record: {period: 0.1, signals: [a.x]}
    """
    _, _, exact = ran(text, "run.method=joint", "run.extrapolation=0", "run.step=0.0005")
    errors = []
    for step in (0.02, 0.01, 0.005):
        _, _, x = ran(text, f"run.step={step}")
        errors.append(np.abs(x - exact).max())
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders == pytest.approx([2, 2], abs=0.2), errors


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_block_that_fails_at_a_trial_value_is_tried_with_a_shorter_step(ran, engine):
    """dx/dt = exp(-5 t) - x, x(0) = 1: x = exp(-t) + (exp(-t) - exp(-5 t)) / 4."""
    text = """
    run: {stop: 2, step: 0.5, integrator: rk4, inner_steps: 2, extrapolation: 1, coupling_tolerance: 0.3}
    blocks:
      a: {own:Root, start: {x: 1}, inputs: {u: b.x}}
      b: {own:Tied, parameters: {r: 0, s: 10}, start: {x: 1}, inputs: {u: a.x}}
    record: {period: 0.5, signals: [a.x]}
    """
    with pytest.raises(AssertionError, match="the level is negative"):
        ran(text.replace(", coupling_tolerance: 0.3", "").replace("step: 0.5", "step: 0.25"))
    outcome, _, x = ran(text, engine=engine)
    assert outcome.stepping.rejected > 0
    assert x[-1] == pytest.approx(math.exp(-2) + (math.exp(-2) - math.exp(-10)) / 4, abs=0.02)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["run.smallest_step=0.001"], "`run.smallest_step` goes with `run.coupling_tolerance`"),
        (["run.smallest_step=1", "run.coupling_tolerance=0.01"], "is more than run.step of 0.02 s"),
        (["run.smallest_step=1e-16", "run.coupling_tolerance=0.01"], "is too small to be counted up to 4 s"),
        (["run.method=joint", "run.coupling_tolerance=0.01"], "has nothing to judge under `joint`"),
        (["run.coupling_tolerance=0"], "above zero"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(wired, settings, said):
    with pytest.raises(DiagramErrors, match=said):
        wired(MASSES, *settings)
