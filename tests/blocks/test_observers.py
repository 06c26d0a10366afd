"""Finite-time observer (45), neural observer (10), (13), (22), and its network (6), (7)."""

import numpy as np
import pytest

from cosim.authoring.rules import Course
from cosim.blocks.finite_time_observer import FiniteTimeObserver
from cosim.blocks.neural_observer import NeuralObserver
from cosim.blocks.radial_basis import activations, weighted_sum
from cosim.blocks.signed_power import common_root
from cosim.blocks.stability_conditions import lyapunov_matrix, network_covers_run, observer_region, observer_stable

CENTRES = np.arange(-2.0, 6.0)
GAMMA_1 = np.array([1.0, 5.0, 50.0, 200.0, 10000.0])
GAMMA_2 = np.array([0.05, 0.25, 5.0, 20.0, 100.0])


def sgn(e, power):
    return np.sign(e) * np.abs(e) ** power


def gaussian(x, v, centres, width):
    y = np.concatenate((x, v))
    return np.exp(-((y[:, np.newaxis] - centres) ** 2).sum(axis=0) / width**2)


@pytest.mark.parametrize("centres", [CENTRES, np.array([0.0]), np.array([-1.0, 0.5, 3.0]), np.linspace(-60, 60, 25)])
@pytest.mark.parametrize("place", [-400.0, -3.0, 0.2, 2.5, 55.0])
def test_activations(centres, place):
    rng = np.random.default_rng(3)
    x, v, phi = place + rng.normal(size=3), place + rng.normal(size=3), np.zeros(len(centres))
    for width in (8.0, 2.0):
        largest = activations(x, v, centres, width, phi)
        np.testing.assert_allclose(phi, gaussian(x, v, centres, width), rtol=1e-10, atol=1e-200)
        assert largest == phi.max()


def test_weighted_sum():
    rng = np.random.default_rng(4)
    weights, phi, w = rng.normal(size=(8, 3)), rng.normal(size=8), np.ones(3)
    weighted_sum(weights, phi, w)
    np.testing.assert_allclose(w, weights.T @ phi, rtol=1e-13)


@pytest.mark.parametrize("beta_1", [2 / 3, 0.75, 0.6])
def test_finite_time_observer(beta_1):
    rng = np.random.default_rng(5)
    x, u, x_hat, v_hat, w_hat = rng.normal(size=(5, 3))
    g = rng.normal(size=(3, 3))
    given, s_1, s_2, *d = np.zeros((6, 3))
    FiniteTimeObserver.outputs(x, x_hat, beta_1, common_root(beta_1), given, s_1, s_2)
    FiniteTimeObserver.derivatives(u, g, v_hat, w_hat, s_1, s_2, 8.0, 7.0, 6.0, *d)
    e, beta_2 = x_hat - x, 2 * beta_1 - 1
    np.testing.assert_allclose(d[0], v_hat - 8.0 * sgn(e, beta_1), rtol=1e-13)
    np.testing.assert_allclose(d[1], w_hat - 7.0 * sgn(e, beta_2) + g @ u, rtol=1e-13)
    np.testing.assert_allclose(d[2], -6.0 * sgn(e, beta_2), rtol=1e-13)


def neural(x, u, g, x_hat, v_hat, W_hat, gamma_1, gamma_2, beta_1=2 / 3):
    """The block's (d x_hat, d v_hat, d W_hat, w_hat)."""
    root, lower = np.zeros(1, int), np.zeros(len(gamma_1))
    NeuralObserver.calculate(beta_1, 1.0, root, lower)
    e, s_1, s_2, w_hat, d_x, d_v = np.zeros((6, 3))
    phi, d_W = np.zeros(8), np.zeros((8, 3))
    NeuralObserver.outputs_correction(x, x_hat, beta_1, root[0], e, s_1, s_2)
    NeuralObserver.outputs(x, v_hat, W_hat, CENTRES, 8.0, phi, np.zeros(1), w_hat)
    NeuralObserver.derivatives(
        u, g, v_hat, W_hat, w_hat, s_1, s_2, phi, 8.0, 7.0, gamma_1, gamma_2, lower, d_x, d_v, d_W
    )
    return d_x, d_v, d_W, w_hat


@pytest.mark.parametrize(
    ("size", "band"), [(5.0, 0), (1.0, 0), (0.5, 1), (0.1, 1), (0.05, 2), (2e-3, 3), (1e-3, 3), (9e-4, 4), (0.0, 4)]
)
def test_neural_observer_in_each_band(size, band):
    """size: the norm of sgn^beta_1(e), which selects the gains."""
    rng = np.random.default_rng(6)
    x, u, v_hat = rng.normal(size=(3, 3))
    g, W_hat = rng.normal(size=(3, 3)), rng.normal(size=(8, 3))
    s = np.array([0.6, -0.8, 0.0]) * size * (1 + 1e-12)
    x_hat = x - sgn(s, 3 / 2)
    d_x, d_v, d_W, w_hat = neural(x, u, g, x_hat, v_hat, W_hat, GAMMA_1, GAMMA_2)
    e, phi = x - x_hat, gaussian(x, v_hat, CENTRES, 8.0)
    np.testing.assert_allclose(w_hat, W_hat.T @ phi, rtol=1e-12)
    np.testing.assert_allclose(d_x, v_hat + 8.0 * sgn(e, 2 / 3), rtol=1e-12)
    np.testing.assert_allclose(d_v, w_hat + 7.0 * sgn(e, 1 / 3) + g @ u, rtol=1e-12)
    norm = np.linalg.norm(sgn(e, 2 / 3))
    expected = GAMMA_1[band] * np.outer(phi, sgn(e, 2 / 3)) - GAMMA_2[band] * norm * W_hat
    np.testing.assert_allclose(d_W, expected, rtol=1e-11, atol=1e-18)


def test_one_band_is_static_gains():
    rng = np.random.default_rng(7)
    x, u, v_hat, x_hat = rng.normal(size=(4, 3))
    g, W_hat = rng.normal(size=(3, 3)), rng.normal(size=(8, 3))
    static = neural(x, u, g, x_hat, v_hat, W_hat, np.array([200.0]), np.array([20.0]))
    same = neural(x, u, g, x_hat, v_hat, W_hat, np.full(5, 200.0), np.full(5, 20.0))
    for one, other in zip(static, same, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("block", [FiniteTimeObserver, NeuralObserver])
def test_starts_at_the_measured_position(block):
    x_hat = np.zeros(3)
    block.start(np.array([1.0, 2.0, 3.0]), x_hat)
    assert x_hat.tolist() == [1.0, 2.0, 3.0]


def test_finite_time_observer_finds_a_constant_uncertainty():
    h, x, v = 1e-3, np.zeros(1), np.zeros(1)
    hat = np.zeros((3, 1))
    w = np.array([1.5])
    for _ in range(6000):
        e, *s, d = np.zeros(1), *np.zeros((2, 1)), np.zeros((3, 1))
        FiniteTimeObserver.outputs(x, hat[0], 2 / 3, 3, e, *s)
        FiniteTimeObserver.derivatives(np.zeros(1), np.eye(1), *hat[1:], *s, 8.0, 8.0, 6.0, *d)
        x, v, hat = x + h * v, v + h * w, hat + h * d
    assert abs(hat[1, 0] - v[0]) < 0.05
    assert abs(hat[2, 0] - 1.5) < 0.3


def test_lyapunov_matrix_solves_its_equation():
    p, sigma = lyapunov_matrix(8.0, 8.0, 2 / 3)
    a = np.array([[-16 / 3, 2 / 3], [-8.0, 0.0]])
    np.testing.assert_allclose(a.T @ p + p @ a, -sigma * np.eye(2), atol=1e-12)


def test_theorem_1_holds_for_the_papers_gains():
    holds, numbers = observer_stable(8.0, 8.0, 2 / 3)
    assert holds
    assert "-4" in numbers
    assert "-1.333" in numbers


def test_region_of_theorem_2_depends_on_the_bands():
    holds, numbers = observer_region(8.0, 8.0, 2 / 3, GAMMA_1, GAMMA_2, 1.0, CENTRES, 8.0, 3)
    assert holds is False
    assert "W_M = 0 and epsilon_M = 0 are assumed" in numbers
    wide = observer_region(8.0, 8.0, 2 / 3, np.array([1.0]), np.array([20.0]), 5.0, CENTRES, 8.0, 3)
    assert wide[0] is None, wide[1]  # as K is a lower bound: nobody can say that it holds


def test_the_bound_of_theorem_2_is_the_root_of_its_derivation():
    """K solves -sigma(Q_2)/2 K^(3 - 1/beta_1) + k_2^2/(4 k_1 gamma_2) K = 0, from (16) with W_M = epsilon_M = 0.

    k_1 = ||C|| = 1, k_2 = phi_M ||P_2 B + gamma_1 C^T||, and phi_M is the largest ||phi|| of any y.
    """
    alpha_1, alpha_2, beta_1 = 8.0, 7.0, 0.7
    numbers = observer_region(alpha_1, alpha_2, beta_1, GAMMA_1, GAMMA_2, 1.0, CENTRES, 8.0, 3)[1]
    p, sigma = lyapunov_matrix(alpha_1, alpha_2, beta_1)
    heights = np.linspace(-10, 10, 4001)
    phi_m = max(np.linalg.norm(gaussian(np.full(3, h), np.full(3, h), CENTRES, 8.0)) for h in heights)
    bounds = [float(part.split()[0]) for part in numbers.partition("band by band: ")[2].split(";")]
    for gamma_1, gamma_2, k in zip(GAMMA_1, GAMMA_2, bounds, strict=True):
        k_2 = phi_m * np.linalg.norm(p @ [0.0, 1.0] + gamma_1 * np.array([1.0, 0.0]))
        terms = sigma / 2 * k ** (3 - 1 / beta_1), k_2**2 / (4 * gamma_2) * k
        assert terms[0] == pytest.approx(terms[1], rel=2e-2)  # K is told with three digits
    limits = [float(part.split()[2]) for part in numbers.partition("band by band: ")[2].split(";")]
    assert limits == pytest.approx([1.0, 0.1, 0.01, 0.001, 0.001])  # 10^(c_v - j), the last 10^(c_v - n_v + 1)


@pytest.mark.parametrize("centres", [CENTRES, np.array([0.0, 1.0, 4.0])])
def test_coverage_is_the_largest_activation(centres):
    rng = np.random.default_rng(8)
    for x, v in rng.normal(scale=4.0, size=(50, 2, 3)):
        phi, coverage, w_hat = np.zeros(centres.size), np.zeros(1), np.zeros(3)
        NeuralObserver.outputs(x, v, np.zeros((centres.size, 3)), centres, 8.0, phi, coverage, w_hat)
        assert coverage[0] == phi.max() == pytest.approx(gaussian(x, v, centres, 8.0).max(), rel=1e-12)


def test_a_network_that_feels_nothing_is_told():
    assert network_covers_run(Course(0.37, 5.0, 1.0, 0.0))[0] is True  # 1/e = 0.3679
    holds, numbers = network_covers_run(Course(0.36, 34.0, 1.0, 0.0))
    assert holds is False and "0.36 at t = 34 s" in numbers
