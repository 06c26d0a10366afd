"""Sliding-mode controller (26), (30), (33), and the conditions of Theorem 3."""

import re

import numpy as np
import pytest

from cosim.authoring.rules import Course
from cosim.blocks.controller import SlidingModeController
from cosim.blocks.network_spectrum import network_extremes
from cosim.blocks.stability_conditions import (
    formation_reached,
    formation_reached_along,
    network_covers_reference,
    references_apart,
    topology_slow,
    topology_slow_along,
)
from cosim.wiring.conditions import Source

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
    delta_x, delta_v, e_x, e_v, s_hat, gu, u = np.ones((7, robots, n))
    SlidingModeController.outputs(
        *(x, x_d, v_hat, w_hat, xi_2, xi_3, F, g_inverse, neighbours, weights, c, lambda_, b),
        *(delta_x, delta_v, e_x, e_v, s_hat, gu, u),
    )
    pinned = laplacian(neighbours, weights) + np.diag(b)
    slope = lambda_[:, np.newaxis]
    np.testing.assert_allclose(e_x, pinned @ (x - x_d), rtol=1e-12)
    np.testing.assert_allclose(e_v, pinned @ (v_hat - xi_2), rtol=1e-12)
    expected_s = pinned @ (v_hat - xi_2) + slope * (pinned @ (x - x_d))
    np.testing.assert_allclose(s_hat, expected_s, rtol=1e-11)
    expected_a = -c * expected_s - w_hat - slope * (v_hat - xi_2) - (x - x_d) + xi_3 + F
    np.testing.assert_allclose(gu, expected_a, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(u, np.einsum("ikq,iq->ik", g_inverse, expected_a), rtol=1e-11, atol=1e-12)


TOPOLOGY = Source("RangeTopology", {"hears": RING, "eta_1": np.array(0.2), "eta_2": np.array(14.0)})
B, LAMBDA = np.full(6, 2.0), np.full(6, 2.0)


def figure(numbers, name):
    """The number behind `name` in a condition's text."""
    return float(re.search(rf"{re.escape(name)} ([-+.\de]+)", numbers)[1])


def test_theorem_3_on_the_papers_ring():
    """P_1 = 2 I, Q_1 = 2 (6 I - A - A^T) has eigenvalues from 8 to 16; L_1 + B = 3 I - A, normal, values from 2 to 4.

    A pair closing at 1 m/s changes four elements of dL_2/dt by 0.2 · 14 / 4 = 0.7 each: their norm is 1.4.
    """
    np.testing.assert_allclose(network_extremes(RING, B), [[2, 2], [8, 16], [2, 4]], rtol=1e-12)
    holds, numbers = formation_reached(TOPOLOGY, B, 2.0)
    assert holds
    assert "L_M = 1.4 1/s is assumed" in numbers
    assert (figure(numbers, "sigma(Q_1) ="), figure(numbers, "admitted <")) == (8.0, 8.0)
    assert figure(numbers, "left side") == pytest.approx(2 * 8 / 2 - 2 * 1.4 / 2)
    holds, numbers = topology_slow(TOPOLOGY, B, LAMBDA)
    assert holds
    assert "L_M = 1.4 1/s is assumed" in numbers
    assert (figure(numbers, "admitted <"), figure(numbers, "left side")) == (4.0, pytest.approx(2 - 1.4 / 2))


def test_theorem_3_is_violated_by_low_gains():
    assert formation_reached(TOPOLOGY, B, 0.3)[0] is False
    assert topology_slow(TOPOLOGY, B, np.full(6, 0.5))[0] is False
    static = Source("StaticTopology", {"hears": RING})
    assert topology_slow(static, B, np.full(6, 0.5))[0] is True


def test_theorem_3_with_another_topology_is_open():
    for topology in (None, Source("Fmu", {}), Source("MyTopology", {"hears": RING})):
        assert formation_reached(topology, B, 2.0)[0] is None
        assert topology_slow(topology, B, LAMBDA)[0] is None


@pytest.mark.parametrize(("rate", "reached", "slow"), [(3.9, True, True), (4.1, True, False), (8.1, False, False)])
def test_theorem_3_along_a_run(rate, reached, slow):
    """c = 2, lambda = 2 and the paper's ring admit L_M < 8 and L_M < 4."""
    controller = Source("SlidingModeController", {"b": B, "c": np.array(2.0), "lambda_": LAMBDA})
    course = Course(0.0, 0.0, rate, 0.148)
    for judge, expected in ((formation_reached_along, reached), (topology_slow_along, slow)):
        holds, numbers = judge(course, TOPOLOGY, controller)
        assert holds is expected
        assert f"L_M = {rate} 1/s" in numbers and "at t = 0.148 s" in numbers
        assert judge(course, None, controller)[0] is None
        assert judge(course, TOPOLOGY, Source("Fmu", {}))[0] is None


def circle(radius=1.8, angle=None, members=6, **centre):
    """References on a circle, whose centre is moved by a block with these parameters."""
    angle = np.arange(1, members + 1) * 2 * np.pi / members if angle is None else np.asarray(angle)
    path = {"speed": 0.2, "amplitude": 1.0, "frequency": 0.3, **centre}
    before = Source("SineWavePath", {name: np.asarray(value) for name, value in path.items()})
    parameters = {"angle": angle, "radius": np.array([radius])}
    return Source("CircularFormationReference", parameters, {"x_c": before}, members)


def field(radii):
    return Source("PotentialField", {"radii": np.asarray(radii), "epsilon_2": np.array(2.0)})


def test_references_have_to_be_apart():
    for radius, holds in ((1.8, True), (1.1, False)):
        assert references_apart(circle(radius), field(np.full(6, 0.3)))[0] is holds
    assert references_apart(None, field(np.full(6, 0.3)))[0] is None
    assert references_apart(Source("Other", {}), field(np.full(6, 0.3)))[0] is None
    own = Source("SineWavePath", {}, {}, 6)
    apart = Source("CircularFormationReference", circle().parameters, {"x_c": own}, 6)
    assert references_apart(apart, field(np.full(6, 0.3)))[0] is None


def test_every_pair_of_references_counts_not_the_nearest_only():
    """The outer boundary of large robots reaches farther than the next, small ones."""
    holds, numbers = references_apart(circle(), field([0.1, 0.4, 0.6, 0.1, 0.1, 0.1]))
    assert not holds and numbers == "robots 2 and 3: references 1.8 m apart, outer boundary 2 m"


def test_the_tightest_pair_of_references_is_named():
    rng = np.random.default_rng(5)
    for robots in (2, 7, 40):
        angle, radii = rng.uniform(0, 2 * np.pi, robots), rng.uniform(0.01, 0.3, robots)
        places = 5.0 * np.exp(1j * angle)
        slack = np.abs(places[:, np.newaxis] - places) - 2.0 * (radii[:, np.newaxis] + radii)
        i, j = np.argwhere(np.triu(slack == slack[np.triu_indices(robots, 1)].min(), 1))[0]
        holds, numbers = references_apart(circle(5.0, angle, robots), field(radii))
        assert numbers.startswith(f"robots {i + 1} and {j + 1}: ")
        assert holds == (slack[i, j] > 0)


CENTRES = np.arange(-2.0, 6.0)


def network(width, members=6):
    return Source("NeuralObserver", {"width": np.array([width]), "centres": CENTRES[np.newaxis]}, {}, members)


@pytest.mark.parametrize(("stop", "holds"), [(30.0, True), (60.0, False), (150.0, False)])
def test_the_network_has_to_feel_the_reference(stop, holds):
    """Remark 5: y = [x_d; dx_d/dt] of (43) to the nearest of the centres c [1, …, 1], sampled every millisecond."""
    t, farthest = np.arange(0.0, stop + 1e-3, 1e-3), []
    for i in range(1, 7):
        y = np.zeros((6, t.size))
        y[0] = 1.8 * np.cos(i * np.pi / 3) + 0.2 * t
        y[1] = 1.8 * np.sin(i * np.pi / 3) + np.sin(0.3 * t)
        y[3], y[4] = 0.2, 0.3 * np.cos(0.3 * t)
        farthest.append(np.min([np.linalg.norm(y - c, axis=0) for c in CENTRES], axis=0).max())
    found, numbers = network_covers_reference(circle(), network(8.0), stop)
    assert found is holds
    assert figure(numbers, f"robot {np.argmax(farthest) + 1}: y is") == pytest.approx(max(farthest), rel=1e-3)
    assert network_covers_reference(circle(), network(1.001 * max(farthest)), stop)[0] is True
    assert network_covers_reference(circle(), network(0.999 * max(farthest)), stop)[0] is False


def test_what_is_not_known_of_the_reference_or_the_network_is_open():
    assert network_covers_reference(circle(), Source("FiniteTimeObserver", {}), 30.0)[0] is None
    assert network_covers_reference(circle(), None, 30.0)[0] is None
    assert network_covers_reference(None, network(8.0), 30.0)[0] is None
    lonely = Source("CircularFormationReference", circle().parameters, {}, 6)
    assert network_covers_reference(lonely, network(8.0), 30.0)[0] is None
