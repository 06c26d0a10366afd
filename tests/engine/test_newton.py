"""The solver of algebraic loops where it is hard: unknowns of any sizes, jumps, and what nothing determines.

Against closed forms; a tolerance is that of a residual of 1e-13 of each unknown, or of the rounding errors of sums.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.engine import compilation, program, run
from cosim.engine.hosts import Watch
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed, DiagramErrors, TooLarge
from cosim.master.tables import ALIVE, CONTROL_WORDS
from cosim.wiring import loops, sizes

BLOCKS = """
import math
import numpy as np
from cosim import Block, Input, Output, Parameter, State

class Own(Block):
    'each of its unknowns by itself: u = s cos(u / s), and u = s (10^4 - (u / s)^2), by turns'
    u = Input("n")
    s = Parameter("n")
    y = Output("n")
    def outputs(u, s, y):
        for i in range(u.size):
            if i % 2 == 0:
                y[i] = s[i] * math.cos(u[i] / s[i])
            else:
                y[i] = s[i] * (1e4 - (u[i] / s[i]) ** 2)

CALLS = []

class Counted(Block, compiled=False):
    'notes when it is evaluated'
    u = Input()
    y = Output()
    def outputs(u, time, y):
        CALLS.append(round(float(time), 9))
        y[0] = 0.5 * u + 1.0

class Switched(Block):
    'u0 = k u1 + c, u1 = sin u0, u2 = u0 + cos u2, where c is 0 from 0.25 s on'
    u = Input(3)
    k = Parameter()
    y = Output(3)
    def outputs(u, k, time, y):
        y[0] = k * u[1]
        if time < 0.25:
            y[0] += 1.7
        y[1] = math.sin(u[0])
        y[2] = u[0] + math.cos(u[2])

class AfterZero(Block):
    'u0 = u0 / 2, u1 = u0 + s cos(u1 / s)'
    u = Input(2)
    s = Parameter()
    y = Output(2)
    def outputs(u, s, y):
        y[0] = 0.5 * u[0]
        y[1] = u[0] + s * math.cos(u[1] / s)

class Leak(Block):
    'a pressure (Pa), and the flow of a leak, q + q^2 / s = s 10^4 p / 2e7'
    u = Input(2)
    s = Parameter(default=1e-10)
    y = Output(2)
    def outputs(u, s, y):
        y[0] = 2e7 * (1.0 - 0.25 * (u[0] / 1.5e7) ** 2)
        y[1] = s * 1e4 * u[0] / 2e7 - u[1] ** 2 / s

class Apart(Block):
    'two that are equal and large, and k times their difference and c more'
    u = Input(3)
    L = Parameter()
    k = Parameter(default=1.0)
    c = Parameter(default=0.0)
    y = Output(3)
    def outputs(u, L, k, c, y):
        y[0] = L * math.cos(u[0] / L)
        y[1] = L * math.cos(u[1] / L)
        y[2] = k * (u[0] - u[1]) + c

class Jump(Block):
    'crosses y = u nowhere, beside L cos(u / L)'
    u = Input(2)
    L = Parameter()
    at = Parameter()
    by = Parameter()
    below = Parameter()
    y = Output(2)
    def outputs(u, L, at, by, below, y):
        y[0] = L * math.cos(u[0] / L)
        if u[1] <= at:
            y[1] = at + by
        else:
            y[1] = at - below

class Line(Block):
    u = Input()
    k = Parameter(default=0.25)
    c = Parameter(default=1.0)
    y = Output()
    def outputs(u, k, c, y):
        y[0] = k * u + c

class Beside(Block):
    'u = cos u, and a second one that comes back'
    u = Input(2)
    y = Output(2)
    def outputs(u, y):
        y[0] = math.cos(u[0])
        y[1] = u[1]

class Mix(Block):
    u = Input("n")
    K = Parameter("n", "n")
    c = Parameter("n")
    y = Output("n")
    def outputs(u, K, c, y):
        for i in range(u.size):
            y[i] = c[i]
            for j in range(u.size):
                y[i] += K[i, j] * u[j]

class Late(Block):
    'from 0.25 s on, all that it is given comes back, or all but what is above m'
    u = Input("n")
    m = Parameter(default=1e9)
    y = Output("n")
    def outputs(u, m, time, y):
        for i in range(u.size):
            if time < 0.25 or u[i] > m:
                y[i] = 0.5 * u[i] + 1.0 + i + time
            else:
                y[i] = u[i]

class Partly(Block):
    'writes the first n only'
    u = Input(3)
    n = Parameter(dtype=int)
    y = Output(3)
    def outputs(u, n, y):
        for i in range(n):
            y[i] = 0.5 * u[i] + 1.0

class Coarse(Block):
    u = Input()
    k = Parameter()
    c = Parameter()
    y = Output(dtype=np.float32)
    def outputs(u, k, c, y):
        y[0] = k * u + c

class Widened(Block):
    u = Input(dtype=np.float32)
    y = Output()
    def outputs(u, y):
        y[0] = u + 0.1

class Transposed(Block):
    u = Input("n", "p")
    k = Parameter()
    y = Output("p", "n")
    def outputs(u, k, y):
        for i in range(u.shape[0]):
            for j in range(u.shape[1]):
                y[j, i] = k * u[i, j] + 1.0 * (i + 2 * j)

class Lead(Block):
    u = Input()
    k = Parameter()
    x = State(output=True)
    y = Output()
    def outputs(u, k, x, y):
        y[0] = x + k * u
    def derivatives(u, d_x):
        d_x[0] = 1.0 - u

class Held(Block):
    u = Input()
    n = State(dtype=int)
    y = Output()
    def outputs(u, y):
        y[0] = 0.5 * u + 1.0
    def update(next_n):
        next_n[0] += 1
"""
ENGINES = ("native", "python")
COSINE = 0.739085133215160641655312


@pytest.fixture
def load(tmp_path):
    """Wire a diagram of these blocks; more: sections besides."""

    def wired(blocks: str, more: str = ""):
        (tmp_path / "own.py").write_text(BLOCKS)
        text = f"run: {{stop: 0.5, step: 0.1}}\n{more}blocks:\n{blocks}"
        (tmp_path / "d.yaml").write_text(text.replace("type: ", "python: own.py:"))
        return run.load(tmp_path / "d.yaml")

    return wired


def alone(kind: str, settings: str = "") -> str:
    """A block that reads itself."""
    return f"  a: {{type: {kind}, inputs: {{u: a.y}}{', ' if settings else ''}{settings}}}\n"


# ---- sizes ----


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "s",
    [
        [1e9, 1e-10],
        [1e-10, 1e9],
        [1e12, 1e-12, 1.0, 1e6],
        [1e-15, 1e-3, 1e15, 1e-9, 1e9, 1e3],
        [1.0, 1e-30],
    ],
)
def test_a_small_unknown_beside_large_ones_is_as_exact_as_alone(load, trajectories, s, engine):
    """Either root of the second kind is right, at all times the same."""
    got = trajectories(load(alone("Own", f"dimensions: {{n: {len(s)}}}, parameters: {{s: {s}}}")), "a.y", engine=engine)
    found = got["a.y"] / np.array(s)
    np.testing.assert_allclose(found[:, ::2], COSINE, rtol=1e-12)
    root = 0.5 * math.sqrt(1.0 + 4e4) - 0.5
    for unknown in found[:, 1::2].T:
        np.testing.assert_allclose(unknown, root if unknown[0] > 0.0 else -1.0 - root, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("s", [1e-12, 1e-15, 1e-20, 1.0])
def test_a_small_unknown_that_reads_a_zero_is_as_exact_as_alone(load, trajectories, s, engine):
    """Of a zero nothing tells the size, but it has no rounding errors."""
    got = trajectories(load(alone("AfterZero", f"parameters: {{s: {s}}}")), "a.y", engine=engine)["a.y"]
    assert np.array_equal(got[:, 0], np.zeros(6))
    np.testing.assert_allclose(got[:, 1] / s, COSINE, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_flow_of_a_leak_beside_a_pressure(load, trajectories, engine):
    """p = 1.5e7 Pa; with w = q / s, w + w² = 7500."""
    p, q = trajectories(load(alone("Leak")), "a.y", engine=engine)["a.y"].T
    np.testing.assert_allclose(p, 1.5e7, rtol=1e-12)
    np.testing.assert_allclose(q, 1e-10 * (math.sqrt(7500.25) - 0.5), rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("L", [1.0, 1e6, 1e12])
@pytest.mark.parametrize(("k", "c"), [(1.0, 0.0), (1.0, 1e-9), (-1e3, 1.0), (1.0, 1e5)])
def test_a_small_difference_of_large_unknowns_has_their_rounding_errors(load, trajectories, L, k, c, engine):
    got = trajectories(load(alone("Apart", f"parameters: {{L: {L}, k: {k}, c: {c}}}")), "a.y", engine=engine)["a.y"]
    np.testing.assert_allclose(got[:, :2], L * COSINE, rtol=1e-12)
    assert np.abs(got[:, 2] - c).max() <= 1e-12 * c + abs(k) * 16 * np.spacing(L)


@pytest.mark.parametrize("engine", ENGINES)
def test_quantities_that_are_zero_are_found_in_any_units(load, trajectories, engine):
    """1 / (Pa s / m³) and its reciprocal, of a loop at rest: its matrix is regular, whatever the numbers look like."""
    matrix = [[0.8, -1.4e13, 0.0, 0.0], [1.2e-13, 0.0, 0.0, 0.0], [-0.02, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]]
    for c, last in (([0.0] * 4, 0.0), ([0.0, 0.0, 0.0, 3.0], 1.5)):
        text = alone("Mix", f"dimensions: {{n: 4}}, parameters: {{K: {matrix}, c: {c}}}")
        got = trajectories(load(text), "a.y", engine=engine)["a.y"]
        assert np.array_equal(got[:, :3], np.zeros((6, 3)))
        np.testing.assert_allclose(got[:, 3], last, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("k", [0.3, -0.7, 0.999, 3.3, -33.3])
def test_what_is_switched_off_is_zero(load, trajectories, k, engine):
    """Whatever differences make of slopes, of which a step leaves a rest."""
    got = trajectories(load(alone("Switched", f"parameters: {{k: {k}}}")), "a.y", engine=engine)["a.y"]
    assert (np.abs(got[:3, 0]) > 0.01).all() and np.array_equal(got[3:, :2], np.zeros((3, 2)))
    np.testing.assert_allclose(got[3:, 2], COSINE, rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("k", [0.9, 0.999, 0.999999, -1e3, 1e5])
def test_a_loop_is_solved_to_rounding(load, trajectories, k, engine):
    """y = k y + 1: rounding errors of k y and 1, a few, over 1 - k."""
    got = trajectories(load(alone("Line", f"parameters: {{k: {k}}}")), "a.y", engine=engine)["a.y"]
    y = 1.0 / (1.0 - k)
    np.testing.assert_allclose(got, y, rtol=0, atol=2.0**-48 * (abs(k * y) + abs(y) + 1.0) / abs(1.0 - k))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("k", [0.25, 0.5, -0.5, 3.0, -3.0, -100.0])
@pytest.mark.parametrize("c", [1.0, 0.3, 1e-3])
def test_a_loop_through_float32_is_as_exact_as_that(load, trajectories, k, c, engine):
    """b = k b + c + 0.1, of which k b + c is rounded to 24 bits."""
    blocks = (
        f"  a: {{type: Coarse, parameters: {{k: {k}, c: {c}}}, inputs: {{u: b.y}}}}\n"
        "  b: {type: Widened, inputs: {u: a.y}}\n"
    )
    got = trajectories(load(blocks), "b.y", engine=engine)["b.y"]
    b = (c + 0.1) / (1.0 - k)
    np.testing.assert_allclose(got, b, rtol=0, atol=2.0**-20 * (abs(k * b) + abs(c) + abs(b)) / abs(1.0 - k))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_loop_through_matrices(load, trajectories, engine):
    """a = b' / 4 + c and b = -3 a' + d, where c and d count i + 2 j of what they transpose."""
    blocks = (
        "  a: {type: Transposed, dimensions: {n: 2, p: 3}, parameters: {k: 0.25}, inputs: {u: b.y}}\n"
        "  b: {type: Transposed, dimensions: {n: 3, p: 2}, parameters: {k: -3.0}, inputs: {u: a.y}}\n"
    )
    got = trajectories(load(blocks), "a.y", "b.y", engine=engine)
    c, d = ((np.arange(n) + 2.0 * np.arange(p)[:, None]) for n, p in ((2, 3), (3, 2)))
    a = (0.25 * d.T + c) / 1.75
    np.testing.assert_allclose(got["a.y"], np.stack([a] * 6), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(got["b.y"], np.stack([-3.0 * a.T + d] * 6), rtol=1e-12, atol=1e-14)


# ---- jumps ----


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("L", [1e-3, 1.0, 1e9])
@pytest.mark.parametrize(
    ("at", "by", "below"),
    [(0.0, 1e-7, 1.0), (0.0, 1e-12, 1e3), (1.0, 1e-9, 1.0), (-1e-3, 1e-12, 1e-3), (1e-9, 1e-18, 1e-6)],
)
def test_a_jump_over_the_solution_is_none_beside_unknowns_of_any_size(load, trajectories, L, at, by, below, engine):
    text = alone("Jump", f"parameters: {{L: {L}, at: {at}, by: {by}, below: {below}}}")
    with pytest.raises(BlockFailed, match="no solution was found of the algebraic loop of a at t = 0 s"):
        trajectories(load(text), "a.y", engine=engine)


# ---- what nothing determines ----

UNDETERMINED = {
    "a member of a fleet": (
        "  a: {type: Line, per: m, inputs: {u: b.y}, parameters: {k: [0.5, 1.0, 0.5], c: [1, 0, 0]}}\n"
        "  b: {type: Line, per: m, inputs: {u: a.y}, parameters: {k: 1.0, c: 0.0}}\n",
        r"of b, a \(m 2\) leaves a.y",
    ),
    "a member that reads itself": (
        "  a: {type: Line, per: m, inputs: {u: a.y}, parameters: {k: [0.5, 0.25, 1.0], c: [1, 2, 0]}}\n",
        r"of a \(m 3\) leaves a.y",
    ),
    "one of two": (alone("Beside"), "of a leaves a.y"),
    "two that say the same": (
        alone("Mix", "dimensions: {n: 2}, parameters: {K: [[0.5, 0.5], [0.5, 0.5]], c: [0, 0]}"),
        "of a leaves a.y",
    ),
    "two that say the same of a sum": (
        alone("Mix", "dimensions: {n: 3}, parameters: {K: [[0, -1, 0], [-1, 0, 0], [0.1, 0, 0.5]], c: [1, 1, 1]}"),
        "of a leaves a.y",
    ),
    "two that hand each other what they get, in different units": (
        alone("Mix", "dimensions: {n: 2}, parameters: {K: [[0, 1e12], [1e-12, 0]], c: [0, 0]}"),
        "of a leaves a.y",
    ),
    "three of which one follows from the others, to rounding": (
        alone(
            "Mix",
            "dimensions: {n: 3}, "
            "parameters: {K: [[0.1, 0.2, 0.7], [0.3, 0.3, 0.4], [0.6, 0.1, 0.3]], c: [-2.3, -0.5, 2.0]}",
        ),
        "of a leaves a.y",
    ),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", UNDETERMINED)
def test_what_nothing_determines_ends_the_run(load, trajectories, case, engine):
    """Some of it or all, whatever else there is to be solved: any figure would do."""
    blocks, said = UNDETERMINED[case]
    with pytest.raises(BlockFailed, match=said) as caught:
        trajectories(load(blocks, "fleets: {m: 3}\n"), "a.y", engine=engine)
    assert caught.value.position.line >= 3 and caught.value.fix


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "settings", ["dimensions: {n: 1}", "dimensions: {n: 3}", "dimensions: {n: 3}, parameters: {m: 3}"]
)
def test_what_becomes_undetermined_later_ends_the_run_there(load, trajectories, settings, engine):
    """All at once, at rest, or some of the unknowns while others go on."""
    with pytest.raises(BlockFailed, match=r"of a leaves a.y undetermined at t = 0.3 s: other values would do too"):
        trajectories(load(alone("Late", settings)), "a.y", engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("n", [0, 1, 2])
def test_a_number_that_is_not_written_is_named(load, trajectories, n, engine):
    with pytest.raises(BlockFailed, match=rf"block a: outputs\(\) has not written `y\[{n + 1}\]` at t = 0 s"):
        trajectories(load(alone("Partly", f"parameters: {{n: {n}}}")), "a.y", engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_number_that_is_not_written_is_named_behind_others(load, trajectories, engine):
    """What reads it gives no number either, but is not to blame; nor is what comes after the loop."""
    blocks = (
        "  b: {type: Partly, inputs: {u: c.y}, parameters: {n: 2}}\n"
        "  c: {type: Mix, dimensions: {n: 3}, parameters: {K: [[1, 0, 1], [0, 1, 1], [0, 0, 1]], c: [0, 0, 0]}, "
        "inputs: {u: b.y}}\n"
        '  last: {type: Line, inputs: {u: "c.y[1]"}}\n'
    )
    with pytest.raises(BlockFailed, match=r"block b: outputs\(\) has not written `y\[3\]` at t = 0 s"):
        trajectories(load(blocks), "last.y", engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("period", [0.1, 0.2, 0.3])
def test_what_sampled_blocks_hold_is_determined(load, trajectories, period, engine):
    """A loop of them alone: y = u / 2 + 1 of each other when they are due, so 2; in between nothing is computed."""
    blocks = (
        f"  a: {{type: Held, period: {period}, inputs: {{u: b.y}}}}\n"
        f"  b: {{type: Held, period: {period}, inputs: {{u: a.y}}}}\n"
    )
    got = trajectories(load(blocks), "a.y", "b.y", engine=engine)
    for values in got.values():
        np.testing.assert_allclose(values, 2.0, rtol=1e-12)


# ---- how it is solved ----


def test_both_engines_have_the_same_bits_and_the_same_words(load, trajectories):
    """Also in what is hard: scales, doubts, a member that is singular beside others that are not."""
    texts = [
        alone("Own", "dimensions: {n: 5}, parameters: {s: [1e9, 1e-10, 1.0, 1e-20, 1e3]}"),
        alone("Apart", "parameters: {L: 1e9, c: 1e-7}"),
        alone("Mix", "dimensions: {n: 2}, parameters: {K: [[0, 1], [1, 1e-6]], c: [1, 1]}"),
        alone("Line", "per: m, parameters: {k: [1000, -1e6, 0.999999], c: 1}"),
    ]
    for text in texts:
        network = load(text, "fleets: {m: 3}\n")
        one, other = (trajectories(network, "a.y", engine=engine)["a.y"] for engine in ENGINES)
        assert one.tobytes() == other.tobytes() and np.isfinite(one).all()


def test_a_loop_at_rest_is_evaluated_three_times_a_point(load, trajectories):
    """As it is, disturbed, and again."""
    network = load(alone("Counted"))
    trajectories(network, "a.y", engine="python")
    calls = network.components["a"].declaration.functions[0].python.__globals__["CALLS"]
    assert [calls.count(time) for time in (0.1, 0.2, 0.4)] == [3, 3, 3]


def test_a_fleet_that_reads_itself_is_solved_member_by_member(load):
    one = load("  a: {type: Line, per: m, inputs: {u: a.y}}\n", "fleets: {m: 1000}\n")
    whole = load("  a: {type: Mix, inputs: {u: a.y}, dimensions: {n: 7}, parameters: {K: 0.1, c: 1.0}}\n")
    (single,), (dense,) = one.evaluation, whole.evaluation
    assert loops.systems(one, single) == (1000, 1) and loops.systems(whole, dense) == (1, 7)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_large_loop_gives_signs_of_life(load, engine):
    """For each equation that is eliminated and each evaluation, so that it is not taken for a block that hangs."""
    n = 40
    network = load(alone("Mix", f"dimensions: {{n: {n}}}, parameters: {{K: 0.01, c: 1.0}}"))
    built = program.build(network, "jacobi")
    one = Simulation(built, compilation.compile_program(built) if engine == "native" else None)
    one.initialize()
    assert one.control[ALIVE] >= 2 * n


def test_who_watches_a_run_looks_at_the_signs_of_life(load):
    control = np.zeros(CONTROL_WORDS, np.int64)
    watch = Watch(program.build(load(alone("Line")), "jacobi"), control, {})
    before = watch.activity()
    control[ALIVE] += 1
    assert watch.activity() != before


def test_a_loop_whose_matrix_finds_no_memory_is_refused_before_the_run(load, monkeypatch):
    monkeypatch.setattr(sizes, "memory", lambda: 2**20)
    few, many = (alone("Own", f"dimensions: {{n: {n}}}, parameters: {{s: 1.0}}") for n in (200, 300))
    assert load(few)
    with pytest.raises(DiagramErrors) as caught:
        load(many)
    (mistake,) = caught.value.errors
    assert isinstance(mistake, TooLarge) and mistake.position.line == 3 and mistake.fix
    assert mistake.message == (
        "the 300 unknowns of the algebraic loop of a need 1.37 MiB of memory, and there are 1 MiB"
    )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("first", ["p", "q"])
def test_gauss_seidel_solves_a_loop_anew_after_each_turn(load, trajectories, first, engine):
    """p = x + u / 2 and q = x - u / 4 read each other, dx/dt = 1 - u of both; against the assignments of a step."""
    blocks = (
        "  p: {type: Lead, start: {x: 1.0}, parameters: {k: 0.5}, inputs: {u: q.y}}\n"
        "  q: {type: Lead, start: {x: -2.0}, parameters: {k: -0.25}, inputs: {u: p.y}}\n"
    )
    network = load(blocks)
    network.diagram.run.method, network.diagram.run.order = "gauss-seidel", (first,)
    got = trajectories(network, "p.y", "q.y", "p.x", engine=engine)
    x = {"p": 1.0, "q": -2.0}

    def solved() -> dict[str, float]:
        y = (x["p"] + 0.5 * x["q"]) / 1.125
        return {"p": y, "q": x["q"] - 0.25 * y}

    y = solved()
    for k in range(6):
        np.testing.assert_allclose([got[n][k] for n in ("p.y", "q.y", "p.x")], [*y.values(), x["p"]], rtol=1e-12)
        for name in (first, "q" if first == "p" else "p"):
            x[name] += 0.1 * (1.0 - y["q" if name == "p" else "p"])
            y = solved()
