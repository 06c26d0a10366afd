"""Sliding-mode differentiator (29)."""

import numpy as np

from cosim.blocks.differentiator import SlidingModeDifferentiator

ETA = np.array([6.0, 8.0, 8.0, 6.0])


def sgn(e, power):
    return np.sign(e) * np.abs(e) ** power


def cascade(x_d, xi, eta, beta):
    """(29) as printed."""
    nu_1 = -eta[0] * beta ** (1 / 4) * sgn(xi[0] - x_d, 3 / 4) + xi[1]
    nu_2 = -eta[1] * beta ** (1 / 3) * sgn(xi[1] - nu_1, 2 / 3) + xi[2]
    nu_3 = -eta[2] * beta ** (1 / 2) * sgn(xi[2] - nu_2, 1 / 2) + xi[3]
    nu_4 = -eta[3] * beta * np.sign(xi[3] - nu_3)
    return np.array([nu_1, nu_2, nu_3, nu_4])


def derivatives(x_d, xi, beta):
    gains, d_xi = np.zeros(4), np.zeros((4, len(x_d)))
    SlidingModeDifferentiator.calculate(ETA, beta, gains)
    SlidingModeDifferentiator.derivatives(x_d, *xi, gains, *d_xi)
    return d_xi


def test_equals_the_printed_cascade():
    rng = np.random.default_rng(2)
    for beta in (0.03, 2.5):
        x_d, xi = rng.normal(size=5), rng.normal(size=(4, 5))
        np.testing.assert_allclose(derivatives(x_d, xi, beta), cascade(x_d, xi, ETA, beta), rtol=1e-11)


def test_rests_where_the_signal_is_met():
    xi = np.array([[1.0], [0.5], [0.25], [0.125]])
    assert derivatives(np.array([1.0]), xi, 0.03)[:, 0].tolist() == [0.5, 0.25, 0.125, 0.0]


def test_starts_on_the_signal():
    xi_1 = np.zeros(3)
    SlidingModeDifferentiator.start(np.array([1.0, -2.0, 3.0]), xi_1)
    assert xi_1.tolist() == [1.0, -2.0, 3.0]


def test_finds_derivatives_in_finite_time():
    """The error is of the order of the step, as it has to be at a sampled sign."""
    h, xi = 1e-3, np.zeros((4, 1))
    for k in range(8000):
        signal = np.array([np.sin(0.3 * k * h)])
        xi += h * derivatives(signal, xi, 0.03)
    t = 8000 * h
    assert abs(xi[1, 0] - 0.3 * np.cos(0.3 * t)) < 1e-3
    assert abs(xi[2, 0] + 0.09 * np.sin(0.3 * t)) < 1e-3
