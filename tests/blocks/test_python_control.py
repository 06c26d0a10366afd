"""The library against python-control: responses, designs and discretizations."""

import control
import numpy as np
import pytest

from tests.blocks.library_runs import run_block, run_diagram

A, B, C = [[0.0, 1.0], [-4.0, -1.0]], [[0.0], [1.0]], [[1.0, 0.0]]
T = 0.1
STEP = "  wave: {block: Step, parameters: {at: 0, final: 2}}\n"
CONTINUOUS = [
    ("FirstOrder", "k: 2, T: 0.3", control.tf([2], [0.3, 1]), "x"),
    ("SecondOrder", "k: 2, omega: 5, zeta: 0.2", control.tf([50], [1, 2, 25]), "x"),
    ("LeadLag", "k: 2, T_1: 0.5, T_2: 0.1", 2 * control.tf([0.5, 1], [0.1, 1]), "y"),
    ("TransferFunction", "numerator: [1, 2], denominator: [2, 3, 4, 5]", control.tf([1, 2], [2, 3, 4, 5]), "y"),
    (
        "TransferFunctionFeedthrough",
        "numerator: [1, 2, 3], denominator: [2, 3, 4]",
        control.tf([1, 2, 3], [2, 3, 4]),
        "y",
    ),
    ("ZeroPoleGain", "zeros: [-2, 1], poles: [-1, -3, -4], k: 5", control.zpk([-2, 1], [-1, -3, -4], 5), "y"),
    ("StateSpace", f"A: {A}, B: {B}, C: {C}", control.ss(A, B, C, 0), "y"),
    ("StateSpaceFeedthrough", f"A: {A}, B: {B}, C: {C}, D: [[0.5]]", control.ss(A, B, C, 0.5), "y"),
    ("TransportDelay", "T: 0.4", control.tf(*control.pade(0.4, 2)), "y"),
]


@pytest.mark.parametrize(("name", "parameters", "system", "output"), CONTINUOUS, ids=[case[0] for case in CONTINUOUS])
def test_a_step_response_is_forced_response(name, parameters, system, output):
    """python-control's is exact for a constant input; order 5 with |pole| h = 0.1 is left with 0.1^6 / 720 a step."""
    found = run_block(name, parameters, "u: wave.y", STEP, (output,), step=0.01)
    expected = control.forced_response(system, found["time"], np.full(len(found["time"]), 2.0)).outputs
    np.testing.assert_allclose(found[output].ravel(), expected, atol=1e-7 * np.abs(expected).max())


def test_a_pid_closed_loop_is_feedback():
    """u = k_p e + k_i / s e - k_d s / (T_f s + 1) y with c = 0, around 1 / (s^2 + s + 1)."""
    text = (
        "run: {stop: 5, step: 0.005, method: joint, integrator: dormand-prince}\nblocks:\n"
        "  r: {block: Step, parameters: {at: 0}}\n"
        "  p: {block: TransferFunction, parameters: {numerator: [1], denominator: [1, 1, 1]}, inputs: {u: c.u}}\n"
        "  c: {block: PID, parameters: {k_p: 3, k_i: 2, k_d: 1, T_f: 0.05}, inputs: {r: r.y, y: p.y}}\n"
    )
    found = run_diagram(text, "p.y", "c.u")
    plant, pi, d = control.tf([1], [1, 1, 1]), control.tf([3, 2], [1, 0]), control.tf([1, 0], [0.05, 1])
    inner = control.feedback(plant, d)
    loop = control.minreal(control.feedback(pi * inner, 1), verbose=False)
    expected = control.step_response(loop, found["time"]).outputs
    np.testing.assert_allclose(found["p.y"].ravel(), expected, atol=1e-7)
    assert abs(found["p.y"][-1] - 1.0) < 0.1


@pytest.mark.parametrize("method", ["zoh", "tustin"])
def test_a_discretized_plant_is_c2d(method):
    """Under a sampled sine, sample by sample; by `zoh` also what a continuous block does with held inputs."""
    system = control.c2d(control.ss(A, B, C, 0), T, method)
    through = "DiscreteStateSpaceFeedthrough" if method == "tustin" else "DiscreteStateSpace"
    matrices = f"A: {system.A.tolist()}, B: {system.B.tolist()}, C: {system.C.tolist()}"
    matrices += f", D: {system.D.tolist()}" if method == "tustin" else ""
    tf = control.tf(system)
    numerator, denominator = tf.num[0][0].tolist(), tf.den[0][0].tolist()
    name = "DiscreteTransferFunctionFeedthrough" if method == "tustin" else "DiscreteTransferFunction"
    text = (
        f"run: {{stop: 3, step: {T / 10}, method: joint, integrator: dormand-prince}}\nblocks:\n"
        "  wave: {block: Sine, parameters: {frequency: 0.7}, period: 0.1}\n"
        f"  s: {{block: {through}, parameters: {{{matrices}}}, inputs: {{u: wave.y}}, period: {T}}}\n"
        f"  t: {{block: {name}, parameters: {{numerator: {numerator}, denominator: {denominator}}},\n"
        f"      inputs: {{u: wave.y}}, period: {T}}}\n"
        f"  c: {{block: StateSpace, parameters: {{A: {A}, B: {B}, C: {C}}}, inputs: {{u: wave.y}}}}\n"
    )
    found = {name: signal[::10].ravel() for name, signal in run_diagram(text, "wave.y", "s.y", "t.y", "c.y").items()}
    expected = control.forced_response(system, found["time"], found["wave.y"]).outputs
    np.testing.assert_allclose(found["s.y"], expected, atol=1e-12)
    np.testing.assert_allclose(found["t.y"], expected, atol=1e-10)  # roots of polynomials are less well conditioned
    if method == "zoh":
        np.testing.assert_allclose(found["c.y"], expected, atol=1e-9)


CHAIN = np.array([[0, 1, 0], [0, 0, 1], [0.1, -0.2, 0.3]])
INPUTS = np.array([[0, 1], [0, 0], [1, 0.5]])
Q, R = np.diag([1.0, 2, 3]), np.array([[1, 0.2], [0.2, 0.5]])


@pytest.mark.parametrize(("block", "design", "rest"), [("LQR", control.lqr, ""), ("DiscreteLQR", control.dlqr, T)])
def test_gains_are_those_of_lqr_and_dlqr(block, design, rest):
    text = (
        "run: {stop: 0.1, step: 0.1}\nblocks:\n  x: {block: Constant, parameters: {value: [1, -2, 0.5]}}\n"
        f"  b: {{block: {block}, parameters: {{A: {CHAIN.tolist()}, B: {INPUTS.tolist()}, Q: {Q.tolist()},\n"
        f"      R: {R.tolist()}}}, inputs: {{x: x.y}}{f', period: {rest}' if rest else ''}}}\n"
    )
    expected = design(CHAIN, INPUTS, Q, R)[0]
    np.testing.assert_allclose(run_diagram(text, "b.K")["b.K"][0], expected, atol=1e-11)


def test_a_steady_kalman_filter_has_the_gain_of_dlqe():
    """The covariance before a measurement, and so the gain, converge to the stationary ones."""
    a, c, q, r = [[1, 0.1], [0, 1]], [[1.0, 0]], [[1e-5, 0], [0, 1e-4]], 0.02
    text = (
        "run: {stop: 100, step: 0.1}\nblocks:\n  y: {block: Sine}\n"
        f"  f: {{block: KalmanFilter, period: 0.1, inputs: {{y: y.y}}, start: {{P: [[1, 0], [0, 1]]}},\n"
        f"      parameters: {{A: {a}, B: [[0], [0]], C: {c}, Q: {q}, R: [{r}]}}}}\n"
    )
    found = run_diagram(text, "f.P_hat")["f.P_hat"][-1]
    gain, before, _ = control.dlqe(np.array(a), np.eye(2), np.array(c), np.array(q), np.array([[r]]))
    np.testing.assert_allclose(np.array(a) @ found @ np.array(a).T + q, before, rtol=1e-9)
    np.testing.assert_allclose(np.array(a) @ found @ np.array(c).T / r, gain, rtol=1e-9)  # theirs is the predictor's


def test_an_observer_with_the_gain_of_lqe_has_its_poles():
    """Its error decays as the exponential of A - L C, of which python-control gives the eigenvalues."""
    gain, _, poles = control.lqe(A, np.eye(2), C, np.diag([1.0, 2.0]), [[0.1]])
    text = (
        "run: {stop: 2, step: 0.01, method: joint, integrator: dormand-prince}\nblocks:\n  u: {block: Sine}\n"
        f"  s: {{block: StateSpace, parameters: {{A: {A}, B: {B}, C: {C}}},\n"
        "      start: {x: [1, -1]}, inputs: {u: u.y}}\n"
        f"  o: {{block: Luenberger, parameters: {{A: {A}, B: {B}, C: {C}, L: {gain.tolist()}}},\n"
        "      inputs: {u: u.y, y: s.y}}\n"
    )
    found = run_diagram(text, "s.x", "o.x_hat")
    error = found["s.x"] - found["o.x_hat"]
    free = control.ss(np.array(A) - gain @ np.array(C), np.zeros((2, 1)), np.eye(2), 0)
    np.testing.assert_allclose(np.sort_complex(free.poles()), np.sort_complex(poles), atol=1e-10)
    expected = control.initial_response(free, found["time"], [1, -1]).outputs
    np.testing.assert_allclose(error.T, expected, atol=1e-8)
