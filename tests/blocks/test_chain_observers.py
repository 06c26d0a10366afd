"""Observers of chains of integrators, and the formation's controller of any order, against closed forms and scipy."""

import inspect
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_are
from scipy.signal import buttap
from scipy.special import gammainc

from cosim.authoring.variables import State
from cosim.blocks.chain_controller import ChainFormationController
from cosim.blocks.linear_observers import (
    HighGainObserver,
    KalmanObserver,
    LinearExtendedStateObserver,
    LuenbergerObserver,
)
from cosim.blocks.nonlinear_extended_state_observer import NonlinearExtendedStateObserver, fal
from cosim.blocks.sliding_mode_observer import SlidingModeObserver
from cosim.blocks.super_twisting_observer import SuperTwistingObserver
from cosim.engine import run

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


def gains(block, size, *values):
    found = [np.full(size, np.nan)]
    block.calculate(*values, *found)
    return found[0]


@pytest.mark.parametrize("poles", [[3.0], [3.0, 7.0], [1.0, 2.0, 5.0, 30.0]])
def test_luenbergers_gains_are_the_polynomial_of_its_poles(poles):
    found = gains(LuenbergerObserver, len(poles), np.array(poles))
    np.testing.assert_allclose(found, np.poly(-np.array(poles))[1:], rtol=1e-14)


@pytest.mark.parametrize("order", [1, 2, 5])
def test_the_linear_extended_state_observer_has_all_poles_at_its_bandwidth(order):
    found = gains(LinearExtendedStateObserver, order + 1, 12.0)
    np.testing.assert_allclose(found, np.poly([-12.0] * (order + 1))[1:], rtol=1e-14)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_kalmans_gains_solve_the_riccati_equation_and_are_butterworths(order):
    found, m = gains(KalmanObserver, order + 1, 3.0, 0.02), order + 1
    a, c, w = np.eye(m, k=1), np.eye(1, m), np.zeros((m, m))
    w[-1, -1] = 3.0
    p = solve_continuous_are(a.T, c.T, w, [[0.02]])
    np.testing.assert_allclose(found, (p @ c.T / 0.02)[:, 0], rtol=1e-8)
    np.testing.assert_allclose(found, np.poly(buttap(m)[1] * (3.0 / 0.02) ** (0.5 / m))[1:].real, rtol=1e-12)


def test_the_high_gain_observers_last_correction_is_its_uncertainty():
    own, chain = np.zeros(3), np.zeros(3)
    HighGainObserver.calculate(np.array([3.0, 3.0, 1.0]), 0.1, own, chain)
    np.testing.assert_allclose(own, [30.0, 300.0, 1000.0], rtol=1e-14)
    np.testing.assert_allclose(chain, [30.0, 300.0, 0.0], rtol=1e-14)


def called(function, arrays):
    function(*(arrays[name] for name in inspect.signature(function).parameters))


def observed(block, parameters, order=2, w=lambda t: 1.5, x=None, stop=1.0, h=0.004, euler=False):
    """Run a block alone, by Runge's and Kutta's method or Euler's: times, and x_hat, v_hat, w_hat at each.

    The chain begins at rest, and is driven by w + 2 * 0.3; of x, the closed form; of w none, a constant.
    """
    x = x or (lambda t: 2.1 * t**order / math.factorial(order))
    states = {"z": (order, 1), "w_hat": (1,), "x_hat": (1,), "v_hat": (1,)}
    arrays = {**{name: np.zeros(shape) for name, shape in states.items()}, "e": np.zeros(1)}
    arrays |= {**parameters, "u": np.array([0.3]), "g": np.array([[2.0]]), "x": np.array([x(0.0)])}
    arrays |= {"gains": np.zeros(order + ("w_hat" in continuous(block))), "last": np.zeros(order)}
    if hasattr(block, "calculate"):
        called(block.calculate, arrays)
    functions = [f for name, f in vars(block).items() if name.startswith("outputs")]

    def slopes(t, z):
        arrays["x"][:] = x(t)
        for name, value in zip(continuous(block), z, strict=True):
            arrays[name][:] = value
            arrays[f"d_{name}"] = np.zeros_like(value)
        for function in functions:
            called(function, arrays)
        called(block.derivatives, arrays)
        return [arrays[f"d_{name}"].copy() for name in continuous(block)]

    z, rows = [arrays[name].copy() for name in continuous(block)], []
    times = np.arange(round(stop / h) + 1) * h
    for t in times:
        k_1 = slopes(t, z)
        rows.append([arrays[name].item(0) for name in ("x_hat", "v_hat", "w_hat")])
        if euler:
            z = [a + h * b for a, b in zip(z, k_1, strict=True)]
            continue
        k_2 = slopes(t + h / 2, [a + h / 2 * b for a, b in zip(z, k_1, strict=True)])
        k_3 = slopes(t + h / 2, [a + h / 2 * b for a, b in zip(z, k_2, strict=True)])
        k_4 = slopes(t + h, [a + h * b for a, b in zip(z, k_3, strict=True)])
        z = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(z, k_1, k_2, k_3, k_4, strict=True)]
    return times, *np.array(rows).T


def continuous(block):
    return [name for name, v in block.declaration.variables.items() if isinstance(v, State)]


@pytest.mark.parametrize("order", [2, 3])
def test_the_extended_state_observer_finds_a_constant_uncertainty_as_a_chain_of_lags(order):
    """w_hat/w = (omega / (s + omega))^(n+1): a step's answer is the regularized gamma function P(n + 1, omega t)."""
    t, _, _, w_hat = observed(LinearExtendedStateObserver, {"omega": 8.0}, order)
    np.testing.assert_allclose(w_hat, 1.5 * gammainc(order + 1, 8.0 * t), atol=1e-5)  # rk4: (omega h)^4 / 120 = 9e-9


@pytest.mark.parametrize(
    ("block", "parameters", "l_1", "l_2", "told"),
    [
        (LuenbergerObserver, {"poles": np.array([5.0, 9.0])}, 14.0, 45.0, 0.0),
        (HighGainObserver, {"alpha": np.array([3.0, 2.0]), "epsilon": 0.1}, 30.0, 200.0, 200.0),
    ],
)
def test_observers_without_a_state_for_the_uncertainty_keep_an_error(block, parameters, l_1, l_2, told):
    """In the end l_2 e = w and v - v_hat = l_1 e; w_hat is l_2 e where it is told, which is w."""
    t, x_hat, v_hat, w_hat = observed(block, parameters, stop=3.0, h=0.01)
    e = 1.5 / l_2
    assert 0.5 * 2.1 * t[-1] ** 2 - x_hat[-1] == pytest.approx(e, rel=1e-4)
    assert 2.1 * t[-1] - v_hat[-1] == pytest.approx(l_1 * e, rel=1e-4)
    assert w_hat[-1] == pytest.approx(told * e, rel=1e-4, abs=1e-12)


def fal_of_han(e, a, delta):
    return e / delta ** (1 - a) if abs(e) <= delta else abs(e) ** a * np.sign(e)


def test_fal_is_hans_and_continuous():
    for e in (-2.0, -0.1, -0.05, 0.0, 0.03, 0.1, 0.7):
        assert fal(e, 0.4, 0.1) == pytest.approx(fal_of_han(e, 0.4, 0.1), rel=1e-14)
    assert fal(0.1, 0.4, 0.1) == pytest.approx(fal(0.1 + 1e-12, 0.4, 0.1), rel=1e-10)


def wave(t):
    return 2.0 * np.sin(3.0 * t)


def driven(t):
    """x from rest with x'' = wave + 0.6."""
    return 0.3 * t**2 + 2.0 * (t / 3.0 - np.sin(3.0 * t) / 9.0)


def test_the_nonlinear_extended_state_observer_is_scipys():
    """Beside an integration by scipy of its printed equations."""
    parameters = {"beta": np.array([40.0, 200.0, 300.0]), "exponent": np.array([1.0, 0.5, 0.25]), "delta": 0.02}
    t, *found = observed(NonlinearExtendedStateObserver, parameters, w=wave, x=driven)

    def slope(s, z):
        e = z[0] - driven(s)
        first, second = fal_of_han(e, 0.5, 0.02), fal_of_han(e, 0.25, 0.02)
        return [z[1] - 40 * e, z[2] - 200 * first + 0.6, -300 * second]

    solved = solve_ivp(slope, (0, 1), [0.0, 0.0, 0.0], "LSODA", t, rtol=1e-8, atol=1e-10).y
    np.testing.assert_allclose(found, solved, atol=2e-4)  # fal has a corner, where all methods are of order 2


@pytest.mark.parametrize(
    ("block", "parameters", "bounds"),
    [
        (SuperTwistingObserver, {"lambda_": 3.0, "alpha": 3.3, "T": 0.05}, (2e-5, 0.03, 0.45)),
        (SlidingModeObserver, {"lipschitz": 7.0}, (1e-6, 3e-3, 0.1)),
    ],
)
def test_sliding_modes_are_exact_after_a_finite_time(block, parameters, bounds):
    """Of w = 2 sin 3t, by Euler's method with h = 1 ms: errors of x, v, w.

    The orders of h are 2, 1 and 0 (a filter that lags: 0.05 * 6 = 0.3), and 3, 1 and 1: Euler leaves
    h/2 |dw/dt| = 3e-3 in v.
    """
    t, *found = observed(block, parameters, w=wave, x=driven, stop=2.0, h=1e-3, euler=True)
    true = driven(t), 0.6 * t + 2.0 / 3.0 * (1.0 - np.cos(3.0 * t)), wave(t)
    for estimate, exact, bound in zip(found, true, bounds, strict=True):
        assert abs(estimate - exact)[t > 1.4].max() < bound


def test_agents_of_third_order_slide_as_theory_says(trajectories):
    """Remark 3. With exact estimates dS/dt = -c (L + B) S, so that S(t) is its matrix exponential."""
    network = run.load(DIAGRAMS / "third_order.yaml", ["run.stop=4", "metrics={}"])
    found = trajectories(network, "controller.S_hat", "estimation.N_x", "estimation.N_v")
    matrix = 2.0 * np.eye(6) + np.eye(6)
    for i, heard in enumerate([4, 3, 1, 5, 6, 2]):
        matrix[i, heard - 1] -= 1.0
    s, begin = found["controller.S_hat"], 2000  # after 2 s, when the differentiators have become exact
    assert np.abs(s[begin]).max() > 1.0
    for later in (500, 1000, 2000):
        expected = expm(-0.5 * matrix * later * 1e-3) @ s[begin]
        np.testing.assert_allclose(s[begin + later], expected, atol=0.02)  # L h = 20e-3: how w_hat chatters
    assert found["estimation.N_x"][begin:].max() < 1e-8
    assert found["estimation.N_v"][begin:].max() < 1e-5


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_chain_controllers_surface_is_a_binomial(order):
    """(d/dt + lambda)^(n-1), so that errors vanish at one rate."""
    m = np.zeros(order)
    ChainFormationController.calculate(3.0, m)
    np.testing.assert_allclose(m[::-1], np.poly([-3.0] * (order - 1)), rtol=1e-14)
