"""scipy's methods under `joint`: closed forms, events, samples, loops, and what they are refused for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.engine import run
from cosim.errors import BlockFailed, DiagramErrors, NotExportable, TooLarge, WrongValue
from cosim.export.exporter import export_fmu
from cosim.integrators import REFERENCES

FORMATION = Path(__file__).parents[2] / "diagrams" / "formation.yaml"
BLOCKS = """
import math
from cosim import Block, Indicator, Input, Output, Parameter, State

class Mass(Block):
    'm dv/dt = k_12 (X - x) - k x'
    X = Input()
    m = Parameter(default=1.0)
    k = Parameter(default=1.0)
    k_12 = Parameter(default=50.0)
    x = State(output=True)
    v = State(output=True)
    def derivatives(X, m, k, k_12, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = (k_12 * (X - x) - k * x) / m

class Fed(Block):
    'dx/dt = u'
    u = Input()
    x = State(output=True, start=1.0)
    def derivatives(u, d_x):
        d_x[0] = u

class Less(Block):
    'y = -a u + b z, at once'
    u = Input()
    z = Input()
    a = Parameter()
    b = Parameter()
    y = Output()
    def outputs(u, z, a, b, y):
        y[0] = b * z - a * u

class Ball(Block):
    h = State(output=True, start=1.0)
    v = State(output=True)
    n = State(output=True, start=0, dtype=int)
    ground = Indicator(crossing="falling")
    def derivatives(v, d_h, d_v):
        d_h[0] = v
        d_v[0] = -9.81
    def indicators(h, ground):
        ground[0] = h
    def event(ground, v, n, next_v, next_n):
        if ground < 0:
            next_v[0] = -0.7 * v
            next_n[0] = n + 1

class Pole(Block):
    'x = 1/(1 - t)'
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        d_x[0] = x * x

class Root(Block):
    'dx/dt = -sqrt(x) - 1 is no number below x = 0, which it reaches'
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        d_x[0] = -math.sqrt(x) - 1.0 if x >= 0.0 else math.nan

class Endless(Block):
    x = State(output=True)
    def derivatives(time, d_x):
        d_x[0] = 1.0
        if time > 0.05:
            raise ValueError("too late")

class Many(Block):
    x = State("n", output=True)
    def derivatives(x, d_x):
        for q in range(x.size):
            d_x[q] = -x[q]
"""
ENGINES = ("native", "python")
NAMES = [*REFERENCES]


@pytest.fixture
def load(tmp_path):
    """Wire a diagram of blocks of `BLOCKS` (`own: Ball`) under joint; `settings` of run."""

    def wired(blocks: str, settings: str, more: str = "", method: str = "joint"):
        (tmp_path / "own.py").write_text(BLOCKS)
        text = f"run: {{method: {method}, {settings}}}\n{more}blocks:\n{blocks}"
        (tmp_path / "d.yaml").write_text(text.replace("own: ", "python: own.py:"))
        return run.load(tmp_path / "d.yaml")

    return wired


MASSES = (
    "  a: {own: Mass, start: {x: 1}, inputs: {X: b.x}}\n  b: {own: Mass, parameters: {m: 2, k: 3}, inputs: {X: a.x}}\n"
)
MATRIX = np.array([[0, 1, 0, 0], [-51, 0, 50, 0], [0, 0, 0, 1], [25, 0, -26.5, 0]])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", NAMES)
def test_two_masses_are_those_of_the_matrix_exponential(load, trajectories, name, engine):
    """The last second of five is looked at, where errors have added up. The fastest motion has 8.8 rad/s."""
    network = load(MASSES, f"stop: 5, step: 0.5, integrator: {name}, tolerance: 1.0e-10")
    found = trajectories(network, "a.x", "b.v", engine=engine)
    for k in (1, 8, 9, 10):
        expected = expm(MATRIX * (0.5 * k)) @ [1, 0, 0, 0]
        assert found["a.x"][k] == pytest.approx(expected[0], abs=1e-8 if name != "bdf" else 1e-7)
        assert found["b.v"][k] == pytest.approx(expected[3], abs=1e-7 if name != "bdf" else 1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_both_engines_give_the_same_bits(load, trajectories, name):
    settings = f"stop: 1, step: 0.1, integrator: {name}, tolerance: 1.0e-7"
    native, python = (trajectories(load(MASSES, settings), "a.x", "b.v", engine=engine) for engine in ENGINES)
    assert all(np.array_equal(native[signal], python[signal]) for signal in native)


@pytest.mark.parametrize("name", ["lsoda", "radau", "bdf"])
def test_van_der_pol_agrees_with_an_integrator_of_ours(wired, name):
    """Over both jumps of μ = 1000, where an error of x is tripled in v = x/(mu (1 - x²)), and of both methods."""
    finals = []
    for integrator in (name, "rodas5p"):
        settings = f"method: joint, integrator: {integrator}, tolerance: 1.0e-7, absolute_tolerance: 1.0e-10"
        metrics = "metrics:\n  x: {signal: o.x, reduce: final}\n  v: {signal: o.v, reduce: final}\n"
        text = f"run: {{stop: 2000, step: 500, {settings}}}\n{metrics}blocks:\n  o: {{type: VanDerPol}}\n"
        outcome = run.Run(wired(text)).execute()
        assert outcome.status == "completed", outcome.error
        finals.append((outcome.metrics["x"], outcome.metrics["v"]))
    np.testing.assert_allclose(finals[0], finals[1], rtol=6e-6)
    np.testing.assert_allclose(finals[0], (1.706167732170469, -0.8928097010248125e-3), rtol=6e-6)


def test_the_formation_agrees_with_an_integrator_of_ours():
    """Its first half second, in which the differentiator's roots are passed through zero, where nothing is smooth."""
    finals = {}
    for name in ("dop853", "dormand-prince"):
        sets = ["run.method=joint", "run.stop=0.5", "run.step=0.01", "run.tolerance=1e-8", f"run.integrator={name}"]
        network = run.load(FORMATION, [*sets, "record=~", "metrics={x: {signal: plant.x, reduce: final}}"])
        outcome = run.Run(network).execute()
        assert outcome.status == "completed", outcome.error
        finals[name] = outcome.metrics["x"]
    np.testing.assert_allclose(finals["dop853"], finals["dormand-prince"], atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["lsoda", "radau", "dop853"])
def test_an_algebraic_loop_is_solved_within_the_derivatives(load, trajectories, name, engine):
    """y = x - y/2 gives y = 2 x/3; with dx/dt = -y, x = exp(-2 t/3)."""
    blocks = (
        "  m: {own: Fed, inputs: {u: n.y}}\n"
        "  n: {own: Less, parameters: {a: 1, b: 0}, inputs: {u: p.y, z: m.x}}\n"
        "  p: {own: Less, parameters: {a: 0.5, b: 1}, inputs: {u: p.y, z: m.x}}\n"
    )
    found = trajectories(
        load(blocks, f"stop: 2, step: 0.25, integrator: {name}, tolerance: 1.0e-10"), "m.x", engine=engine
    )
    np.testing.assert_allclose(found["m.x"], np.exp(-2.0 * 0.25 * np.arange(9) / 3.0), atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_events_are_found_inside_a_step(load, trajectories, name):
    """The second bounce of a ball is at t = sqrt(2/g) (1 + 2 e)."""
    g, first = 9.81, math.sqrt(2.0 / 9.81)
    found = trajectories(
        load("  b: {own: Ball}\n", f"stop: 1, step: 0.5, integrator: {name}, tolerance: 1.0e-9"), "b.h", "b.n"
    )
    since, speed = 1.0 - first, 0.7 * g * first
    assert [int(n) for n in found["b.n"]] == [0, 1, 1]
    assert found["b.h"][2] == pytest.approx(speed * since - 0.5 * g * since**2, abs=1e-7)


@pytest.mark.parametrize("name", ["lsoda", "radau", "dop853"])
def test_what_is_sampled_is_held(load, trajectories, name):
    """dx/dt = -x(k T): x falls by the factor 1 - T in every period."""
    blocks = (
        "  m: {own: Fed, inputs: {u: n.y}}\n"
        "  n: {own: Less, period: 0.25, parameters: {a: 1, b: 0}, inputs: {u: m.x, z: m.x}}\n"
    )
    found = trajectories(load(blocks, f"stop: 2, step: 0.5, integrator: {name}, tolerance: 1.0e-9"), "m.x")
    np.testing.assert_allclose(found["m.x"], 0.75 ** np.arange(9), rtol=1e-12)


def test_without_states_there_is_nothing_to_integrate(load, trajectories):
    blocks = "  n: {own: Less, parameters: {a: 0.5, b: 1}, inputs: {u: n.y, z: n.y}}\n"
    found = trajectories(load(blocks, "stop: 1, step: 0.5, integrator: lsoda, tolerance: 1.0e-6"), "n.y")
    assert not found["n.y"].any()


def test_steps_are_counted_and_those_that_scipy_rejects_are_not_told(load):
    outcome = run.Run(load(MASSES, "stop: 1, step: 0.5, integrator: dop853, tolerance: 1.0e-6")).execute()
    assert outcome.inner_steps["joint"].keys() == {"taken"}
    assert 2 < outcome.inner_steps["joint"]["taken"] < 200


# ---- what cannot be ----


@pytest.mark.parametrize(
    ("settings", "method", "place", "words"),
    [
        ("integrator: lsoda, tolerance: 1.0e-6", "jacobi", "integrator", ("jacobi", "run.method: joint")),
        ("integrator: radau, tolerance: 1.0e-6", "gauss-seidel", "integrator", ("gauss-seidel", "joint")),
        ("integrator: dop853, tolerance: 1.0e-6", "iterated", "integrator", ("iterated", "joint")),
        ("integrator: lsoda", "joint", "integrator", ("tolerance", "run.tolerance")),
        ("integrator: lsoda, inner_steps: 4", "joint", "inner_steps", ("tolerance", "run.inner_steps")),
    ],
)
def test_a_run_in_which_it_has_no_place_is_refused(load, settings, method, place, words):
    with pytest.raises(DiagramErrors) as caught:
        load(MASSES, f"stop: 1, step: 0.5, {settings}", method=method)
    (error,) = caught.value.errors
    text = f"run: {{method: {method}, stop: 1, step: 0.5, {settings}}}"
    assert isinstance(error, WrongValue) and error.position.line == 1
    assert error.position.column in (text.index(place) + 1, text.index(place) + len(place) + 3)
    assert words[0] in error.message and words[1] in f"{error.message} {error.fix}"


@pytest.mark.parametrize("method", ["jacobi", "joint"])
def test_a_block_of_its_own_is_refused(load, method):
    blocks = MASSES.replace("m: 2, k: 3}", "m: 2, k: 3}, integrator: lsoda, tolerance: 1.0e-6")
    with pytest.raises(DiagramErrors) as caught:
        load(blocks, "stop: 1, step: 0.5", method=method)
    assert any("`integrator`" in str(e) or "lsoda" in str(e) for e in caught.value.errors)
    assert all("block b" in e.message and e.fix for e in caught.value.errors)


def test_too_many_states_for_one_matrix_are_refused_of_implicit_methods_alone(load):
    """Also those of members that go their own ways, as scipy solves for all at once."""
    for name in ("radau", "dop853"):
        settings = f"stop: 0.5, step: 0.5, integrator: {name}, tolerance: 1.0e-6"
        if name == "dop853":
            assert run.Run(load("  m: {own: Many, per: r, dimensions: {n: 700}}\n", settings, "fleets: {r: 3}\n"))
            continue
        with pytest.raises(DiagramErrors) as caught:
            load("  m: {own: Many, per: r, dimensions: {n: 700}}\n", settings, "fleets: {r: 3}\n")
        assert isinstance(caught.value.errors[0], TooLarge) and "2100 states" in caught.value.errors[0].message


def test_a_fleet_is_not_exported_with_it(load, tmp_path):
    network = load(MASSES, "stop: 1, step: 0.5, integrator: lsoda, tolerance: 1.0e-6")
    with pytest.raises(NotExportable, match="lsoda"):
        export_fmu(network, ["a"], tmp_path / "a.fmu")
    assert not (tmp_path / "a.fmu").exists()


# ---- how it ends ----


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", NAMES)
def test_a_pole_ends_the_run_with_the_state(load, name, engine):
    settings = f"stop: 4, step: 2, integrator: {name}, tolerance: 1.0e-6"
    outcome = run.Run(load("  c: {own: Fed, inputs: {u: p.x}}\n  p: {own: Pole}\n", settings), engine=engine).execute()
    assert outcome.status in ("failed", "diverged")
    assert "state `x`" in outcome.error.message and outcome.error.fix


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", NAMES)
def test_a_derivative_that_is_no_number_ends_the_run(load, name, engine):
    settings = f"stop: 4, step: 2, integrator: {name}, tolerance: 1.0e-6"
    outcome = run.Run(load("  p: {own: Root}\n", settings), engine=engine).execute()
    assert outcome.status == "failed" and isinstance(outcome.error, BlockFailed)
    assert "block p: state `x` has a derivative that is not finite" in outcome.error.message
    assert name in outcome.error.message and outcome.steps == 0


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", NAMES)
def test_an_error_in_a_block_is_that_of_the_block(load, name, engine):
    settings = f"stop: 1, step: 0.1, integrator: {name}, tolerance: 1.0e-6"
    outcome = run.Run(load("  p: {own: Endless}\n", settings), engine=engine).execute()
    assert outcome.status == "failed" and "block p: derivatives() failed" in outcome.error.message
    assert "too late" in outcome.error.message and outcome.steps == 0
