"""Static and range-based graph (5), (44), and the cell grid that finds near robots."""

import numpy as np
import pytest

from cosim.blocks import cell_grid
from cosim.blocks.adjacency import names_robots, strongly_connected
from cosim.blocks.range_topology import RangeTopology, fading_weight
from cosim.blocks.static_topology import StaticTopology

RING = np.array([[4], [3], [1], [5], [6], [2]], np.int32)
OTHER_RING = np.array([[2], [3], [6], [5], [1], [4]], np.int32)
ETA, R_C = (0.2, 14.0, 1.1), 1.5


def work_spaces(robots):
    """What lies there before the first call."""
    return np.zeros((robots, cell_grid.FIELDS), np.int64), np.full((robots, cell_grid.SEARCHED), np.nan)


def range_lists(x, hears, capacity=64, work=None):
    robots = len(x)
    work, count = work or work_spaces(robots), np.zeros(robots, np.int32)
    neighbours, weights = np.zeros((robots, capacity), np.int32), np.zeros((robots, capacity))
    RangeTopology.outputs(x, hears, *ETA, R_C, *work, count, neighbours, weights)
    return neighbours, weights


def matrix(neighbours, weights):
    """The adjacency matrix that neighbour lists stand for."""
    robots = len(neighbours)
    a = np.zeros((robots, robots))
    for i in range(robots):
        listed = neighbours[i][neighbours[i] >= 0]
        assert np.all(np.diff(listed) > 0)
        assert np.all(neighbours[i][len(listed) :] == -1)
        a[i, listed] = weights[i, : len(listed)]
    return a


def static_matrix(hears):
    a = np.zeros((len(hears), len(hears)))
    for i, row in enumerate(hears):
        for j in row:
            if j > 0:
                a[i, j - 1] = 1.0
    return a


def expected_matrix(x, hears):
    """A_1 + A_2 of (5) and (44), over all pairs."""
    distance = np.linalg.norm(x[:, np.newaxis, :2] - x[:, :2], axis=2)
    near = np.exp(-ETA[1] * (distance - ETA[2]))
    weight = np.where(distance <= R_C, ETA[0] * near / (1 + near), 0.0)
    np.fill_diagonal(weight, 0.0)
    a_1 = static_matrix(hears)
    return np.where(a_1 > 0, a_1, weight)


def ring(robots):
    return (np.arange(robots, dtype=np.int32)[:, np.newaxis] + 1) % robots + 1


def test_static_topology():
    hears = np.array([[4, 2], [3, 0], [1, 0], [5, 3], [6, 0], [0, 2]], np.int32)
    count, neighbours, weights = np.zeros(6, np.int32), np.zeros((6, 8), np.int32), np.zeros((6, 8))
    StaticTopology.outputs(hears, count, neighbours, weights)
    assert np.array_equal(matrix(neighbours, weights), static_matrix(hears))
    assert count.tolist() == [2, 1, 1, 2, 1, 1]


@pytest.mark.parametrize("hears", [RING, OTHER_RING])
def test_range_topology_of_six(hears):
    x = np.random.default_rng(9).uniform(-1.5, 1.5, (6, 3))
    a = matrix(*range_lists(x, hears))
    np.testing.assert_allclose(a, expected_matrix(x, hears), rtol=1e-13)
    assert ((a > 0) & (a < 1)).any()


def test_range_topology_of_many_through_the_grid():
    x = np.random.default_rng(10).uniform(-8.0, 8.0, (200, 3))
    np.testing.assert_allclose(matrix(*range_lists(x, ring(200))), expected_matrix(x, ring(200)), rtol=1e-13)


@pytest.mark.parametrize(("robots", "side"), [(40, 3.0), (120, 30.0), (150, 6.0)])
def test_grid_and_all_pairs_agree_bit_for_bit(robots, side, monkeypatch):
    x = np.random.default_rng(robots).uniform(-side, side, (robots, 2))
    by_grid = range_lists(x, ring(robots))
    monkeypatch.setattr(cell_grid, "SMALL", robots)
    by_pairs = range_lists(x, ring(robots))
    assert np.array_equal(by_grid[0], by_pairs[0])
    assert by_grid[1].tobytes() == by_pairs[1].tobytes()


@pytest.mark.parametrize(("robots", "side"), [(60, 6.0), (150, 6.0), (150, 1.5)])
def test_a_list_is_used_as_long_as_it_holds(robots, side, monkeypatch):
    """Robots that wander, some faster than others; all at once in one place are more than are listed."""
    rng = np.random.default_rng(robots)
    x, speed = rng.uniform(-side, side, (robots, 2)), rng.uniform(0.0, 0.02, (robots, 1))
    work, searches, sort = work_spaces(robots), [], cell_grid.sort_into_cells
    small = cell_grid.SMALL
    for step in range(120):
        x = x + speed * rng.normal(size=x.shape)
        if step == 60:
            x[5] += 40.0  # a jump farther than any skin
        monkeypatch.setattr(cell_grid, "SMALL", small)
        monkeypatch.setattr(cell_grid, "sort_into_cells", lambda *given: searches.append(1) or sort(*given))
        by_list = range_lists(x, ring(robots), 160, work)
        monkeypatch.setattr(cell_grid, "SMALL", robots)
        by_pairs = range_lists(x, ring(robots), 160)
        assert np.array_equal(by_list[0], by_pairs[0])
        assert by_list[1].tobytes() == by_pairs[1].tobytes()
    assert 2 <= len(searches) <= 30
    assert side > 2.0 or (work[0][:, cell_grid.COUNT] < 0).any()


def test_a_list_for_less_is_not_used():
    x = np.random.default_rng(1).uniform(-3.0, 3.0, (50, 2))
    grid, searched = work_spaces(50)
    assert cell_grid.look_around(x, 1.0, grid, searched) == 1.0
    assert cell_grid.look_around(x, 0.5, grid, searched) == 1.0
    assert cell_grid.look_around(x, 2.0, grid, searched) == 2.0


def test_grid_finds_robots_exactly_in_range():
    """Multiples of the range lie on the edges of cells, where quotients are rounded either way."""
    x = np.array([[k * R_C, 0.0] for k in range(-30, 30)])
    a = matrix(*range_lists(x, ring(60)))
    near = np.abs(x[:, np.newaxis, 0] - x[:, 0]) <= R_C
    np.fill_diagonal(near, False)
    assert np.array_equal(a > 0, near | (static_matrix(ring(60)) > 0))


def test_cells_are_told_apart_in_one_bucket():
    """With few buckets many cells share one; each pair must still be met exactly once."""
    robots = 33
    x = np.random.default_rng(11).uniform(-1e4, 1e4, (robots, 2))
    x[1] = x[0] + 0.5
    grid, searched = work_spaces(robots)
    cell_grid.look_around(x, 1.0, grid, searched)
    assert [cell_grid.later(k, 0, grid) for k in range(cell_grid.later_near(0, grid))] == [1]
    assert sum(cell_grid.later_near(i, grid) for i in range(robots)) == 1


def test_full_list_stops_the_run():
    with pytest.raises(ValueError, match="capacity"):
        range_lists(np.zeros((6, 2)), RING, capacity=4)


def test_weight_fades_without_overflow():
    assert fading_weight(1.1, *ETA) == pytest.approx(0.1)
    assert fading_weight(0.0, *ETA) == pytest.approx(0.2, rel=1e-6)
    assert fading_weight(1e6, *ETA) == 0.0
    assert fading_weight(0.0, 0.2, 1e6, 1.1) == 0.2


@pytest.mark.parametrize("hears", [RING, OTHER_RING, ring(50)])
def test_rings_are_strongly_connected(hears):
    assert strongly_connected(hears)[0]
    assert names_robots(hears)[0]


@pytest.mark.parametrize("stranger", [-1, 4, 99])
def test_a_robot_that_is_not_there_connects_nobody(stranger):
    """Each rule judges by itself: what the other one says of a misspelt number keeps none from its verdict."""
    assert strongly_connected(np.array([[stranger, 2], [3, 0], [1, 0]], np.int32))[0]
    holds, numbers = strongly_connected(np.array([[stranger], [1], [2]], np.int32))
    assert (holds, numbers) == (False, "3 strongly connected parts: {1}, {2}, {3}")
    assert not names_robots(np.array([[stranger], [1], [2]], np.int32))[0]


@pytest.mark.parametrize("direction", [1, -1])
def test_both_directions_count(direction):
    """A tree that hears its root reaches all of it one way only."""
    hears = np.array([[0], [1], [1]] if direction == 1 else [[2], [3], [0]], np.int32)
    assert strongly_connected(hears) == (False, "3 strongly connected parts: {1}, {2}, {3}")


def test_broken_graphs_are_named():
    holds, numbers = strongly_connected(np.zeros((8, 1), np.int32))
    assert (holds, numbers) == (False, "8 strongly connected parts: {1}, {2}, {3}, {4}, {5}, {6}, …")
    holds, numbers = strongly_connected(np.array([[2], [1], [1]], np.int32))
    assert not holds
    assert "{1, 2}, {3}" in numbers
    for hears in ([[1], [1]], [[3], [1]], [[2, 2], [1, 0]], [[-1], [1]]):
        assert not names_robots(np.array(hears, np.int32))[0]
