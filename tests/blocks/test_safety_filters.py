"""Half-planes, barrier functions and velocity obstacles, against scipy's optimizers and geometry."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from cosim.blocks.control_barrier import ControlBarrierFilter
from cosim.blocks.half_planes import least_violating
from cosim.blocks.velocity_obstacles import VelocityObstacles, nearest_border

RADII = np.array([0.24, 0.30, 0.23, 0.31])
ALL = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]], np.int32)


def half_planes(rng, count, around):
    angle = rng.uniform(-np.pi, np.pi, count)
    normals = np.column_stack((np.cos(angle), np.sin(angle)))
    return normals, normals @ rng.normal(size=2) * 0.3 - rng.exponential(1.0, count) + around


def test_the_nearest_point_is_that_of_a_quadratic_program():
    rng, found = np.random.default_rng(1), 0
    for _ in range(60):
        normals, offsets = half_planes(rng, rng.integers(1, 8), 0.2)
        wanted, radius = rng.normal(size=2) * 3.0, rng.uniform(1.0, 4.0)
        x, y, violation = least_violating(*wanted, normals, offsets, len(offsets), radius)
        if violation > 0.0:
            continue
        found += 1
        assert np.all(normals @ (x, y) >= offsets - 1e-12) and np.hypot(x, y) <= radius + 1e-12
        keeps = [
            {"type": "ineq", "fun": lambda p, n=normals, c=offsets: n @ p - c},
            {"type": "ineq", "fun": lambda p, r=radius: r * r - p @ p},
        ]
        best = minimize(lambda p, w=wanted: (p - w) @ (p - w), (x, y), method="SLSQP", constraints=keeps, tol=1e-10)
        np.testing.assert_allclose(np.hypot(*(wanted - (x, y))) ** 2, best.fun, atol=1e-6)
    assert found > 20


def test_where_nothing_is_admitted_the_least_violation_is_that_of_a_linear_program():
    rng, found = np.random.default_rng(2), 0
    for _ in range(60):
        count = rng.integers(3, 9)
        normals, offsets = half_planes(rng, count, 1.0)
        x, y, violation = least_violating(*rng.normal(size=2), normals, offsets, count, np.inf)
        if violation == 0.0:
            continue
        found += 1
        best = linprog([0, 0, 1], -np.column_stack((normals, np.ones(count))), -offsets, bounds=[(None, None)] * 3)
        assert violation == pytest.approx(best.fun, abs=1e-9)
        assert (offsets - normals @ (x, y)).max() <= violation + 1e-9
    assert found > 20


def robots(rng):
    """Four robots, near each other, with motions and control gains."""
    x = np.column_stack((rng.permuted([0.0, 0.75, 0.1, 0.9]), [0.0, 0.1, 0.8, 0.85], rng.normal(size=4)))
    return x, rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), rng.normal(size=(4, 3, 3))


def filtered(block, state, *parameters):
    x, v, w, u, g = state
    u_safe, violation, infeasible = np.zeros((4, 3)), np.zeros(4), np.zeros(4, bool)
    work = np.zeros((3, 2)), np.zeros(3)
    block.outputs(x, v, w, u, g, np.linalg.inv(g), ALL, RADII, *parameters, *work, u_safe, violation, infeasible)
    accelerations = np.einsum("iqk,ik->iq", g, u_safe) + w
    return u_safe, accelerations, violation


def test_barriers_are_kept_by_the_least_change():
    """Of both robots' accelerations: d2h/dt2 + (p1 + p2) dh/dt + p1 p2 h >= 0 where no robot has a violation."""
    rng, pairs, changed = np.random.default_rng(3), 0, 0
    for _ in range(40):
        state = robots(rng)
        x, v, w, u, g = state
        _, a, violation = filtered(ControlBarrierFilter, state, 1.1, 3.0, 5.0, np.inf)
        wanted = np.einsum("iqk,ik->iq", g, u) + w
        np.testing.assert_allclose(a[:, 2], wanted[:, 2], atol=1e-9)  # headings are left alone
        changed += np.abs(a - wanted).max() > 1e-6
        for i in range(4):
            for j in range(i):
                z, nu = (x[i] - x[j])[:2], (v[i] - v[j])[:2]
                h = z @ z - (1.1 * (RADII[i] + RADII[j])) ** 2
                second = 2.0 * (nu @ nu + z @ (a[i] - a[j])[:2])
                left = second + 8.0 * 2.0 * z @ nu + 15.0 * h
                scale = 2.0 * np.linalg.norm(z) * (violation[i] + violation[j])
                assert left >= -scale - 1e-8
                pairs += 1
    assert pairs == 240 and changed > 20


@pytest.mark.parametrize(
    ("block", "parameters"), [(ControlBarrierFilter, (3.0, 5.0, np.inf)), (VelocityObstacles, (0.5, 0.1, np.inf))]
)
def test_far_from_each_other_the_controller_has_its_will(block, parameters):
    state = robots(np.random.default_rng(4))
    state[0][:, :2] *= 40.0
    u_safe, _, violation = filtered(block, state, 1.1, *parameters)
    assert np.array_equal(u_safe, state[3]) and not violation.any()


def test_the_border_of_a_velocity_obstacle_is_nearest():
    """The point of the border touches a disc within the horizon, and no smaller change of the velocity does."""
    rng = np.random.default_rng(5)
    times = np.linspace(1e-3, 2.0, 4000)

    def clearance(p, nu):
        return np.hypot(times * nu[0] - p[0], times * nu[1] - p[1]).min()

    for _ in range(40):
        angle = rng.uniform(-np.pi, np.pi)
        p, nu = 1.3 * np.array([np.cos(angle), np.sin(angle)]), rng.normal(size=2)
        *n, c = nearest_border(*p, *nu, 0.5, 2.0)
        assert np.hypot(*n) == pytest.approx(1.0, abs=1e-12)
        off = c - n @ nu
        assert clearance(p, nu + off * np.array(n)) == pytest.approx(0.5, abs=2e-3)
        inside = clearance(p, nu) < 0.5
        assert inside == (off > 0.0) or abs(off) < 1e-2
        for other in np.linspace(0, 2 * np.pi, 24):
            moved = nu + 0.98 * abs(off) * np.array([np.cos(other), np.sin(other)])
            assert (clearance(p, moved) < 0.5 + 1e-3) == inside or abs(off) < 1e-2


def test_robots_that_use_the_same_rule_pass_each_other():
    """Two discs head on, each with the new velocity: they miss each other as long as the horizon is."""
    state = robots(np.random.default_rng(6))
    x, v, w, u, _ = state
    x[:, :2] = [[0, 0], [2, 0.01], [50, 0], [0, 50]]
    v[:], w[:], u[:] = 0.0, 0.0, 0.0
    v[0, 0], v[1, 0] = 1.0, -1.0
    _, a, violation = filtered(VelocityObstacles, state, 1.1, 1.5, 0.1, np.inf)
    new = v + 0.1 * a
    t = np.linspace(0, 1.5, 1501)[:, None]
    gap = np.linalg.norm((x[0] - x[1])[:2] + t * (new[0] - new[1])[:2], axis=1)
    assert gap.min() == pytest.approx(1.1 * (RADII[0] + RADII[1]), abs=1e-6)
    assert not violation.any()
