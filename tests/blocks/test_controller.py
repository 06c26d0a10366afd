"""Sliding-mode controller (26), (30), (33), and the conditions of Theorem 3."""

import numpy as np
import pytest

from blocks import stability_conditions
from blocks.controller import SlidingModeController
from blocks.stability_conditions import formation_reached, network_matrices, references_apart, topology_slow
from cosim.rules import Source

RING = np.array([[4], [3], [1], [5], [6], [2]], np.int32)


def laplacian(neighbours, weights):
    robots = len(neighbours)
    a = np.zeros((robots, robots))
    for i in range(robots):
        for j, weight in zip(neighbours[i], weights[i], strict=True):
            if j >= 0:
                a[i, j] = weight
    return np.diag(a.sum(axis=1)) - a


def test_control_law():
    rng = np.random.default_rng(12)
    robots, n = 5, 3
    x, x_d, v_hat, w_hat, xi_2, xi_3, F = rng.normal(size=(7, robots, n))
    g_inverse = rng.normal(size=(robots, n, n))
    neighbours = np.array([[1, 2, -1], [0, -1, -1], [0, 3, 4], [-1, -1, -1], [1, 3, -1]], np.int32)
    weights = np.where(neighbours >= 0, rng.uniform(0, 1, neighbours.shape), 0.0)
    lambda_, b, c = rng.uniform(1, 3, robots), rng.uniform(0, 2, robots), 2.5
    delta_x, delta_v, e_x, e_v, s_hat, u = np.ones((6, robots, n))
    SlidingModeController.outputs(
        *(x, x_d, v_hat, w_hat, xi_2, xi_3, F, g_inverse, neighbours, weights, c, lambda_, b),
        *(delta_x, delta_v, e_x, e_v, s_hat, u),
    )
    pinned = laplacian(neighbours, weights) + np.diag(b)
    slope = lambda_[:, np.newaxis]
    np.testing.assert_allclose(e_x, pinned @ (x - x_d), rtol=1e-12)
    np.testing.assert_allclose(e_v, pinned @ (v_hat - xi_2), rtol=1e-12)
    expected_s = pinned @ (v_hat - xi_2) + slope * (pinned @ (x - x_d))
    np.testing.assert_allclose(s_hat, expected_s, rtol=1e-11)
    expected_a = -c * expected_s - w_hat - slope * (v_hat - xi_2) - (x - x_d) + xi_3 + F
    np.testing.assert_allclose(u, np.einsum("ikq,iq->ik", g_inverse, expected_a), rtol=1e-11, atol=1e-12)


def dense_matrices(hears, b):
    """Lemma 2 with dense matrices."""
    robots = len(hears)
    a = np.zeros((robots, robots))
    for i, row in enumerate(hears):
        a[i, [j - 1 for j in row if j]] = 1.0
    pinned = np.diag(a.sum(axis=1)) - a + np.diag(b)
    p = 1.0 / np.linalg.solve(pinned, np.ones(robots))
    q_1 = np.diag(p) @ pinned + pinned.T @ np.diag(p)
    return p, np.linalg.eigvalsh(q_1)[0], np.linalg.svd(pinned, compute_uv=False)[-1]


@pytest.mark.parametrize("dense", [300, 0])
def test_network_matrices(dense, monkeypatch):
    monkeypatch.setattr(stability_conditions, "DENSE", dense)
    rng = np.random.default_rng(13)
    hears = np.array([[(i + 1) % 20 + 1, (i + 7) % 20 + 1] for i in range(20)], np.int32)
    b = rng.uniform(0.1, 2.0, 20)
    for found, expected in zip(network_matrices(hears, b), dense_matrices(hears, b), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_theorem_3_on_the_papers_ring():
    p, q_1, sigma = network_matrices(RING, np.full(6, 2.0))
    np.testing.assert_allclose(p, 2.0)  # L_1 + B has row sums of 2
    assert (q_1, sigma) == (pytest.approx(8.0), pytest.approx(2.0))
    topology = Source("RangeTopology", {"hears": RING, "eta_1": np.array(0.2), "eta_2": np.array(14.0)})
    holds, numbers = formation_reached(topology, np.full(6, 2.0), 2.0)
    assert holds
    assert "sigma(Q_1) = 8" in numbers
    assert "admits L_M < 8" in numbers
    holds, numbers = topology_slow(topology, np.full(6, 2.0), np.full(6, 2.0))
    assert holds
    assert "admits L_M < 4" in numbers


def test_theorem_3_is_violated_by_low_gains():
    topology = Source("RangeTopology", {"hears": RING, "eta_1": np.array(0.2), "eta_2": np.array(14.0)})
    assert not formation_reached(topology, np.full(6, 2.0), 0.3)[0]
    assert not topology_slow(topology, np.full(6, 2.0), np.full(6, 0.5))[0]
    static = Source("StaticTopology", {"hears": RING})
    assert topology_slow(static, np.full(6, 2.0), np.full(6, 0.5))[0]


def test_references_have_to_be_apart():
    angle = np.arange(1, 7) * np.pi / 3
    field = Source("PotentialField", {"radii": np.full(6, 0.3), "epsilon_2": np.array(2.0)})
    for radius, holds in ((1.8, True), (1.1, False)):
        circle = Source("CircularFormationReference", {"angle": angle, "radius": np.array([radius])})
        assert references_apart(circle, field)[0] is holds
    assert references_apart(None, field)[0]
    assert references_apart(Source("Other", {}), field)[0]
