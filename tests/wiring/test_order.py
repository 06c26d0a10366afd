import re

import numpy as np
import pytest

from cosim.errors import AlgebraicLoop, DiagramErrors
from cosim.wiring import order, overview
from cosim.wiring.network import Task

CHAIN = """
run: {stop: 1, step: 0.1}
blocks:
  last: {type: Gain, inputs: {u: middle.y}}
  middle: {type: Gain, inputs: {u: lag.y}}
  lag: {type: Lag, inputs: {u: source.y}}
  source: {type: Sine, parameters: {A: 1}}
"""


def test_outputs_come_after_what_they_read(wired):
    tasks = [f"{t.component}.{t.function}" for t in order.evaluation_order(wired(CHAIN))]
    assert tasks.index("source.outputs") < tasks.index("lag.outputs") < tasks.index("middle.outputs")
    assert tasks.index("middle.outputs") < tasks.index("last.outputs")


def test_a_state_breaks_a_loop(wired):
    network = wired(
        """
        run: {stop: 1, step: 0.1}
        blocks:
          gain: {type: Gain, inputs: {u: integrator.x}, dimensions: {n: 1}}
          integrator: {type: Integrator, inputs: {u: gain.y}}
        """
    )
    assert [t.component for t in order.evaluation_order(network)] == ["gain"]


def test_only_the_functions_that_derivatives_read_are_needed(wired):
    lag = wired(CHAIN).components["lag"]
    assert [f.name for f in order.needed_outputs(lag)] == ["outputs_mean"]


def test_algebraic_loops_are_items_of_the_order_each_torn_once(wired):
    network = wired(
        """
        run: {stop: 1, step: 0.1}
        blocks:
          last: {type: Gain, inputs: {u: b.y}}
          a: {type: Gain, inputs: {u: b.y}, dimensions: {n: 1}}
          b: {type: Gain, inputs: {u: a.y}}
          own: {type: Gain, inputs: {u: own.y}, dimensions: {n: 1}}
        """
    )
    first, own, last = sorted(network.evaluation, key=lambda item: (isinstance(item, Task), str(item)))
    assert {task.component for task in first.tasks} == {"a", "b"} and len(first.torn) == 1
    assert {task.component for task in own.tasks} == {"own"} and [str(signal) for signal in own.torn] == ["own.y"]
    assert last.component == "last" and network.evaluation.index(first) < network.evaluation.index(last)
    assert first.tasks[-1].component == first.torn[0].component  # what is torn is computed last


def test_a_loop_of_whole_numbers_is_named_port_by_port(wired):
    with pytest.raises(DiagramErrors) as caught:
        wired(
            """
            run: {stop: 1, step: 0.1}
            blocks:
              one: {type: Numbers, inputs: {k: other.y}, dimensions: {members: 2}}
              other: {type: Numbers, inputs: {k: one.y}}
            """
        )
    (loop,) = caught.value.errors
    assert isinstance(loop, AlgebraicLoop) and loop.position.line
    text = (
        r"algebraic loop: (one.y → other.y → one.y|other.y → one.y → other.y), in which `(one|other).y` is int32: only"
    )
    assert re.match(text, loop.message)


FOLLOWER = """
from cosim import Block, Input, Local, Output, State

class Follower(Block):
    '''dx/dt = -x, which begins where its input is.'''
    u = Input()
    x = State(output=True)
    def start(u, x):
        x[0] = u
    def derivatives(x, d_x):
        d_x[0] = -x

class Threefold(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = 3.0 * u

class Chain(Block):
    '''dx/dt = 8 u, by way of two locals.'''
    u = Input()
    x = State(output=True)
    twice = Local()
    fourfold = Local()
    unused = Local()
    def outputs_twice(u, twice):
        twice[0] = 2.0 * u
    def outputs_fourfold(twice, fourfold):
        fourfold[0] = 2.0 * twice
    def outputs_unused(fourfold, unused):
        unused[0] = fourfold
    def derivatives(fourfold, d_x):
        d_x[0] = 2.0 * fourfold
"""
RING = """
run: {stop: 1, step: 0.5}
blocks:
  a: {python: own.py:Follower, inputs: {u: b.x}}
  b: {python: own.py:Follower, inputs: {u: gain.y}}
  gain: {python: own.py:Threefold, inputs: {u: a.x}}
"""


def test_a_ring_of_start_values_says_which_would_cut_it(wired, tmp_path):
    (tmp_path / "own.py").write_text(FOLLOWER)
    with pytest.raises(DiagramErrors) as caught:
        wired(RING)
    (loop,) = caught.value.errors
    assert isinstance(loop, AlgebraicLoop) and loop.position.line
    assert loop.message.startswith("algebraic loop at initialization: ")
    assert "blocks.a.start.x" in loop.fix and "blocks.b.start.x" in loop.fix


@pytest.mark.parametrize(("given", "expected"), [("a", (5.0, 15.0)), ("b", (5.0, 5.0))])
def test_a_given_start_value_cuts_a_ring_of_start_values(wired, tmp_path, trajectories, given, expected):
    """x_b = 3 x_a and x_a = x_b at time zero, of which the given value replaces one."""
    (tmp_path / "own.py").write_text(FOLLOWER)
    network = wired(RING, f"blocks.{given}.start.x=5")
    found = trajectories(network, "a.x", "b.x", engine="python")
    assert (found["a.x"][0], found["b.x"][0]) == expected


def test_outputs_that_derivatives_read_through_others_are_evaluated_in_every_stage(wired, tmp_path, trajectories):
    (tmp_path / "own.py").write_text(FOLLOWER)
    text = "run: {stop: 1, step: 0.5}\nblocks:\n  c: {python: own.py:Chain, inputs: {u: f.x}}\n"
    text += "  f: {python: own.py:Follower, inputs: {u: c.x}, start: {x: 1}}\n"
    network = wired(text)
    assert [f.name for f in order.needed_outputs(network.components["c"])] == ["outputs_twice", "outputs_fourfold"]
    found = trajectories(network, "c.x", "f.x", engine="python")
    assert list(found["c.x"]) == [0.0, 4.0, 6.0]  # 8 h u, and u = 1, 1/2, 1/4


TWO_OUTPUTS = """
from cosim import Block, Input, Output, State

class Two(Block):
    '''dx/dt = 1, with one output before what its other output reads.'''
    z = Input()
    x = State(output=True)
    f = Output()
    h = Output()
    def outputs_f(x, f):
        f[0] = x
    def outputs_h(x, z, h):
        h[0] = z + x
    def derivatives(d_x):
        d_x[0] = 1.0

class Three(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = 3.0 * u

class Integral(Block):
    u = Input()
    x = State(output=True)
    def derivatives(u, d_x):
        d_x[0] = u

class Lead(Block):
    '''y = x + u, dx/dt = 1'''
    u = Input()
    x = State(output=True)
    y = Output()
    def outputs(u, x, y):
        y[0] = x + u
    def derivatives(d_x):
        d_x[0] = 1.0
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("source", ["b.x", "b.f"])
def test_what_stands_between_two_outputs_of_a_block_sees_the_new_one(wired, tmp_path, trajectories, source, engine):
    """x = f = t, and c integrates 3 f at the later time of each step; h = x + 3 f."""
    (tmp_path / "own.py").write_text(TWO_OUTPUTS)
    text = f"""
        run: {{stop: 0.5, step: 0.125, method: gauss-seidel}}
        blocks:
          b: {{python: own.py:Two, inputs: {{z: g.y}}}}
          g: {{python: own.py:Three, inputs: {{u: {source}}}}}
          c: {{python: own.py:Integral, inputs: {{u: g.y}}}}
          d: {{python: own.py:Integral, inputs: {{u: b.h}}}}
        """
    got = trajectories(wired(text), "c.x", "d.x", engine=engine)
    sums = 0.125 * np.cumsum(0.125 * np.arange(5))
    assert np.array_equal(got["c.x"], 3.0 * sums) and np.array_equal(got["d.x"], 4.0 * sums)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_block_behind_a_ring_of_feedthrough_waits_for_it(wired, tmp_path, trajectories, engine):
    """It reads what they have come to, wherever it stands: x = t of both, so that it integrates t + h."""
    (tmp_path / "own.py").write_text(TWO_OUTPUTS)
    text = """
        run: {stop: 0.5, step: 0.125, method: gauss-seidel}
        blocks:
          behind: {python: own.py:Integral, inputs: {u: two.x}}
          one: {python: own.py:Lead, inputs: {u: two.x}}
          two: {python: own.py:Lead, inputs: {u: one.x}}
        """
    got = trajectories(wired(text), "behind.x", engine=engine)["behind.x"]
    assert np.array_equal(got, 0.125 * np.cumsum(0.125 * np.arange(5)))


RING_OF_THREE = """
run: {{stop: 1, step: 0.125, method: gauss-seidel{order}}}
blocks:
  a: {{python: own.py:Integral, start: {{x: 1.0}}, inputs: {{u: g.y}}}}
  b: {{python: own.py:Integral, start: {{x: -2.0}}, inputs: {{u: a.x}}}}
  c: {{python: own.py:Integral, start: {{x: 0.5}}, inputs: {{u: b.x}}}}
  g: {{python: own.py:Three, inputs: {{u: c.x}}}}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("given", "turns"),
    [("", "abc"), ("cba", "cba"), ("b", "bca"), ("cb", "cba"), ("ac", "acb"), ("bac", "bac")],
)
def test_turns_are_taken_in_the_order_that_is_given(wired, tmp_path, trajectories, given, turns, engine):
    """The others follow, each after what it reads. Against the three assignments of a step, written in that order."""
    (tmp_path / "own.py").write_text(TWO_OUTPUTS)
    order_ = f", order: [{', '.join(given)}]" if given else ""
    network = wired(RING_OF_THREE.format(order=order_))
    got = trajectories(network, "a.x", "b.x", "c.x", engine=engine)
    x = {"a": 1.0, "b": -2.0, "c": 0.5}
    expected = [tuple(x.values())]
    for _ in range(8):
        for name in turns:
            u = {"a": 3.0 * x["c"], "b": x["a"], "c": x["b"]}[name]
            x[name] = x[name] + 0.125 * u
        expected.append(tuple(x.values()))
    assert np.array_equal(np.stack([got[f"{name}.x"] for name in "abc"], 1), expected)
    assert overview.describe(network).turns == tuple(turns)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("method: gauss-seidel, order: [a, ^g]", "`run.order`: g has no turn, as it is evaluated whenever it is read"),
        ("method: gauss-seidel, order: [a, ^aa]", "`aa` names no block of the diagram"),
        ("method: gauss-seidel, order: [a, ^a]", "`run.order` names `a` twice"),
        ("method: gauss-seidel, order: ^a", "`run.order` must be a list of blocks, not the text `a`"),
        ("method: gauss-seidel, order: [^[a]]", "`run.order` must be text, not a list"),
        ("method: gauss-seidel, order: [a, ^3]", "`run.order` must be text, not `3`"),
        ("method: jacobi, ^order: [a]", "`run.order` is of no use under `jacobi`, where no block takes its turn"),
    ],
)
def test_what_an_order_cannot_be_is_said_at_its_place(wired, tmp_path, settings, said):
    (tmp_path / "own.py").write_text(TWO_OUTPUTS)
    text = RING_OF_THREE.format(order="").replace("method: gauss-seidel", settings)
    column = text.splitlines()[1].index("^") + 1
    with pytest.raises(DiagramErrors) as caught:
        wired(text.replace("^", ""))
    (mistake,) = caught.value.errors
    assert mistake.message.startswith(said) and mistake.fix
    assert (mistake.position.line, mistake.position.column) == (2, column)


def test_an_empty_order_goes_with_every_method(wired, tmp_path):
    (tmp_path / "own.py").write_text(TWO_OUTPUTS)
    for method in ("jacobi", "joint"):
        network = wired(RING_OF_THREE.format(order=", order: []").replace("gauss-seidel", method))
        assert overview.describe(network).turns == ()
