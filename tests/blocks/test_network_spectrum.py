"""The extremes of Lemma 2, beside dense linear algebra."""

import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.authoring.rules import Course
from cosim.blocks import network_spectrum
from cosim.blocks.network_spectrum import NotJudged, lower_ends, network_extremes
from cosim.blocks.stability_conditions import formation_reached_along, topology_slow_along
from cosim.engine import run
from cosim.wiring.conditions import Source

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


def lists(robots, edges):
    """`hears` of edges (i, j) from 0: i hears j."""
    heard = [sorted({j + 1 for i, j in edges if i == robot and j != robot}) for robot in range(robots)]
    width = max(1, *map(len, heard)) if robots > 1 else 1
    return np.array([row + [0] * (width - len(row)) for row in heard], np.int32).reshape(robots, width)


def dense_extremes(hears, b):
    """Lemma 2 with dense matrices."""
    robots = len(hears)
    a = np.zeros((robots, robots))
    for i, row in enumerate(hears):
        a[i, [j - 1 for j in row if j]] = 1.0
    pinned = np.diag(a.sum(axis=1)) - a + np.diag(b)
    p = 1.0 / np.linalg.solve(pinned, np.ones(robots))
    q_1 = np.diag(p) @ pinned + pinned.T @ np.diag(p)
    return np.sort(p)[[0, -1]], np.linalg.eigvalsh(q_1)[[0, -1]], np.linalg.svd(pinned, compute_uv=False)[[-1, 0]]


def agrees(hears, b):
    p, q_1, sigma = network_extremes(hears, b)
    expected_p, expected_q_1, expected_sigma = dense_extremes(hears, b)
    np.testing.assert_allclose(p, expected_p, rtol=1e-6)
    np.testing.assert_allclose(q_1, expected_q_1, rtol=1e-6, atol=1e-10 * expected_q_1[1])
    np.testing.assert_allclose(sigma, expected_sigma, rtol=1e-6)
    low = lower_ends(hears, b)
    assert (low.p, low.q_1, low.sigma) == (tuple(p), q_1[0], sigma[0])


def ring(n, rng):
    return [(i, (i + 1) % n) for i in range(n)]


def chain_down(n, rng):
    """Each hears the one before it: L_1 + B is as far from normal as can be."""
    return [(i, i - 1) for i in range(1, n)]


def chain_both(n, rng):
    return chain_down(n, rng) + [(j, i) for i, j in chain_down(n, rng)]


def star_heard(n, rng):
    return [(i, 0) for i in range(1, n)]


def star_hearing(n, rng):
    return [(0, i) for i in range(1, n)] + [(i, 0) for i in range(1, n)]


def tree(n, rng):
    return [(i, (i - 1) // 2) for i in range(1, n)]


def circulant(n, rng):
    return ring(n, rng) + [(i, (i + 7) % n) for i in range(n)]


def sparse_random(n, rng):
    return ring(n, rng) + [(i, int(j)) for i, j in enumerate(rng.integers(n, size=n))]


def dense_random(n, rng):
    return ring(n, rng) + [tuple(map(int, edge)) for edge in np.argwhere(rng.random((n, n)) < 0.3)]


def one_pinned(n, rng):
    return np.eye(n)[0]


def all_pinned(n, rng):
    return np.full(n, 2.0)


def unevenly_pinned(n, rng):
    """Values of a kind lie close together, as where few references are strong by chance."""
    return rng.uniform(0.0, 2.0, n)


GRAPHS = [ring, chain_down, chain_both, star_heard, star_hearing, tree, circulant, sparse_random, dense_random]
PINNED = [one_pinned, all_pinned, unevenly_pinned]


@pytest.mark.parametrize("pinned", PINNED)
@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("robots", [2, 3, 8, 40, 301])
def test_extremes_are_those_of_dense_linear_algebra(robots, graph, pinned):
    rng = np.random.default_rng(robots)
    agrees(lists(robots, graph(robots, rng)), pinned(robots, rng))


@pytest.mark.parametrize("graph", [chain_down, chain_both, tree, sparse_random])
@pytest.mark.parametrize("pinned", PINNED)
def test_extremes_of_600_robots(graph, pinned):
    rng = np.random.default_rng(600)
    agrees(lists(600, graph(600, rng)), pinned(600, rng))


@given(st.integers(2, 30), st.integers(0, 10_000), st.sampled_from(GRAPHS), st.sampled_from(PINNED))
@settings(max_examples=60)
def test_sparse_linear_algebra_agrees_where_dense_would_do(robots, seed, graph, pinned):
    rng = np.random.default_rng(seed)
    hears, b = lists(robots, graph(robots, rng)), pinned(robots, rng)
    expected = dense_extremes(hears, b)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network_spectrum, "DENSE", 0)
        for cached in (network_spectrum._lower_ends, network_spectrum._upper_ends):
            cached.cache_clear()
        found = network_extremes(hears, b)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-10 * theirs[1])


@pytest.mark.parametrize("name", sorted(path.name for path in DIAGRAMS.glob("*.yaml")))
def test_extremes_of_the_shipped_fleets(name):
    network = run.load(DIAGRAMS / name, code=False)
    components = network.components.values()
    graphs = [component.values["hears"][0] for component in components if "hears" in component.values]
    for hears in graphs:
        agrees(hears, np.full(len(hears), 2.0))


@pytest.mark.parametrize("robots", [6, 400])
def test_a_robot_that_no_reference_reaches_has_a_verdict_in_words(robots):
    """Robot 1 hears nobody and has no reference; robot 2 hears robot 1 alone."""
    hears = lists(robots, [(1, 0), *((i, i - 1) for i in range(3, robots))])
    b = np.where(np.arange(robots) > 1, 1.0, 0.0)
    controller = Source("SlidingModeController", {"b": b, "c": np.array(2.0), "lambda_": np.full(robots, 2.0)})
    topology = Source("RangeTopology", {"hears": hears})
    for judge in (formation_reached_along, topology_slow_along):
        holds, text = judge(Course(0.0, 0.0, 1.0, 0.0), topology, controller)
        assert holds is False
        assert text == "L_1 + B is singular: robot 1 (and 1 more) hears nobody, directly or through others, with b > 0"


@pytest.mark.parametrize("robots", [120, 400])
def test_what_rounding_hides_is_not_judged(robots):
    """Each hears one before it and two behind it: what the first one's reference tells fades by half at each robot."""
    edges = [(i, i + k) for i in range(robots) for k in (-1, 1, 2) if 0 <= i + k < robots]
    with pytest.raises(NotJudged, match="too near a singular matrix"):
        lower_ends(lists(robots, edges), np.eye(robots)[0])


def test_a_graph_that_is_too_entangled_is_not_judged(monkeypatch):
    monkeypatch.setattr(network_spectrum, "WORK", 1000)
    monkeypatch.setattr(network_spectrum, "DENSE_AT_MOST", 350)
    hears = lists(351, sparse_random(351, np.random.default_rng(1)))
    with pytest.raises(NotJudged, match="the static graph of 351 robots is too entangled"):
        lower_ends(hears, np.full(351, 1.25))


def test_a_value_whose_bounds_stay_apart_is_not_judged(monkeypatch):
    monkeypatch.setattr(network_spectrum, "TRIALS", 1)
    hears = lists(320, chain_down(320, None))
    with pytest.raises(NotJudged, match=r"known between [-+.\de]+ and [-+.\de]+ only") as caught:
        lower_ends(hears, np.eye(320)[0])
    low, high = map(float, re.findall(r"[-+]?\d[-+.\de]*", str(caught.value).partition("between")[2]))
    assert low <= dense_extremes(hears, np.eye(320)[0])[1][0] <= high


def test_20000_robots_take_about_a_second_and_equal_ones_no_time():
    robots = 20_000
    hears = np.roll(np.arange(1, robots + 1, dtype=np.int32), -1)[:, np.newaxis]
    began = time.process_time()
    low = lower_ends(hears, np.full(robots, 2.0))
    first = time.process_time() - began
    np.testing.assert_allclose((*low.p, low.q_1, low.sigma), (2.0, 2.0, 8.0, 2.0), rtol=1e-12)
    assert first < 5.0  # a second or less, on a machine that is not busy
    assert lower_ends(hears.copy(), np.full(robots, 2.0)) is low
