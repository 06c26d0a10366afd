"""Measuring blocks: errors, and the gaps between robots."""

import math

import numpy as np
import pytest

from blocks import cell_grid
from blocks.differentiator_errors import DifferentiatorErrors
from blocks.edge_weights import EdgeWeights, edges_are_pairs
from blocks.estimation_errors import EstimationErrors
from blocks.formation_errors import FormationErrors
from blocks.pair_gaps import PairGaps, pairs_are_robots
from blocks.separation import Separation


def test_estimation_errors():
    x, v, w, x_hat, v_hat, w_hat = np.random.default_rng(14).normal(size=(6, 7, 3))
    N_x, N_v, N_w = np.zeros((3, 1))
    EstimationErrors.outputs(x, v, w, x_hat, v_hat, w_hat, N_x, N_v, N_w)
    assert N_x[0] == pytest.approx(np.linalg.norm(x - x_hat, axis=1).sum(), rel=1e-13)
    assert N_v[0] == pytest.approx(np.linalg.norm(v - v_hat, axis=1).sum(), rel=1e-13)
    assert N_w[0] == pytest.approx(np.linalg.norm(w - w_hat, axis=1).sum(), rel=1e-13)


def test_differentiator_errors():
    xi_2, xi_3, dx_d, ddx_d = np.random.default_rng(15).normal(size=(4, 7, 3))
    first, second = np.zeros((2, 1))
    DifferentiatorErrors.outputs(xi_2, xi_3, dx_d, ddx_d, first, second)
    assert first[0] == pytest.approx(np.linalg.norm(xi_2 - dx_d, axis=1).max(), rel=1e-13)
    assert second[0] == pytest.approx(np.linalg.norm(xi_3 - ddx_d, axis=1).max(), rel=1e-13)


def test_formation_errors():
    rng = np.random.default_rng(16)
    x, v, x_d, dx_d, s_hat = rng.normal(size=(5, 3, 3))
    neighbours, weights = np.array([[1, 2], [2, -1], [0, -1]], np.int32), np.array([[1, 0.2], [1, 0], [1, 0.0]])
    lambda_, b = np.array([2.0, 3.0, 1.0]), np.array([2.0, 0.0, 1.0])
    work, found = np.zeros((2, 3, 3)), np.zeros((4, 1))
    FormationErrors.outputs(x, v, x_d, dx_d, s_hat, neighbours, weights, lambda_, b, *work, *found)
    pinned = np.array([[1.2 + 2, -1, -0.2], [0, 1, -1], [-1, 0, 1 + 1]])
    e_x = pinned @ (x - x_d)
    s = pinned @ (v - dx_d) + lambda_[:, np.newaxis] * e_x
    expected = [np.linalg.norm(m) for m in (x - x_d, e_x, s, s_hat)]
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-12)


def separation(x, radii, capacity=50):
    """The smallest gap and the touching pairs."""
    robots = len(x)
    cells, work = np.zeros((robots, 2), np.int64), np.zeros((3, robots), np.int64)
    touching, min_gap = np.zeros((capacity, 2), np.int32), np.zeros(1)
    Separation.outputs(x, radii, cells, *work, touching, min_gap)
    return min_gap[0], touching


def all_gaps(x, radii):
    gaps = np.sqrt(((x[:, np.newaxis] - x) ** 2).sum(axis=2)) - radii[:, np.newaxis] - radii
    gaps[np.tril_indices(len(x))] = np.inf
    return gaps


@pytest.mark.parametrize("robots", [2, 6, 33, 150])
@pytest.mark.parametrize("side", [3.0, 20.0, 2000.0])
def test_smallest_gap_of_all_pairs(robots, side):
    rng = np.random.default_rng(robots)
    x, radii = rng.uniform(-side, side, (robots, 2)), rng.uniform(0.01, 0.05, robots)
    min_gap, touching = separation(x, radii)
    gaps = all_gaps(x, radii)
    assert min_gap == pytest.approx(gaps.min(), rel=1e-12, abs=1e-14)
    rows = touching[touching[:, 0] > 0]
    assert rows.tolist() == (np.argwhere(gaps <= 0) + 1).tolist()


def test_grid_and_all_pairs_agree_bit_for_bit(monkeypatch):
    rng = np.random.default_rng(17)
    x, radii = rng.uniform(-30, 30, (100, 2)), rng.uniform(0.2, 0.3, 100)
    by_grid = separation(x, radii)
    monkeypatch.setattr(cell_grid, "SMALL", 100)
    by_pairs = separation(x, radii)
    assert by_grid[0] == by_pairs[0]
    assert np.array_equal(by_grid[1], by_pairs[1])


def test_a_single_robot_has_no_gap():
    assert separation(np.zeros((1, 2)), np.ones(1))[0] == math.inf


def test_many_robots_far_apart_are_seen_all():
    x = np.column_stack((np.arange(40) ** 2 * 1e3 + 1e3, np.zeros(40)))
    assert separation(x, np.full(40, 0.1))[0] == pytest.approx(1000 - 0.2)


def test_collisions_are_remembered_once_with_their_first_time():
    collisions = np.full((3, 3), math.nan)
    steps = [(0.1, [[0, 0], [0, 0]]), (0.2, [[1, 6], [0, 0]]), (0.3, [[1, 6], [2, 3]]), (0.4, [[2, 3], [0, 0]])]
    for time, touching in steps:
        Separation.update(time, np.array(touching, np.int32), collisions)
    assert collisions[:2].tolist() == [[1, 6, 0.2], [2, 3, 0.3]]
    assert np.isnan(collisions[2]).all()


def test_too_many_collisions_stop_the_run():
    with pytest.raises(ValueError, match="collision_capacity"):
        separation(np.zeros((6, 2)), np.ones(6), capacity=14)
    full = np.array([[1.0, 2.0, 0.0]])
    with pytest.raises(ValueError, match="collision_capacity"):
        Separation.update(1.0, np.array([[3, 4]], np.int32), full)


def test_pair_gaps():
    x, radii = np.random.default_rng(18).normal(size=(6, 2)), np.linspace(0.2, 0.3, 6)
    pairs, gaps = np.array([[1, 6], [3, 2]], np.int32), np.zeros(2)
    PairGaps.outputs(x, radii, pairs, gaps)
    expected = [np.linalg.norm(x[i - 1] - x[j - 1]) - radii[i - 1] - radii[j - 1] for i, j in pairs]
    np.testing.assert_allclose(gaps, expected, rtol=1e-13)
    assert pairs_are_robots(pairs, 6)[0]
    assert not pairs_are_robots(pairs, 5)[0]
    assert not pairs_are_robots(np.array([[2, 2]]), 6)[0]


def test_edge_weights_are_the_elements_of_a_2_alone():
    neighbours = np.array([[1, 2], [2, -1], [-1, -1]], np.int32)
    weights = np.array([[1.0, 0.15], [0.2, 0.0], [0.0, 0.0]])
    hears = np.array([[2], [0], [1]], np.int32)  # 1 hears 2 and 3 hears 1 in G1
    edges = np.array([[1, 2], [1, 3], [2, 3], [3, 2]], np.int32)
    a_2 = np.full(4, np.nan)
    EdgeWeights.outputs(neighbours, weights, hears, edges, a_2)
    assert a_2.tolist() == [0.0, 0.15, 0.2, 0.0]


def test_edges_name_two_robots():
    assert edges_are_pairs(np.array([[1, 3]]), 3)[0]
    assert not edges_are_pairs(np.array([[1, 1]]), 3)[0]
    assert not edges_are_pairs(np.array([[0, 2]]), 3)[0]
