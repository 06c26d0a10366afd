"""The differentiator in proper discrete form: exact on polynomials, and of the orders that theory says."""

import numpy as np
import pytest

from cosim.blocks.levant_gains import RECURSIVE, write_gains
from cosim.blocks.proper_differentiator import ProperDifferentiator


def gains_of(order, lipschitz):
    gains = np.zeros(order + 1)
    ProperDifferentiator.calculate(lipschitz, gains)
    return gains


def advanced(x, z, gains, h):
    after = np.zeros_like(z)
    ProperDifferentiator.update(h, np.array([x]), z, gains, after)
    return after


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_the_gains_are_those_of_the_recursive_form(order):
    """z_i' = v_i, v_0 = -lambda_n L^(1/(n+1)) |z_0 - f|^(n/(n+1)) sgn + z_1, v_i of |z_i - v_(i-1)|^((n-i)/(n-i+1))."""
    lipschitz, rng = 2.5, np.random.default_rng(1)
    gains = np.zeros(order + 1)
    write_gains(lipschitz, gains)
    z, e = rng.normal(size=order + 1), 0.37
    previous, v = z[0] - e, []
    for i in range(order + 1):
        power = (order - i) / (order - i + 1)
        off = z[i] - previous
        factor = RECURSIVE[order - i] * lipschitz ** (1 / (order - i + 1))
        previous = -factor * np.abs(off) ** power * np.sign(off) + (z[i + 1] if i < order else 0.0)
        v.append(previous)
    expected = [-k * e ** ((order - i) / (order + 1)) + (z[i + 1] if i < order else 0.0) for i, k in enumerate(gains)]
    np.testing.assert_allclose(v, expected, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 3, 6])
def test_a_polynomial_of_its_degree_is_met_exactly(order):
    """From exact values on, with numbers that are exact in binary: no error at all."""
    h, gains = 0.25, gains_of(order, 1.0)
    polynomial = np.polynomial.Polynomial(np.arange(1.0, order + 2))
    z = np.array([[polynomial.deriv(i)(0.0)] if i else [polynomial(0.0)] for i in range(order + 1)])
    for k in range(1, 9):
        z = advanced(polynomial((k - 1) * h), z, gains, h)
        exact = [polynomial.deriv(i)(k * h) if i else polynomial(k * h) for i in range(order + 1)]
        np.testing.assert_allclose(z[:, 0], exact, rtol=1e-12 if order > 3 else 0.0)


def test_the_error_of_each_derivative_has_the_order_that_theory_says():
    """|z_i - f^(i)| <= c_i L h^(n+1-i), Livne and Levant: with half of the step 2^(n+1-i) times smaller, n = 3."""
    errors = []
    for h in (0.04, 0.02, 0.01):
        gains, z, worst = gains_of(3, 1.0), np.zeros((4, 1)), np.zeros(4)
        for k in range(round(16.0 / h)):
            z = advanced(np.sin(k * h), z, gains, h)
            t = (k + 1) * h
            if t > 11.0:
                exact = [np.sin(t), np.cos(t), -np.sin(t), -np.cos(t)]
                worst = np.maximum(worst, np.abs(z[:, 0] - exact))
        errors.append(worst)
    orders = np.log2(np.array(errors[:-1]) / errors[1:]).mean(axis=0)
    np.testing.assert_allclose(orders, [4.0, 3.0, 2.0, 1.0], atol=0.3)


def test_eulers_method_errs_by_half_a_step_and_this_one_does_not():
    """At the formation's step of 1 ms: h/2 |f''| = 5e-4 is what Euler's method leaves in the first derivative."""
    h, gains, z = 1e-3, gains_of(3, 1.0), np.array([[0.0], [1.0], [0.0], [-1.0]])
    for k in range(2000):
        z = advanced(np.sin(k * h), z, gains, h)
    assert abs(z[1, 0] - np.cos(2.0)) < 1e-7
    assert abs(z[2, 0] + np.sin(2.0)) < 1e-4
