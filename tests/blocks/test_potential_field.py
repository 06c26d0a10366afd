"""Artificial potential field (8), (9)."""

import numpy as np
import pytest

from cosim.blocks.potential_field import PotentialField, outer_boundary_in_range, repulsion
from cosim.wiring.conditions import Source

RADII = np.array([0.24, 0.30, 0.23, 0.31])
ALL = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]], np.int32)


def potential(distance, lower, outer, alpha):
    """Phi, (8)."""
    if not lower < distance < outer:
        return 0.0
    clearance = distance - lower
    return alpha * np.log(clearance / (outer - lower)) + alpha * (outer - distance) / clearance


def field(x, neighbours, radii=RADII):
    F, unsafe = np.ones(x.shape), np.zeros(len(x), bool)
    PotentialField.outputs(x, neighbours, radii, 2.0, 1.1, 2.0, F, unsafe)
    return F, unsafe


@pytest.mark.parametrize("distance", [0.61, 0.7, 0.9, 1.0, 1.05])
def test_force_is_the_negative_gradient_of_the_potential(distance):
    lower, outer, h = 0.6, 1.1, 1e-6
    slope = (potential(distance + h, lower, outer, 2.0) - potential(distance - h, lower, outer, 2.0)) / (2 * h)
    assert repulsion(distance, lower, outer, 2.0) == pytest.approx(-slope, rel=1e-4)


def test_potential_is_continuous_at_the_outer_boundary_and_infinite_at_the_lower_one():
    assert potential(1.1 - 1e-9, 0.6, 1.1, 2.0) == pytest.approx(0.0, abs=1e-8)
    assert potential(1.1, 0.6, 1.1, 2.0) == repulsion(1.1 + 1e-9, 0.6, 1.1, 2.0) == 0.0
    assert potential(0.6 + 1e-9, 0.6, 1.1, 2.0) > 1e8


def test_forces_of_all_pairs():
    x = np.array([[0.0, 0.0, 1.0], [0.8, 0.1, 2.0], [0.3, 0.75, 3.0], [5.0, 5.0, 4.0]])
    expected = np.zeros((4, 3))
    for i in range(4):
        for j in range(4):
            both = RADII[i] + RADII[j]
            z = x[i, :2] - x[j, :2]
            d = np.linalg.norm(z)
            if i != j and 1.1 * both < d <= 2 * both:
                expected[i, :2] += 2.0 * (2 * both - d) / (d - 1.1 * both) ** 2 * z / d
    F, unsafe = field(x, ALL)
    np.testing.assert_allclose(F, expected, rtol=1e-13)
    assert np.count_nonzero(expected) == 6
    assert not unsafe.any()


def test_only_neighbours_repel():
    x = np.array([[0.0, 0.0], [0.8, 0.0]])
    F, _ = field(x, np.array([[1, -1], [-1, -1]], np.int32), RADII[:2])
    assert F[0, 0] < 0.0
    assert F[1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("gap", [0.0, -0.1, -0.5])
def test_below_the_safe_distance_there_is_no_force_but_an_event(gap):
    x = np.array([[0.0, 0.0], [1.1 * (RADII[0] + RADII[1]) + gap, 0.0], [0.0, 9.0], [9.0, 9.0]])
    F, unsafe = field(x, ALL)
    assert not F.any()
    assert unsafe.tolist() == [True, True, False, False]
    assert PotentialField.declaration.variables["unsafe"].event


def test_robots_in_one_place_are_no_division_by_zero():
    F, unsafe = field(np.zeros((4, 2)), ALL)
    assert not F.any()
    assert unsafe.all()


def test_outer_boundary_has_to_lie_in_range():
    topology = Source("RangeTopology", {"R_c": np.array(1.2)})
    assert outer_boundary_in_range(1.9, RADII, topology)[0]
    assert not outer_boundary_in_range(2.0, RADII, topology)[0]
    assert outer_boundary_in_range(2.0, RADII, Source("StaticTopology", {}))[0]
    assert outer_boundary_in_range(2.0, RADII, None)[0]
