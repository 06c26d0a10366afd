"""Measuring blocks: errors, and the gaps between robots."""

import math
from pathlib import Path

import numpy as np
import pytest

from cosim.blocks import cell_grid
from cosim.blocks.agreement import agrees, radii_agree
from cosim.blocks.differentiator_errors import DifferentiatorErrors
from cosim.blocks.edge_weights import EdgeWeights, edges_are_pairs
from cosim.blocks.estimation_errors import EstimationErrors
from cosim.blocks.formation_errors import FormationErrors
from cosim.blocks.pair_gaps import PairGaps, pairs_are_robots
from cosim.blocks.range_topology import RangeTopology
from cosim.blocks.separation import Separation
from cosim.blocks.topology_rate import TopologyRate
from cosim.blocks.ultimate_bounds import UltimateBounds
from cosim.engine import run
from cosim.errors import CosimError, DiagramErrors
from cosim.wiring.conditions import Source

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


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
    work, found = np.zeros((5, 3, 3)), np.zeros((4, 1))
    FormationErrors.outputs(x, v, x_d, dx_d, s_hat, neighbours, weights, lambda_, b, *work, *found)
    pinned = np.array([[1.2 + 2, -1, -0.2], [0, 1, -1], [-1, 0, 1 + 1]])
    e_x = pinned @ (x - x_d)
    s = pinned @ (v - dx_d) + lambda_[:, np.newaxis] * e_x
    expected = [np.linalg.norm(m) for m in (x - x_d, e_x, s, s_hat)]
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-12)


def separation(x, radii, capacity=50):
    """The smallest gap, and the rows of the pairs that touch."""
    return measure(0.0, x, radii, np.full((capacity, 3), math.nan))[:2]


def work_spaces(robots):
    """What lies there before the first call."""
    return np.zeros((robots, cell_grid.FIELDS), np.int64), np.full((robots, cell_grid.SEARCHED), np.nan)


def measure(time, x, radii, listed, work=None):
    """The smallest gap, the table of collisions, and how many pairs have no row; `listed` gets the new ones."""
    work = work or work_spaces(len(x))
    collisions, min_gap, unlisted = np.full_like(listed, 99.0), np.zeros(1), np.zeros(1, np.int64)
    Separation.outputs(time, x, radii, listed, *work, min_gap, unlisted, collisions)
    Separation.update(collisions, listed)
    assert np.array_equal(collisions, listed, equal_nan=True)
    return min_gap[0], collisions, unlisted[0]


def all_gaps(x, radii):
    gaps = np.sqrt(((x[:, np.newaxis] - x) ** 2).sum(axis=2)) - radii[:, np.newaxis] - radii
    gaps[np.tril_indices(len(x))] = np.inf
    return gaps


@pytest.mark.parametrize("robots", [2, 6, 33, 150])
@pytest.mark.parametrize("side", [3.0, 20.0, 2000.0])
def test_smallest_gap_of_all_pairs(robots, side):
    rng = np.random.default_rng(robots)
    x, radii = rng.uniform(-side, side, (robots, 2)), rng.uniform(0.01, 0.05, robots)
    min_gap, collisions = separation(x, radii)
    gaps = all_gaps(x, radii)
    assert min_gap == pytest.approx(gaps.min(), rel=1e-12, abs=1e-14)
    rows = collisions[collisions[:, 0] > 0]
    assert rows[:, :2].tolist() == (np.argwhere(gaps <= 0) + 1).tolist()


def test_grid_and_all_pairs_agree_bit_for_bit(monkeypatch):
    rng = np.random.default_rng(17)
    x, radii = rng.uniform(-30, 30, (100, 2)), rng.uniform(0.2, 0.3, 100)
    by_grid = separation(x, radii)
    monkeypatch.setattr(cell_grid, "SMALL", 100)
    by_pairs = separation(x, radii)
    assert by_grid[0] == by_pairs[0]
    assert np.array_equal(by_grid[1], by_pairs[1], equal_nan=True)


def test_gaps_of_robots_that_come_together_and_part():
    """From far apart, where lists reach far, to each other and through: the smallest gap of all pairs at every step."""
    rng = np.random.default_rng(4)
    home, radii, work = rng.normal(size=(60, 2)), np.full(60, 0.01), work_spaces(60)
    for scale in np.concatenate([np.geomspace(1000.0, 1.0, 60), np.linspace(1.0, -1.0, 60)]):
        x = scale * home
        min_gap = measure(0.0, x, radii, np.full((2000, 3), math.nan), work)[0]
        assert min_gap == pytest.approx(all_gaps(x, radii).min(), rel=1e-12, abs=1e-14)


def test_a_single_robot_has_no_gap():
    assert separation(np.zeros((1, 2)), np.ones(1))[0] == math.inf


def test_many_robots_far_apart_are_seen_all():
    x = np.column_stack((np.arange(40) ** 2 * 1e3 + 1e3, np.zeros(40)))
    assert separation(x, np.full(40, 0.1))[0] == pytest.approx(1000 - 0.2)


def line(*places):
    """Robots on a line, for radii of 0.5."""
    return np.column_stack((places, np.zeros(len(places))))


def test_collisions_are_listed_once_with_their_first_time():
    listed = np.full((3, 3), math.nan)
    apart, first, both, second = (
        np.column_stack((p, np.zeros(3))) for p in ((0, 2, 4), (0, 0.9, 4), (0, 0.9, 1.8), (0, 2, 2.9))
    )
    for time, x in ((0.1, apart), (0.2, first), (0.3, both), (0.4, second)):
        assert measure(time, x, np.full(3, 0.5), listed)[2] == 0
    assert listed[:2].tolist() == [[1, 2, 0.2], [2, 3, 0.3]]
    assert np.isnan(listed[2]).all()


def test_what_finds_no_row_is_counted():
    """Of the 15 pairs of six robots in one place, a table of 4 lists the first 4 and keeps them."""
    listed = np.full((4, 3), math.nan)
    for time in (1.0, 2.0):
        assert measure(time, np.zeros((6, 2)), np.ones(6), listed)[2] == 11
    assert listed.tolist() == [[1, 2, 1.0], [1, 3, 1.0], [1, 4, 1.0], [1, 5, 1.0]]
    assert measure(3.0, 10.0 * np.arange(12).reshape(6, 2), np.ones(6), listed)[2] == 0


CROWD = """
run: {stop: 0.02, step: 0.01}
fleets: {robot: 40}
blocks:
  place: {block: SineWavePath, per: robot, parameters: {speed: 0, amplitude: 0, frequency: 0}}
  separation: {block: Separation, parameters: {radii: 1}, inputs: {x: place.x_c}}
metrics: {collisions: {signal: separation.collisions, reduce: events}}
"""


@pytest.mark.parametrize("engine", run.ENGINES)
def test_more_collisions_than_rows_end_no_run(tmp_path, engine):
    (tmp_path / "crowd.yaml").write_text(CROWD)
    outcome = run.Run(run.load(tmp_path / "crowd.yaml"), engine).execute()
    assert (outcome.status, outcome.steps) == ("completed", 2)
    assert [event["pair"] for event in outcome.metrics["collisions"]] == [[1, j] for j in range(2, 22)]
    (warning,) = outcome.warnings
    assert f"{40 * 39 // 2 - 20} more touched" in warning.message
    assert "collision_capacity" in warning.message
    roomy = run.Run(
        run.load(tmp_path / "crowd.yaml", ["blocks.separation.dimensions={collision_capacity: 780}"]), engine
    )
    outcome = roomy.execute()
    assert len(outcome.metrics["collisions"]) == 780 and not outcome.warnings


APPROACH = """
run: {stop: 1, step: 0.01}
fleets: {robot: 2}
blocks:
  centre: {block: SineWavePath, per: robot, parameters: {speed: [0, -1.0], amplitude: 0, frequency: 0}}
  place:
    block: CircularFormationReference
    per: robot
    parameters: {radius: [0, 1.995], angle: 0}
    inputs: {x_c: centre.x_c, dx_c: centre.dx_c, ddx_c: centre.ddx_c}
  separation: {block: Separation, parameters: {radii: 0.5}, inputs: {x: place.x_d}}
metrics: {collisions: {signal: separation.collisions, reduce: events}}
"""


def test_a_collision_at_the_very_end_of_a_run_is_seen(tmp_path):
    """The gap is 0.995 - t, in steps of 0.01 s."""
    (tmp_path / "approach.yaml").write_text(APPROACH)
    outcome = run.Run(run.load(tmp_path / "approach.yaml"), "python").execute()
    assert outcome.metrics["collisions"] == [{"pair": [1, 2], "time": 1.0}]
    outcome = run.Run(run.load(tmp_path / "approach.yaml", ["run.stop=0.99"]), "python").execute()
    assert outcome.metrics["collisions"] == []


def test_a_pair_of_large_robots_beyond_reach_may_be_nearer_than_one_of_small_robots_within():
    """Robots of 1 m are first looked for within 8 m: they may be 6 m apart beyond it."""
    x = np.column_stack((np.arange(40) * 1000.0, np.zeros(40)))
    radii = np.full(40, 0.01)
    radii[:2] = 1.0
    x[:2, 0] = 7.95, 16.05  # two cells apart, gap 6.1 m
    x[2:4, 0] = 5100.0, 5106.22  # gap 6.2 m
    assert separation(x, radii)[0] == pytest.approx(6.1, abs=1e-12)


def test_the_smallest_gap_is_exact_when_the_nearest_pair_is_far_beyond_reach():
    x = np.column_stack((np.arange(40) * 1000.0, np.zeros(40)))
    x[20, 0] -= 500.0
    assert separation(x, np.full(40, 1.0))[0] == 498.0


def range_based(x, hears, eta_1=0.2, eta_2=14.0, eta_3=1.1, R_c=1.5):
    """L_2 by (5) and (44)."""
    distances = np.linalg.norm(x[:, np.newaxis, :2] - x[:, :2], axis=2)
    a_2 = np.where(distances <= R_c, eta_1 / (1 + np.exp(eta_2 * (distances - eta_3))), 0.0)
    np.fill_diagonal(a_2, 0.0)
    for i, row in enumerate(hears):
        a_2[i, [j - 1 for j in row if j]] = 0.0
    return np.diag(a_2.sum(axis=1)) - a_2


@pytest.mark.parametrize("seed", range(5))
def test_topology_rate(seed):
    """The norm of L_2, and of its central difference along the robots' velocities."""
    rng = np.random.default_rng(seed)
    x, v, h = rng.uniform(-1, 1, (6, 3)), rng.normal(size=(6, 3)), 1e-6
    hears = np.array([[4, 0], [3, 5], [1, 0], [5, 0], [6, 0], [2, 1]], np.int32)
    neighbours, weights = np.zeros((6, 8), np.int32), np.zeros((6, 8))
    work = *work_spaces(6), np.zeros(6, np.int32)
    RangeTopology.outputs(x, hears, 0.2, 14.0, 1.1, 1.5, *work, neighbours, weights)
    L_2, dL_2 = np.zeros((2, 1))
    TopologyRate.outputs(x, v, neighbours, weights, 0.2, 14.0, L_2, dL_2)
    assert L_2[0] == pytest.approx(np.linalg.norm(range_based(x, hears)), rel=1e-12) and L_2[0] > 0.1
    difference = (range_based(x + h * v, hears) - range_based(x - h * v, hears)) / (2 * h)
    assert dL_2[0] == pytest.approx(np.linalg.norm(difference), rel=1e-6)


def test_topology_rate_of_the_static_graph_and_of_robots_in_one_place():
    L_2, dL_2 = np.ones((2, 1))
    neighbours, weights = np.array([[1], [0]], np.int32), np.ones((2, 1))
    TopologyRate.outputs(np.eye(2), np.ones((2, 2)), neighbours, weights, 0.2, 14.0, L_2, dL_2)
    assert (L_2[0], dL_2[0]) == (0.0, 0.0)
    TopologyRate.outputs(np.zeros((2, 2)), np.eye(2), neighbours, 0.1 * weights, 0.2, 14.0, L_2, dL_2)
    assert (L_2[0], dL_2[0]) == (pytest.approx(0.2), 0.0)


@pytest.mark.parametrize(
    ("block", "wired", "given"),
    [
        ("topology_rate", "topology", {"eta_1": 0.1}),
        ("topology_rate", "topology", {"eta_2": 7}),
        ("separation", "plant", {"radius": 0.25}),
        ("potential_field", "plant", {"radius": [0.24, 0.30, 0.23, 0.31, 0.28, 0.26]}),
        ("formation", "controller", {"lambda_": 1}),
        ("formation", "controller", {"b": 1}),
        ("bounds", "controller", {"c": 1}),
        ("bounds", "topology", {"hears": [[2], [3], [4], [5], [6], [1]]}),
        ("edges", "topology", {"hears": [[2], [3], [4], [5], [6], [1]]}),
    ],
)
def test_a_measure_asks_for_the_parameters_of_what_it_measures(block, wired, given):
    """Else its figures were those of another controller or topology."""
    diagram = {"bounds": "ultimate_bounds.yaml", "edges": "measured_pairs.yaml"}.get(block, "formation.yaml")
    settings = [f"blocks.{wired}.parameters.{name}={value}" for name, value in given.items()]
    with pytest.raises(DiagramErrors, match=f"block {block}: .* as the {wired} has") as caught:
        run.load(DIAGRAMS / diagram, settings)
    assert "there" in str(caught.value.errors[0].fix)


@pytest.mark.parametrize(
    ("port", "source"),
    [
        ("formation.inputs.s_hat", "controller.u"),
        ("formation.inputs.s_hat", "controller.e_v"),
        ("topology_rate.inputs.s_hat", "observer.w_hat"),
        ("bounds.inputs.s_hat", "controller.e_x"),
    ],
)
def test_s_hat_is_a_controllers_and_nothing_else(port, source):
    """Else figures called S_hat were of something else, and conditions judged with gains that do not belong to it."""
    diagram = "ultimate_bounds.yaml" if port.startswith("bounds") else "formation.yaml"
    with pytest.raises(
        CosimError, match=f"`s_hat` takes ports called `s_hat` and nothing else, not {source}"
    ) as caught:
        run.load(DIAGRAMS / diagram, [f"blocks.{port}={source}"])
    assert "fix: wire controller.s_hat" in str(caught.value)


def test_the_bounds_ask_for_the_graph_of_a_topology():
    with pytest.raises(CosimError, match="`neighbours` takes ports called `neighbours` and nothing else"):
        run.load(DIAGRAMS / "ultimate_bounds.yaml", ["blocks.bounds.inputs.neighbours=topology.count"])


def test_radii_are_those_of_the_robots_whose_positions_are_known():
    """One value may hold for all robots; a circle of references has a radius, but is no robot."""
    shared = ["blocks.plant.parameters.radius=0.25"]
    shared += [f"blocks.{block}.parameters.radii=0.25" for block in ("separation", "potential_field")]
    assert run.load(DIAGRAMS / "formation.yaml", shared)
    plant = Source("OmnidirectionalRobot", {"mass": np.ones(3), "radius": np.array([0.2, 0.3, 0.4])}, {}, 3)
    assert radii_agree(plant, np.array([0.2, 0.3, 0.4]))[0]
    assert radii_agree(plant, np.array([0.2, 0.3, 0.5])) == (False, "the radius of robot 3 is 0.4 m there")
    for other in (None, Source("Fmu", {}), Source("CircularFormationReference", {"radius": np.ones(3)}, {}, 3)):
        assert radii_agree(other, np.array([0.2, 0.3, 0.5]))[0]
    assert radii_agree(plant, np.full(6, 0.2))[0]  # joined from several blocks, of which a rule knows the first


def test_agreement_is_about_what_is_known():
    theirs = Source("RangeTopology", {"eta_1": np.array(0.2), "hears": np.array([[2], [1]])})
    assert agrees(theirs, eta_1=0.2, eta_2=14.0) == (True, "")
    assert agrees(theirs, eta_1=0.3) == (False, "eta_1 is 0.2 there")
    assert not agrees(theirs, hears=np.array([[2, 0], [1, 0]]))[0]
    assert agrees(None, eta_1=0.3) == (True, "")


def test_ultimate_bounds_on_the_papers_ring():
    """P_1 = 2 I, Q_1 from 8 to 16, L_1 + B from 2 to 4, c = lambda = 2; (39), (40) and (41) by hand."""
    ring, two = np.array([[4], [3], [1], [5], [6], [2]], np.int32), np.full(6, 2.0)
    p, q, sigma = np.zeros((3, 2))
    UltimateBounds.calculate(ring, two, p, q, sigma)
    zero, v_hat, w_hat, F = np.zeros((4, 6, 3))
    v_hat[1, 2], w_hat[3, 0] = 3e-4, -0.1

    def bounds(force, L_2, dL_2):
        F[2, 1] = force
        found = np.zeros((6, 1))
        UltimateBounds.outputs(zero, v_hat, zero, w_hat, F, L_2, dL_2, 2.0, two, p, q, sigma, *found)
        assert found[:2, 0].tolist() == [0.1, 3e-4]
        return found[2:, 0].tolist()

    by_40 = (8 * 0.1 + 2 * 4 * (2 + 2 * 4) * 3e-4) / min(8, 4)
    by_41 = 16 * (0.1 + (2 * 4 + 2) * 3e-4) / min(16, 32)
    assert bounds(0.0, 0.0, 0.0) == pytest.approx([by_40, by_40 / 2, by_41, by_41 / 2])
    k_1 = 4 + 0.5
    shaken = ((2 * 0.5 + 8) * (0.1 + 0.7) + 2 * k_1 * (2 + 2 * k_1) * 3e-4) / min(8 - 2 * 1.5 / 2, 2 * (2 - 1.5 / 2))
    assert bounds(0.7, 0.5, 1.5) == pytest.approx([shaken, shaken / 2, math.inf, math.inf])
    assert bounds(0.0, 0.5, 4.0) == [math.inf] * 4  # the second condition of Theorem 3 admits less than 4


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
