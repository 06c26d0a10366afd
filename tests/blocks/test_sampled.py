"""Sampled blocks against scipy.signal and plain numpy, at every sample."""

import math

import numpy as np
import pytest
from scipy import signal

from tests.blocks.library_runs import run_block

PERIOD, COUNT = 0.02, 101
WAVE = "  wave: {block: Sine, parameters: {amplitude: [1, 3], frequency: 2, phase: [0.3, 1]}}\n"
AT = PERIOD * np.arange(COUNT)
U = np.array([1, 3]) * np.sin(4 * np.pi * AT[:, None] + np.array([0.3, 1]))


def found(name, parameters="", rest="", outputs=("y",), inputs="u: wave.y", others=WAVE):
    """Outputs at the samples, of which there are 20 steps in between."""
    keys = f"period: {PERIOD}" + (f", {rest}" if rest else "")
    run = run_block(name, parameters, inputs, others, outputs, rest=keys)
    for output in outputs:  # held in between
        np.testing.assert_array_equal(run[output][19::20], run[output][10::20])
    return [run[output][::20] for output in outputs]


def shifted(u, k):
    return np.concatenate([np.zeros((k, *u.shape[1:])), u])[: len(u)]


@pytest.mark.parametrize(
    ("name", "parameters", "rest", "expected"),
    [
        ("UnitDelay", "", "", shifted(U, 1)),
        ("Delay", "samples: 7", "dimensions: {depth: 7}", shifted(U, 7)),
        ("Delay", "samples: 3", "", shifted(U, 3)),
        ("ZeroOrderHold", "", "", U),
        ("DiscreteIntegrator", "k: 2", "", 2 * PERIOD * np.cumsum(shifted(U, 1), axis=0)),
        ("DiscreteDerivative", "", "", np.diff(U, axis=0, prepend=U[:1]) / PERIOD),
        (
            "DiscreteTransferFunction",
            "numerator: [1, 2], denominator: [2, -0.5, 0.25, 0.1]",
            "",
            signal.lfilter([0, 0, 1, 2], [2, -0.5, 0.25, 0.1], U, axis=0),
        ),
        (
            "DiscreteTransferFunctionFeedthrough",
            "numerator: [1, 2], denominator: [2, -1]",
            "",
            signal.lfilter([1, 2], [2, -1], U, axis=0),
        ),
        ("FIR", "b: [1, -2, 0.5]", "", signal.lfilter([1, -2, 0.5], [1], U, axis=0)),
        (
            "MovingAverage",
            "",
            "dimensions: {samples: 4}",
            np.array([U[max(0, k - 3) : k + 1].mean(axis=0) for k in range(COUNT)]),
        ),
    ],
)
def test_against_scipy(name, parameters, rest, expected):
    np.testing.assert_allclose(found(name, parameters, rest)[0], expected, rtol=1e-12, atol=1e-13)


def test_discrete_state_space():
    a, b, c, d = [[0.5, 0.2], [-0.4, 0.9]], [[1, 0], [0, 2]], [[1, 1]], [[0.5, 0]]
    for name, more, through in (
        ("DiscreteStateSpace", "", [[0, 0]]),
        ("DiscreteStateSpaceFeedthrough", f", D: {d}", d),
    ):
        y = found(name, f"A: {a}, B: {b}, C: {c}{more}")[0]
        _, expected, _ = signal.dlsim((a, b, c, through, PERIOD), U)
        np.testing.assert_allclose(y, expected[:, 0], atol=1e-12)


@pytest.mark.parametrize("T", [0.1, 0.0731])
def test_a_first_order_hold_goes_on_along_the_line_of_its_last_samples(T):
    run = run_block("FirstOrderHold", f"T: {T}", "u: wave.y", WAVE, step=0.01)
    k = np.floor(run["time"] / T + 1e-9)[:, None]
    phase = np.array([0.3, 1])
    now, before = (np.array([1, 3]) * np.sin(4 * np.pi * at + phase) for at in (k * T, np.maximum(k - 1, 0) * T))
    np.testing.assert_allclose(run["y"], now + (now - before) / T * (run["time"][:, None] - k * T), atol=1e-9)


def test_rate_limit_and_backlash():
    expected, last = [], U[0]
    for u in U:
        last = np.clip(u, last - 0.02 * 9, last + 0.02 * 15)
        expected.append(last)
    np.testing.assert_allclose(found("RateLimit", "rising: 15, falling: 9")[0], expected, atol=1e-13)
    expected, last = [], np.zeros(2)
    for u in U:
        last = np.clip(last, u - 0.25, u + 0.25)
        expected.append(last)
    np.testing.assert_allclose(found("Backlash", "width: 0.5")[0], expected, atol=1e-13)


def test_pid_as_its_difference_equations():
    k_p, k_i, k_d, t_f, b, c, low, high, t_t = 2.0, 3.0, 0.1, 0.05, 0.7, 0.4, -1.5, 2.5, 0.3
    parameters = (
        f"k_p: {k_p}, k_i: {k_i}, k_d: {k_d}, T_f: {t_f}, b: {b}, c: {c}, lower: {low}, upper: {high}, T_t: {t_t}"
    )
    r, y = U[:, 0], U[:, 1]
    i = d = 0.0
    before, expected = c * r[0] - y[0], []
    for k in range(COUNT):
        e_d = c * r[k] - y[k]
        d = t_f / (t_f + PERIOD) * d + k_d / (t_f + PERIOD) * (e_d - before)
        v = k_p * (b * r[k] - y[k]) + i + d
        u = min(max(v, low), high)
        i += k_i * PERIOD * (r[k] - y[k]) + PERIOD / t_t * (u - v)
        before = e_d
        expected.append(u)
    inputs = 'r: "wave.y[1]", y: "wave.y[2]"'
    np.testing.assert_allclose(found("DiscretePID", parameters, outputs=("u",), inputs=inputs)[0], expected, atol=1e-12)


TRUTH = WAVE + "  above: {block: Compare, inputs: {u: wave.y}, parameters: {threshold: 0.1}}\n"
B = U > 0.1


def test_edges_and_latches():
    before = shifted(B, 1).astype(bool)
    rising, falling = found("Edge", outputs=("rising", "falling"), inputs="u: above.above", others=TRUTH)
    np.testing.assert_array_equal(rising, B & ~before)
    np.testing.assert_array_equal(falling, ~B & before)
    expected, last = [], np.zeros(1, bool)
    for k in range(COUNT):
        last = (B[k, 0] | last) & ~B[k, 1]
        expected.append(last[0])
    wires = 'set: "above.above[1]", reset: "above.above[2]"'
    np.testing.assert_array_equal(found("Latch", inputs=wires, others=TRUTH)[0], expected)


def test_state_machine():
    """Three states: 1 → 2 where the first is true, 2 → 3 where the second is, 3 → 1 where none is."""
    table = [[1, 2, 1, 2], [2, 2, 3, 3], [1, 3, 3, 3]]
    state, expected = 1, []
    for k in range(COUNT):
        expected.append(10.0 * state)
        state = table[state - 1][B[k, 0] + 2 * B[k, 1]]
    y = found("StateMachine", f"table: {table}, values: [10, 20, 30]", inputs="u: above.above", others=TRUTH)[0]
    np.testing.assert_array_equal(y, expected)
    assert {10.0, 20.0, 30.0} == set(expected)


def test_a_link_that_drops_out_holds_its_last_value():
    y, valid = found("DropOut", "begin: [0.31, 1.01], end: [0.5, 1.2]", outputs=("y", "valid"))
    lost = ((AT >= 0.31) & (AT < 0.5 - 1e-9)) | ((AT >= 1.01) & (AT < 1.2 - 1e-9))
    np.testing.assert_array_equal(valid, ~lost)
    expected = U.copy()
    for k in np.flatnonzero(lost):
        expected[k] = expected[k - 1]
    np.testing.assert_allclose(y, expected, atol=1e-14)


def test_what_happens_at_crossings_is_at_their_instants():
    """Not sampled: sin(2 pi 2 t + 0.3) rises through zero every 0.5 s, and its square's integral is known."""
    two = "  wave: {block: Sine, parameters: {frequency: 2, phase: 0.3}}\n  t: {block: Ramp}\n"
    run = run_block("SampleAndHold", "", "u: t.y, trigger: wave.y", two, step=0.0125)
    first = (2 * math.pi - 0.3) / (4 * math.pi)
    passed = np.floor((run["time"] - first) / 0.5)
    np.testing.assert_allclose(run["y"], np.where(passed >= 0, first + 0.5 * passed, 0.0), atol=1e-12)
    run = run_block("Counter", "", "u: wave.y", two, ("count",), step=0.0125)
    np.testing.assert_array_equal(run["count"], passed + 1)


def test_a_comparison_with_hysteresis():
    two = "  wave: {block: Sine, parameters: {frequency: 1}}\n"
    run = run_block("Compare", "threshold: 0.5, hysteresis: 1", "u: wave.y", two, ("above",), step=0.0125)
    phase = run["time"] % 1.0
    expected = (phase >= 1 / 12) & (phase <= 7 / 12)  # above 1/2 until below -1/2
    sure = np.minimum(abs(phase - 1 / 12), abs(phase - 7 / 12)) > 1e-9
    np.testing.assert_array_equal(run["above"][sure], expected[sure])
