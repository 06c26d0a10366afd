"""Algebraic loops: against closed forms and linear algebra, in the step and at initialization, under every method."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import BlockFailed, DiagramErrors

BLOCKS = """
import math
from cosim import Block, Input, Output, Parameter, State

class Line(Block):
    u = Input()
    k = Parameter(default=0.25)
    c = Parameter(default=1.0)
    y = Output()
    def outputs(u, k, c, time, y):
        y[0] = k * u + c * (1.0 + time)

class Plane(Block):
    u = Input()
    v = Input()
    k = Parameter("two", default=[0.0, 0.0])
    c = Parameter(default=1.0)
    y = Output()
    def outputs(u, v, k, c, y):
        y[0] = k[0] * u + k[1] * v + c

class Cosine(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = math.cos(u)

class Square(Block):
    u = Input()
    c = Parameter(default=1.0)
    y = Output()
    def outputs(u, c, y):
        y[0] = u * u + c

class Inverse(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = 1.0 / u

class Jump(Block):
    'crosses y = u nowhere'
    u = Input()
    y = Output()
    def outputs(u, y):
        if u <= 0.0:
            y[0] = 1e-7
        else:
            y[0] = -1.0

class Diode(Block):
    'I = 1e-15 (exp(V / 0.025) - 1)'
    V = Input()
    I = Output()
    def outputs(V, I):
        I[0] = 1e-15 * (math.exp(V / 0.025) - 1.0)

class Source(Block):
    'V = 0.3 - R I'
    I = Input()
    R = Parameter(default=1e12)
    V = Output()
    def outputs(I, R, V):
        V[0] = 0.3 - R * I

class Log(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = math.log(u)

class Root(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        if u < 0.0:
            raise ValueError("negative")
        y[0] = math.sqrt(u) + 0.5

class Mix(Block):
    'y = K u + c over a whole fleet'
    u = Input("robots")
    K = Parameter("robots", "robots")
    c = Parameter("robots")
    y = Output("robots")
    def outputs(u, K, c, y):
        for i in range(u.size):
            y[i] = c[i]
            for j in range(u.size):
                y[i] += K[i, j] * u[j]

class Mass(Block):
    'm dv/dt = F, which hands on its acceleration'
    F = Input()
    m = Parameter(default=2.0)
    v = State(output=True)
    a = Output()
    def outputs(F, m, a):
        a[0] = F / m
    def derivatives(F, m, d_v):
        d_v[0] = F / m

class Drag(Block):
    'F = 1 - v - k a'
    v = Input()
    a = Input()
    k = Parameter(default=0.5)
    F = Output()
    def outputs(v, a, k, F):
        F[0] = 1.0 - v - k * a

class Held(Block):
    'a sampled block with feedthrough, y = u + 1'
    u = Input()
    n = State(dtype=int)
    y = Output()
    def outputs(u, y):
        y[0] = u + 1.0
    def update(next_n):
        next_n[0] += 1

class Begun(Block):
    'a state that begins at its input, and hands on x + u'
    u = Input()
    x = State(output=True)
    y = Output()
    def start(u, x):
        x[0] = u
    def outputs(u, x, y):
        y[0] = 0.25 * u + x
    def derivatives(x, d_x):
        d_x[0] = 0.0
"""
METHODS = ("jacobi", "gauss-seidel", "joint")


@pytest.fixture
def load(tmp_path):
    """Wire a diagram of these blocks."""

    def wired(blocks: str, method: str = "jacobi", more: str = ""):
        (tmp_path / "own.py").write_text(BLOCKS)
        text = f"run: {{stop: 0.5, step: 0.1, method: {method}}}\n{more}blocks:\n{blocks}"
        (tmp_path / "d.yaml").write_text(text.replace("type: ", "python: own.py:"))
        return run.load(tmp_path / "d.yaml")

    return wired


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("k", [0.25, 3.0, -3.0, -1.0, 0.0, 1e3])
def test_a_linear_loop_has_its_closed_form_at_every_step(load, trajectories, k, method, engine):
    network = load(
        f"  a: {{type: Line, inputs: {{u: b.y}}, parameters: {{k: {k}}}}}\n  b: {{type: Line, inputs: {{u: a.y}}}}\n",
        method,
    )
    got = trajectories(network, "a.y", "b.y", engine=engine)
    time = 1.0 + 0.1 * np.arange(6)
    a = time * (k + 1.0) / (1.0 - 0.25 * k)
    np.testing.assert_allclose(got["a.y"], a, rtol=1e-12)
    np.testing.assert_allclose(got["b.y"], 0.25 * a + time, rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("k", [0.25, 4.0, -3.0, 1e6])
def test_a_block_that_reads_itself(load, trajectories, k, engine):
    """y = k y + c: what it reads is not what it is about to write."""
    got = trajectories(load(f"  a: {{type: Line, inputs: {{u: a.y}}, parameters: {{k: {k}}}}}\n"), "a.y", engine=engine)
    np.testing.assert_allclose(got["a.y"], (1.0 + 0.1 * np.arange(6)) / (1.0 - k), rtol=1e-12 * max(1.0, abs(k)))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("c", [1e-30, 1e-15, 1e-6, 1e9, 0.0])
def test_figures_of_any_size_are_as_exact(load, trajectories, c, engine):
    """A quantity of 1e-15 is no rounding error."""
    blocks = f"  a: {{type: Line, inputs: {{u: a.y}}, parameters: {{k: -3.0, c: {c}}}}}\n"
    got = trajectories(load(blocks), "a.y", engine=engine)
    np.testing.assert_allclose(got["a.y"], c * (1.0 + 0.1 * np.arange(6)) / 4.0, rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_sampled_block_in_a_loop_holds_what_it_gave(load, trajectories, engine):
    """y = u + 1 every 0.2 s, u = -y/2 always: when it is due y = 2/3, and between y stays and u follows the time."""
    blocks = (
        "  held: {type: Held, period: 0.2, inputs: {u: a.y}}\n"
        "  a: {type: Line, inputs: {u: held.y}, parameters: {k: -0.5, c: 1.0}}\n"
    )
    got = trajectories(load(blocks), "held.y", "a.y", engine=engine)
    time = 1.0 + 0.1 * np.arange(6)
    due = time[np.arange(6) // 2 * 2]
    np.testing.assert_allclose(got["held.y"], (1.0 + due) / 1.5, rtol=1e-12)
    np.testing.assert_allclose(got["a.y"], -0.5 * got["held.y"] + time, rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
def test_the_fixed_point_of_the_cosine(load, trajectories, method, engine):
    got = trajectories(load("  a: {type: Cosine, inputs: {u: a.y}}\n", method), "a.y", engine=engine)
    assert np.abs(got["a.y"] - 0.739085133215160641655312).max() <= 1e-12
    assert np.abs(np.cos(got["a.y"]) - got["a.y"]).max() <= 1e-15


@pytest.mark.parametrize("robots", [1, 2, 7, 40])
def test_a_loop_over_a_fleet_is_what_linear_algebra_says(load, trajectories, robots):
    rng = np.random.default_rng(robots)
    matrix, c = rng.normal(size=(robots, robots)), rng.normal(size=robots)
    one = f"  mix: {{type: Mix, inputs: {{u: mix.y}}, dimensions: {{robots: {robots}}}, "
    network = load(one + f"parameters: {{K: {matrix.tolist()}, c: {c.tolist()}}}}}\n")
    expected = np.linalg.solve(np.eye(robots) - matrix, c)
    condition = np.linalg.cond(np.eye(robots) - matrix)
    for engine in ("native", "python"):
        got = trajectories(network, "mix.y", engine=engine)["mix.y"]
        np.testing.assert_allclose(
            got, np.tile(expected, (6, 1)), rtol=0, atol=1e-13 * condition * np.abs(expected).max()
        )


@pytest.mark.parametrize("engine", ["native", "python"])
def test_each_member_of_a_fleet_has_a_loop_of_its_own(load, trajectories, engine):
    """Solved side by side, as many unknowns as members; each has the figure that it has alone."""
    blocks = (
        '  a: {type: Line, per: robot, inputs: {u: b.y}, parameters: {k: "i / 1000"}}\n'
        "  b: {type: Cosine, per: robot, inputs: {u: a.y}}\n"
    )
    got = trajectories(load(blocks, more="fleets: {robot: 1000}\n"), "a.y", engine=engine)["a.y"][0]
    for member in (1, 2, 9, 500, 1000):
        y = got[member - 1]
        assert abs(y - (member / 1000 * math.cos(y) + 1.0)) <= 1e-13 * max(1.0, abs(y))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
def test_a_loop_through_blocks_with_states(load, trajectories, method, engine):
    """2 a = 1 - v - a/2, so a = 0.4 (1 - v): Euler's method for v, whatever the method, as nothing else has states."""
    blocks = "  mass: {type: Mass, inputs: {F: drag.F}}\n  drag: {type: Drag, inputs: {v: mass.v, a: mass.a}}\n"
    got = trajectories(load(blocks, method), "mass.v", "mass.a", engine=engine)
    v = 1.0 - (1.0 - 0.1 * 0.4) ** np.arange(6)
    np.testing.assert_allclose(got["mass.v"], v, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got["mass.a"], 0.4 * (1.0 - v), rtol=0, atol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_start_values_come_of_a_loop_that_is_solved(load, trajectories, engine):
    blocks = (
        "  a: {type: Line, inputs: {u: b.y}}\n  b: {type: Line, inputs: {u: a.y}}\n"
        "  late: {type: Begun, inputs: {u: a.y}}\n"
    )
    got = trajectories(load(blocks), "late.x", engine=engine)["late.x"]
    np.testing.assert_allclose(got, 1.25 / (1.0 - 0.0625), rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("Square, inputs: {u: a.y}", r"no solution was found of .* loop of a at t = 0 s: a.y does not come back"),
        ("Log, inputs: {u: a.y}", r"no solution was found of .* loop of a at t = 0 s: a.y gives no number"),
        ("Inverse, inputs: {u: a.y}", r"no solution was found of .* loop of a at t = 0 s"),
        ("Jump, inputs: {u: a.y}", r"no solution was found of .* loop of a at t = 0 s"),
        ("Line, inputs: {u: a.y}, parameters: {k: 1.0}", r"no solution was found of .* loop of a at t = 0 s"),
        ("Line, inputs: {u: a.y}, parameters: {k: 1.0, c: 0.0}", r"the algebraic loop of a leaves a.y undetermined"),
    ],
)
def test_a_loop_without_a_solution_or_with_many_ends_the_run(load, trajectories, block, said, engine):
    with pytest.raises(BlockFailed, match=said) as caught:
        trajectories(load(f"  a: {{type: {block}}}\n"), "a.y", engine=engine)
    assert caught.value.position.line == 3 and caught.value.fix


@pytest.mark.parametrize("engine", ["native", "python"])
def test_what_fails_in_a_loop_is_told_as_elsewhere(load, trajectories, engine):
    blocks = (
        "  a: {type: Root, inputs: {u: b.y}}\n  b: {type: Line, inputs: {u: a.y}, parameters: {k: -1.0, c: -5.0}}\n"
    )
    with pytest.raises(BlockFailed, match=r"outputs\(\) failed at t = 0 s: ValueError: negative"):
        trajectories(load(blocks), "a.y", engine=engine)


def test_both_engines_have_the_same_bits(load, trajectories):
    blocks = (
        '  a: {type: Line, per: robot, inputs: {u: b.y}, parameters: {k: "0.03 * i"}}\n'
        "  b: {type: Cosine, per: robot, inputs: {u: a.y}}\n"
    )
    network = load(blocks, more="fleets: {robot: 30}\n")
    one, other = (trajectories(network, "a.y", "b.y", engine=engine) for engine in ("native", "python"))
    assert all(one[name].tobytes() == other[name].tobytes() for name in one)


@pytest.mark.parametrize("seed", range(30))
def test_random_nets_are_what_linear_algebra_says(load, trajectories, seed):
    """Blocks that read two others each, any: rings in rings, some in a fleet, some apart, solved as one system here."""
    rng = np.random.default_rng(seed)
    n, members = int(rng.integers(2, 7)), int(rng.choice([0, 3]))
    reads, k, c = rng.integers(0, n, size=(n, 2)), rng.normal(size=(n, 2)), rng.normal(size=n)
    matrix = np.eye(n)
    for i in range(n):
        for j in range(2):
            matrix[i, reads[i, j]] -= k[i, j]
    lines = [
        f"  b{i}: {{type: Plane, {'per: robot, ' if members else ''}"
        f"inputs: {{u: b{reads[i, 0]}.y, v: b{reads[i, 1]}.y}}, "
        f"dimensions: {{two: 2}}, parameters: {{k: {[k[i].tolist()] * members or k[i].tolist()}, c: {c[i]}}}}}\n"
        for i in range(n)
    ]
    fleets = f"fleets: {{robot: {members}}}\n" if members else ""
    network = load("".join(lines), METHODS[seed % 3], fleets)
    names = [f"b{i}.y" for i in range(n)]
    expected, condition = np.linalg.solve(matrix, c), np.linalg.cond(matrix)
    got = {engine: trajectories(network, *names, engine=engine) for engine in ("native", "python")}
    for i, name in enumerate(names):
        assert got["native"][name].tobytes() == got["python"][name].tobytes()
        size = max(1.0, np.abs(expected).max(), np.abs(k).max())
        np.testing.assert_allclose(got["native"][name], expected[i], rtol=0, atol=1e-13 * condition * size * n)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(("guess", "solution"), [(-0.5, -1.0), (3.0, 2.0)])
def test_a_start_value_says_where_a_solution_is_looked_for(load, trajectories, guess, solution, engine):
    """y = y² - 2 has two solutions: the nearer one is found, and stays."""
    blocks = f"  a: {{type: Square, inputs: {{u: a.y}}, parameters: {{c: -2.0}}, start: {{y: {guess}}}}}\n"
    got = trajectories(load(blocks), "a.y", engine=engine)["a.y"]
    np.testing.assert_allclose(got, solution, rtol=1e-12)


def test_a_start_value_of_what_is_computed_anyway_is_a_mistake(load):
    begun = "  b: {type: Begun, inputs: {u: a.y}, start: {x: 0}}\n"
    with pytest.raises(DiagramErrors) as caught:
        load(f"  a: {{type: Line, inputs: {{u: b.x}}, start: {{y: 1.0}}}}\n{begun}")
    (mistake,) = caught.value.errors
    assert "output `y` is computed" in mistake.message and mistake.position.line == 3


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("R", [1e6, 1e8, 1e12, 1e14])
def test_currents_of_femtoamperes_are_no_rounding_errors(load, trajectories, R, method, engine):
    """A diode behind a resistance, against bisection; it stays as it is, as nothing changes."""
    blocks = (
        f"  d: {{type: Diode, inputs: {{V: s.V}}}}\n  s: {{type: Source, inputs: {{I: d.I}}, parameters: {{R: {R}}}}}\n"
    )
    got = trajectories(load(blocks, method), "d.I", engine=engine)["d.I"]
    low, high = 0.0, 0.3 / R
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 1e-15 * (math.exp((0.3 - R * middle) / 0.025) - 1.0) > middle else (low, middle)
    np.testing.assert_allclose(got, low, rtol=1e-10)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("matrix", "c"),
    [
        ([[0.0, 1e9], [-1e-9, 0.0]], [1.0, 1.0]),
        ([[0.5, 1e8], [0.0, -3.0]], [1.0, 1.0]),
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, -1.0, 0.0]], [1.1e9, 1.1e9, 1e-3]),
        ([[-1e6]], [1e6]),
        ([[-1e8]], [1e8]),
    ],
)
def test_loops_of_steep_and_of_badly_scaled_equations(load, trajectories, matrix, c, engine):
    """Units differ: newtons per metre and metres. What is published is the solution, not what a steep f makes of it."""
    n = len(c)
    one = f"  mix: {{type: Mix, inputs: {{u: mix.y}}, dimensions: {{robots: {n}}}, "
    network = load(one + f"parameters: {{K: {matrix}, c: {c}}}}}\n")
    got = trajectories(network, "mix.y", engine=engine)["mix.y"]
    expected = np.linalg.solve(np.eye(n) - np.array(matrix), c)
    np.testing.assert_allclose(
        got, np.tile(expected, (6, 1)), rtol=1e-11, atol=1e-12 * np.abs(expected).max() * (n > 2)
    )


@pytest.mark.parametrize("engine", ["native", "python"])
def test_members_that_read_one_member_of_their_own_fleet(load, trajectories, engine):
    """y_i = k_i y_2 + 1: all read what is member 2's."""
    blocks = '  p: {type: Line, per: robot, inputs: {u: "p.y[2]"}, parameters: {k: [2, -1, 0.5, 3], c: [1, 1, 1, 1]}}\n'
    got = trajectories(load(blocks, more="fleets: {robot: 4}\n"), "p.y", engine=engine)["p.y"]
    np.testing.assert_allclose(got[0], [2.0, 0.5, 1.25, 2.5], rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
def test_sampled_blocks_beside_a_loop_that_goes_on(load, trajectories, method, engine):
    """Under every method what is sampled changes when it is due, also where something integrates what depends on it."""
    blocks = (
        "  held: {type: Held, period: 0.2, inputs: {u: a.y}}\n"
        "  a: {type: Line, inputs: {u: held.y}, parameters: {k: -0.5, c: 1.0}}\n"
        "  mass: {type: Mass, inputs: {F: a.y}}\n"
    )
    got = trajectories(load(blocks, method), "held.y", "a.y", engine=engine)
    time = 1.0 + 0.1 * np.arange(6)
    np.testing.assert_allclose(got["held.y"], (1.0 + time[np.arange(6) // 2 * 2]) / 1.5, rtol=1e-12)
    np.testing.assert_allclose(got["a.y"], -0.5 * got["held.y"] + time, rtol=1e-12)


@pytest.mark.parametrize("k", [1e2, 1e4, 1e6])
def test_gauss_seidel_publishes_what_it_has_solved(load, trajectories, k):
    """F = 1 - v - k a of a mass of 2: a = (1 - v) / (2 + k), which nothing evaluates once more."""
    blocks = (
        "  mass: {type: Mass, inputs: {F: drag.F}}\n"
        f"  drag: {{type: Drag, inputs: {{v: mass.v, a: mass.a}}, parameters: {{k: {k}}}}}\n"
    )
    found = [trajectories(load(blocks, method), "mass.v")["mass.v"] for method in METHODS]
    v = 1.0 - (1.0 - 0.1 / (2.0 + k)) ** np.arange(6)
    for values in found:
        np.testing.assert_allclose(values, v, rtol=1e-8, atol=0)
