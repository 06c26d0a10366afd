"""Linear dynamics against scipy: the exact response to a sine, by the matrix exponential of system and generator."""

import numpy as np
import pytest
from scipy import linalg, signal

from tests.blocks.library_runs import run_block

W = 2 * np.pi
T = np.linspace(0.0, 2.0, 201)


def response(system, x=None, times=T):
    """y of a system (A, B, C, D) driven by sin(W t), from x."""
    a, b, c, d = (np.atleast_2d(np.asarray(part, float)) for part in system)
    n = len(a)
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n : n + 1] = a, b.reshape(n, 1)
    whole[n, n + 1], whole[n + 1, n] = W, -W
    start = np.concatenate([np.zeros(n) if x is None else x, [0.0, 1.0]])
    return np.array([(c @ (z := linalg.expm(whole * t) @ start)[:n] + d[..., 0] * z[n]) for t in times])[:, 0]


def of(numerator, denominator):
    return response(signal.tf2ss(numerator, denominator))


FC = 2 * np.pi * 2.0


@pytest.mark.parametrize(
    ("name", "parameters", "output", "expected"),
    [
        ("Integrator", "k: 2", "x", 2 * (1 - np.cos(W * T)) / W),
        ("FirstOrder", "k: 2, T: 0.3", "x", of([2], [0.3, 1])),
        ("SecondOrder", "k: 2, omega: 5, zeta: 0.2", "x", of([50], [1, 2, 25])),
        ("Derivative", "T: 0.05", "y", of([1, 0], [0.05, 1])),
        ("LeadLag", "k: 2, T_1: 0.5, T_2: 0.1", "y", of([1, 2], [0.1, 1])),
        ("TransferFunction", "numerator: [1, 2], denominator: [2, 3, 4, 5]", "y", of([1, 2], [2, 3, 4, 5])),
        ("TransferFunctionFeedthrough", "numerator: [1, 2, 3], denominator: [2, 3, 4]", "y", of([1, 2, 3], [2, 3, 4])),
        ("TransferFunction", "numerator: [4], denominator: [1, 2]", "y", of([4], [1, 2])),
        (
            "ZeroPoleGain",
            "zeros: [-2, 1], poles: [-1, -3, -4], k: 5",
            "y",
            response(signal.zpk2ss([-2, 1], [-1, -3, -4], 5)),
        ),
        ("ZeroPoleGain", "poles: [-1, -3], k: 5", "y", response(signal.zpk2ss([], [-1, -3], 5))),
        ("ZeroPoleGain", "zeros: -2, poles: [-1, -3], k: 5", "y", response(signal.zpk2ss([-2], [-1, -3], 5))),
        ("LowPass", "cutoff: 2", "x", response(signal.tf2ss(*signal.butter(2, FC, analog=True)))),
        ("HighPass", "cutoff: 2", "y", response(signal.tf2ss(*signal.butter(2, FC, "high", analog=True)))),
        ("BandPass", "centre: 2, Q: 3", "y", of([FC / 3, 0], [1, FC / 3, FC**2])),
        ("Notch", "centre: 2, Q: 3", "y", of([1, 0, FC**2], [1, FC / 3, FC**2])),
        ("TransportDelay", "T: 0.2", "y", of([0.04, -1.2, 12], [0.04, 1.2, 12])),
        (
            "StateSpace",
            "A: [[0, 1], [-4, -1]], B: [[1], [2]], C: [[1, 3]]",
            "y",
            response(([[0, 1], [-4, -1]], [[1], [2]], [[1, 3]], [[0]])),
        ),
        (
            "StateSpaceFeedthrough",
            "A: [[0, 1], [-4, -1]], B: [[1], [2]], C: [[1, 3]], D: [[0.5]]",
            "y",
            response(([[0, 1], [-4, -1]], [[1], [2]], [[1, 3]], [[0.5]])),
        ),
    ],
)
def test_the_response_to_a_sine_is_exact(name, parameters, output, expected):
    found = run_block(name, parameters, "u: wave.y", outputs=(output,), step=0.01)[output]
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=2e-7 * scale)  # order 5: (2 pi 0.01)^5 / 120 a second


def test_a_band_pass_keeps_its_frequency_and_a_notch_takes_it_out():
    """What is left of the start decays as e^(-pi t): 1e-7 after 5 s."""
    for name, share in (("Notch", 0.0), ("BandPass", 1.0)):
        found = run_block(name, "centre: 1, Q: 1", "u: wave.y", stop=6.0, step=0.01)
        late = found["time"] > 5.0
        np.testing.assert_allclose(found["y"][late], share * np.sin(W * found["time"][late]), atol=1e-6)


def test_pade_is_the_delay_for_slow_signals():
    slow = "  wave: {block: Sine, parameters: {frequency: 0.1}}\n"
    found = run_block("TransportDelay", "T: 0.5", "u: wave.y", slow, stop=20.0, step=0.01)
    late = found["time"] > 5
    expected = np.sin(0.2 * np.pi * (found["time"] - 0.5))
    np.testing.assert_allclose(found["y"][late], expected[late], atol=(0.2 * np.pi * 0.5) ** 5 / 720)


def test_state_space_with_several_inputs_and_outputs():
    a, b, c, d = [[0, 1], [-4, -1]], [[1, 0], [2, 1]], [[1, 3], [0, 1]], [[0, 1], [1, 0]]
    pair = "  wave: {block: Sine, parameters: {amplitude: [1, 2]}}\n"
    found = run_block("StateSpaceFeedthrough", f"A: {a}, B: {b}, C: {c}, D: {d}", "u: wave.y", pair, step=0.01)["y"]
    both = np.array(b) @ [[1], [2]], np.array(d) @ [[1], [2]]
    for k in range(2):
        expected = response((a, both[0], [c[k]], [both[1][k]]))
        np.testing.assert_allclose(found[:, k], expected, atol=1e-7)


def test_a_derivative_begins_at_zero():
    assert (
        run_block("Derivative", "", "u: wave.y", "  wave: {block: Constant, parameters: {value: 7}}\n")["y"][0] == 0.0
    )


def test_limits_of_an_integrator_are_met_and_left_at_their_instants():
    """The integral of sin, times W, between 0.5 and 1.5: in closed form."""
    found = run_block(
        "LimitedIntegrator", f"k: {W}, lower: -1, upper: 1.5", "u: wave.y", outputs=("x",), step=0.013, stop=1.95
    )
    time, x = found["time"], found["x"]
    free = 1 - np.cos(W * time)
    meets = np.arccos(-0.5) / W  # 1 - cos = 1.5
    within = np.where(time < meets, free, 1.5)
    # it leaves at 1/2, where sin changes sign, from 1.5: then 1.5 - (free(1/2) - free) = free - 0.5, down to -0.5 at 1
    within = np.where(time > 0.5, free - 0.5, within)
    second = np.where(time > 1.0 + np.arccos(1 - 2.0) / W, 1.5, free - 0.5)
    within = np.where((time > 1.0) & (time <= 1.5), np.minimum(second, 1.5), within)
    np.testing.assert_allclose(x[time <= 1.5], within[time <= 1.5], atol=1e-7)
    assert x.max() <= 1.5 and x.min() >= -1.0


def test_an_integrator_is_reset_where_a_signal_rises_through_zero():
    others = "  one: {block: Constant}\n  wave: {block: Sine, parameters: {frequency: 1, phase: 1}}\n"
    found = run_block("LimitedIntegrator", "", "u: one.y, reset: wave.y", others, ("x",), step=0.013, stop=1.95)
    first = (2 * np.pi - 1) / W
    expected = np.where(found["time"] < first, found["time"], found["time"] - first)
    expected = np.where(found["time"] < first + 1, expected, found["time"] - first - 1)
    np.testing.assert_allclose(found["x"], expected, atol=1e-10)


def test_an_integrator_that_begins_at_a_limit_stays_there_until_it_is_led_away():
    run = run_block(
        "LimitedIntegrator",
        f"k: {W}, upper: 1, x_start: 1",
        "u: wave.y",
        outputs=("x",),
        step=0.013,
        stop=1.3,
    )
    time = run["time"]
    expected = np.where(time < 0.5, 1.0, 1.0 - (1 + np.cos(W * time)))
    np.testing.assert_allclose(run["x"][time <= 1], expected[time <= 1], atol=1e-7)
    assert run["x"].max() <= 1.0
