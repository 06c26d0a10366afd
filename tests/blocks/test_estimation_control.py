"""Observers and feedback against scipy.linalg and plain numpy."""

from pathlib import Path

import numpy as np
import pytest
from scipy import linalg
from scipy.optimize import lsq_linear

from cosim.blocks.matrices import cayley, double
from cosim.engine import run
from tests.blocks.library_runs import run_diagram

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (6, 3)])
def test_riccati_equations_are_scipys(n, m):
    rng = np.random.default_rng(n)
    a, b = rng.normal(size=(n, n)), rng.normal(size=(n, m))
    q, r = np.diag(rng.uniform(0.1, 2, n)), np.diag(rng.uniform(0.1, 2, m))
    for prepare, solve in ((None, linalg.solve_discrete_are), (cayley, linalg.solve_continuous_are)):
        parts = a.copy(), b @ np.linalg.inv(r) @ b.T, q.copy()
        if prepare:
            prepare(*parts)
        double(*parts)
        expected = solve(a, b, q, r)
        np.testing.assert_allclose(parts[2], expected, atol=1e-11 * abs(expected).max())


def test_what_cannot_be_stabilized_is_told():
    with pytest.raises(ValueError, match="no solution"):
        double(np.diag([2.0, 0.5]), np.diag([0.0, 1.0]), np.eye(2))
    with pytest.raises(ValueError, match="Singular"):
        double(np.eye(2), -np.eye(2), np.eye(2))


def test_a_design_that_fails_says_which_values_it_was_made_of(write):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  k: {block: LQR, start: {x: [0, 0]}, parameters:\n"
    text += "    {A: [[2, 0], [0, 1]], B: [[0], [1]], Q: [[1, 0], [0, 1]]}}\n"
    outcome = run.Run(run.load(write(text))).execute()
    assert outcome.status == "failed" and "what the inputs do not reach is unstable" in outcome.error.message
    assert outcome.error.fix.startswith("other values of A, B, Q, R; or `cosim debug`")


A = np.array([[0, 1, 0], [0, 0, 1], [0.1, -0.2, 0.3]])
B = np.array([[0, 1], [0, 0], [1, 0.5]])
Q, R = np.diag([1.0, 2, 3]), np.array([[1, 0.2], [0.2, 0.5]])
MATRICES = f"A: {A.tolist()}, B: {B.tolist()}, Q: {Q.tolist()}, R: {R.tolist()}"
STATES = [1.0, -2.0, 0.5]


def gains(block, rest=""):
    text = (
        "run: {stop: 0.1, step: 0.1}\nblocks:\n"
        f"  x: {{block: Constant, parameters: {{value: {STATES}}}}}\n"
        f"  b: {{block: {block}, parameters: {{{MATRICES}}}, inputs: {{x: x.y}}{rest}}}\n"
    )
    return run_diagram(text, "b.u", "b.K")


def test_lqr_is_scipys():
    found = gains("LQR")
    x = linalg.solve_continuous_are(A, B, Q, R)
    expected = np.linalg.solve(R, B.T @ x)
    np.testing.assert_allclose(found["b.K"][0], expected, atol=1e-12)
    np.testing.assert_allclose(found["b.u"][-1], -expected @ STATES, atol=1e-12)


def test_discrete_lqr_is_scipys():
    found = gains("DiscreteLQR", ", period: 0.1")
    x = linalg.solve_discrete_are(A, B, Q, R)
    expected = np.linalg.solve(R + B.T @ x @ B, B.T @ x @ A)
    np.testing.assert_allclose(found["b.K"][0], expected, atol=1e-12)
    np.testing.assert_allclose(found["b.u"][-1], -expected @ STATES, atol=1e-12)


def test_the_error_of_an_observer_decays_as_its_matrix_says():
    a, b, c, gain = [[0, 1], [-4, -1]], [[0], [1]], [[1, 0]], [[5], [7]]
    text = (
        "run: {stop: 2, step: 0.01, method: joint, integrator: dormand-prince}\nblocks:\n"
        "  u: {block: Sine}\n"
        f"  s: {{block: StateSpace, parameters: {{A: {a}, B: {b}, C: {c}}},\n"
        "      start: {x: [1, -1]}, inputs: {u: u.y}}\n"
        f"  o: {{block: Luenberger, parameters: {{A: {a}, B: {b}, C: {c}, L: {gain}}}, inputs: {{u: u.y, y: s.y}}}}\n"
    )
    found = run_diagram(text, "s.x", "o.x_hat")
    error = np.array([linalg.expm((np.array(a) - np.array(gain) @ c) * t) @ [1, -1] for t in found["time"]])
    np.testing.assert_allclose(found["s.x"] - found["o.x_hat"], error, atol=1e-8)


def test_the_diagrams_kalman_filter_is_numpys_in_joseph_form():
    found = run_diagram(
        (ROOT / "diagrams/kalman.yaml").read_text(), "force.y", "measured.y", "filter.x_hat", "filter.P_hat"
    )
    a, b, c = np.array([[1, 0.1], [0, 1]]), np.array([0.005, 0.1]), np.array([[1.0, 0]])
    q, r = np.diag([1e-5, 1e-4]), 0.02
    x, p = np.array([0.5, 0.0]), np.eye(2)
    for k in range(len(found["time"])):
        gain = p @ c.T / (c @ p @ c.T + r)
        x = x + gain[:, 0] * (found["measured.y"][k] - c @ x)[0]
        kept = np.eye(2) - gain @ c
        p = kept @ p @ kept.T + r * gain @ gain.T
        np.testing.assert_allclose(found["filter.x_hat"][k], x, atol=1e-12)
        np.testing.assert_allclose(found["filter.P_hat"][k], p, atol=1e-13)
        x, p = a @ x + b * found["force.y"][k], a @ p @ a.T + q
    steady = linalg.solve_discrete_are(a.T, c.T, q, [[r]])
    np.testing.assert_allclose(p, steady, rtol=1e-6)


def test_what_a_filter_knows_after_an_exact_measurement_is_the_measurements_variance():
    """P R / (P + R) with P = 1e20 R, which rounds to R: P - K P has no digit of it."""
    found = run_diagram(
        "run: {stop: 0.5, step: 0.1}\nblocks:\n  y: {block: Sine, parameters: {amplitude: [1, 2]}}\n"
        "  f: {block: KalmanFilter, period: 0.1, inputs: {y: y.y}, start: {P: [[1e20, 0], [0, 1e20]]}, parameters:\n"
        "    {A: [[1, 0], [0, 1]], B: [[0], [0]], C: [[1, 0], [0, 1]], Q: [[3e20, 0], [0, 3e20]], R: [1, 3]}}\n",
        *("y.y", "f.P_hat", "f.x_hat"),
    )
    np.testing.assert_allclose(found["f.P_hat"], [np.diag([1.0, 3.0])] * 6, rtol=4e-16)
    np.testing.assert_allclose(found["f.x_hat"], found["y.y"], rtol=4e-16, atol=4e-16)


def test_covariances_are_checked():
    bad = MATRICES.replace(str(R.tolist()), "[[1, 3], [3, 1]]")
    text = f"run: {{stop: 1, step: 1}}\nblocks:\n  x: {{block: Constant, parameters: {{value: {STATES}}}}}\n"
    with pytest.raises(Exception, match="R is symmetric, with positive eigenvalues"):
        run_diagram(text + f"  b: {{block: LQR, parameters: {{{bad}}}, inputs: {{x: x.y}}}}\n", "b.u")


def predicted(limit, iterations):
    """What LinearMPC finds, and the plan by the cost as a sum of squares of one matrix, of an active-set method."""
    a, b, horizon = linalg.expm(0.2 * A), 0.2 * B, 6
    reach = np.zeros((3 * horizon, 2 * horizon))
    for k in range(horizon):
        for j in range(k + 1):
            reach[3 * k : 3 * k + 3, 2 * j : 2 * j + 2] = np.linalg.matrix_power(a, k - j) @ b
    free = np.concatenate([np.linalg.matrix_power(a, k + 1) @ STATES for k in range(horizon)])
    root, weight = np.sqrt(np.kron(np.eye(horizon), Q)), np.kron(np.eye(horizon), np.linalg.cholesky(R).T)
    whole = np.concatenate([root @ reach, weight])
    expected = lsq_linear(whole, np.concatenate([-root @ free, np.zeros(2 * horizon)]), (-limit, limit), tol=1e-14).x
    text = (
        "run: {stop: 0.2, step: 0.2}\nblocks:\n"
        f"  x: {{block: Constant, parameters: {{value: {STATES}}}}}\n"
        f"  b: {{block: LinearMPC, period: 0.2, dimensions: {{horizon: {horizon}}}, inputs: {{x: x.y}}, parameters:"
        f" {{A: {a.tolist()}, B: {b.tolist()}, Q: {Q.tolist()}, R: {R.tolist()}, lower: -{limit}, upper: {limit},"
        f" iterations: {iterations}}}}}\n"
    )
    return run_diagram(text, "b.found", "b.residual", "b.error", "b.u"), expected


@pytest.mark.parametrize("limit", [10.0, 0.4])
def test_predictive_control_is_scipys_bounded_least_squares(limit):
    found, expected = predicted(limit, 2000)
    np.testing.assert_allclose(found["b.found"][0].ravel(), expected, atol=1e-8)
    np.testing.assert_array_equal(found["b.u"][0], found["b.found"][0, 0])
    assert found["b.residual"][0] < 1e-9
    assert (abs(expected) > limit - 1e-6).any() == (limit < 1)


@pytest.mark.parametrize("iterations", [1, 5, 20, 100, 1000])
@pytest.mark.parametrize("limit", [10.0, 0.4])
def test_a_plan_is_no_further_from_the_best_one_than_its_error_says(limit, iterations):
    found, expected = predicted(limit, iterations)
    distance = np.linalg.norm(found["b.found"][0].ravel() - expected)
    assert distance <= found["b.error"][0] + 1e-8
    assert iterations < 1000 or found["b.error"][0] < 1e-6


@pytest.mark.parametrize(("iterations", "r", "warned"), [(100, 1e-3, True), (100, 1.0, False), (100, 0.0, False)])
def test_a_plan_that_has_not_settled_is_told(tmp_path, iterations, r, warned):
    """With little weight on inputs, 100 iterations give -59.7 where -100 is the best."""
    path = tmp_path / "d.yaml"
    q = "[[1000, 0], [0, 1]]" if r < 1.0 else "[[1, 0], [0, 1]]"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  b: {block: LinearMPC, period: 0.1, start: {x: [1, 0]}, parameters:"
        f" {{A: [[1.2, 0.1], [0, 1.1]], B: [[0.005], [0.1]], Q: {q}, R: [[{r}]], lower: -100, upper: 100,"
        f" iterations: {iterations}}}}}\n"
    )
    outcome = run.Run(run.load(path)).execute()
    assert any("take more iterations" in w.message for w in outcome.warnings) == warned
    open_ = [c for c in outcome.conditions if c.holds is None]
    assert len(open_) == (r == 0.0)
