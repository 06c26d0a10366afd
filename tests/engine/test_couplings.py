"""Inputs that are read late or extrapolated: orders as theory has them, delays against hand-written loops."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.engine import run
from cosim.errors import DiagramErrors

BLOCKS = '''
from cosim import Block, Input, Output, Parameter, State


class Mass(Block):
    """m dv/dt = F - k x - c v"""

    F = Input()
    m = Parameter()
    k = Parameter()
    c = Parameter()
    x = State(output=True)
    v = State(output=True)

    def derivatives(F, m, k, c, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = (F - k * x - c * v) / m


class Tied(Block):
    """A mass that is tied to another by a spring and a damper."""

    X = Input()
    V = Input()
    m = Parameter()
    k = Parameter()
    c = Parameter()
    k_12 = Parameter()
    c_12 = Parameter()
    x = State(output=True)
    v = State(output=True)

    def derivatives(X, V, m, k, c, k_12, c_12, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = (k_12 * (X - x) + c_12 * (V - v) - k * x - c * v) / m


class Spring(Block):
    x_1 = Input()
    x_2 = Input()
    v_1 = Input()
    v_2 = Input()
    k = Parameter()
    c = Parameter()
    F = Output()
    R = Output()

    def outputs(x_1, x_2, v_1, v_2, k, c, F, R):
        F[0] = k * (x_2 - x_1) + c * (v_2 - v_1)
        R[0] = -F[0]


class Sine(Block):
    y = Output()
    n = Output(dtype=int)

    def outputs(time, y, n):
        y[0] = math.sin(3.0 * time)
        n[0] = int(100.0 * time + 0.5)


class Gain(Block):
    u = Input()
    k = Parameter(default=1.0)
    y = Output()

    def outputs(u, k, y):
        y[0] = k * u


class Integers(Block):
    u = Input(dtype=int)
    y = Output(dtype=int)

    def outputs(u, y):
        y[0] = u


class Integrator(Block):
    u = Input()
    x = State(output=True)

    def derivatives(u, d_x):
        d_x[0] = u
'''
M, K, C, K_12, C_12 = (1.0, 2.0), (1.0, 3.0), (0.1, 0.2), 5.0, 0.3
BY_A_SPRING = """
run: {stop: 4, step: 0.02, integrator: rk4, inner_steps: 4}
blocks:
  a: {own:Mass, parameters: {m: 1, k: 1, c: 0.1}, start: {x: 1}, inputs: {F: s.F}}
  b: {own:Mass, parameters: {m: 2, k: 3, c: 0.2}, inputs: {F: s.R}}
  s: {own:Spring, parameters: {k: 5, c: 0.3}, inputs: {x_1: a.x, x_2: b.x, v_1: a.v, v_2: b.v}}
"""
TIED = """
run: {stop: 4, step: 0.02, integrator: rk4, inner_steps: 4}
blocks:
  a: {own:Tied, parameters: {m: 1, k: 1, c: 0.1, k_12: 5, c_12: 0.3}, start: {x: 1}, inputs: {X: b.x, V: b.v}}
  b: {own:Tied, parameters: {m: 2, k: 3, c: 0.2, k_12: 5, c_12: 0.3}, inputs: {X: a.x, V: a.v}}
"""


@pytest.fixture
def wired(tmp_path):
    (tmp_path / "own.py").write_text("import math\n" + BLOCKS)

    def wire(text, *settings):
        path = tmp_path / "d.yaml"
        path.write_text(text.replace("own:", "python: own.py:"))
        return run.load(path, settings)

    return wire


def exact(times):
    """x_1 of the two masses, by the matrix exponential."""
    (m, n), (k, q), (c, r) = M, K, C
    own = [[0, 1, 0, 0], [-(k + K_12) / m, -(c + C_12) / m, K_12 / m, C_12 / m]]
    other = [[0, 0, 0, 1], [K_12 / n, C_12 / n, -(q + K_12) / n, -(r + C_12) / n]]
    return np.array([(expm(np.array([*own, *other]) * t) @ [1, 0, 0, 0])[0] for t in times])


def error(network, trajectories):
    x = trajectories(network, "a.x")["a.x"]
    return np.abs(x - exact(np.linspace(0, 4, len(x)))).max()


@pytest.mark.parametrize("extrapolation", [0, 1])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("text", [BY_A_SPRING, TIED], ids=["spring", "tied"])
def test_coupling_is_of_one_order_more_than_what_is_extrapolated(wired, trajectories, text, method, extrapolation):
    settings = f"run.method={method}", f"run.extrapolation={extrapolation}"
    steps = 0.02, 0.01, 0.005
    errors = [error(wired(text, f"run.step={h}", *settings), trajectories) for h in steps]
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders == pytest.approx([extrapolation + 1] * 2, abs=0.15), errors


#: By integrator, how far what it integrates exactly may be off: those that linearize do so in time by a difference of
#: 1.5e-8 of a step, which costs as many digits.
ROUNDING = {"heun": 1e-14, "rk4": 1e-14, "rodas4": 1e-9, "rodas5p": 1e-9}


@pytest.mark.parametrize("integrator", ROUNDING)
def test_an_exact_polynomial_is_extrapolated_exactly(wired, trajectories, integrator):
    """dx/dt = u with u = 2 t: linear extrapolation knows it from the second step on, and is integrated exactly."""
    text = """
    run: {stop: 1, step: 0.125}
    blocks:
      one: {own:Integrator, inputs: {u: two.y}}
      two: {own:Gain, parameters: {k: 2}, inputs: {u: ramp.x}}
      ramp: {own:Integrator, inputs: {u: unit.y}}
      unit: {own:Gain, inputs: {u: one_.x}}
      one_: {own:Integrator, inputs: {u: nothing.y}, start: {x: 1}}
      nothing: {own:Gain, parameters: {k: 0}, inputs: {u: one_.x}}
    """
    settings = "run.extrapolation=1", f"run.integrator={integrator}"
    x = trajectories(wired(text, *settings), "one.x")["one.x"]
    times = np.arange(9) * 0.125
    missed = 0.125**2  # of the first step, in which u is held at 0
    assert x[1:] == pytest.approx((times**2 - missed)[1:], abs=ROUNDING[integrator])


DELAYED = """
run: {stop: 1, step: 0.01}
blocks:
  source: {own:Sine}
  late: {own:Gain, inputs: {u: {from: source.y, delay: 0.05}}}
  between: {own:Gain, inputs: {u: {from: source.y, delay: 0.034}}}
  begun: {own:Gain, inputs: {u: {from: source.y, delay: 0.05}}, start: {u: -7}}
  whole: {own:Integers, inputs: {u: {from: source.n, delay: 0.034}}}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_a_delay_is_what_there_was(wired, trajectories, method, engine):
    names = "source.y", "late.y", "between.y", "begun.y", "whole.y"
    got = trajectories(wired(DELAYED, f"run.method={method}"), *names, engine=engine)
    y, first = got["source.y"], got["source.y"][0]
    assert np.array_equal(got["late.y"], [*[first] * 5, *y[:-5]])  # whole steps: the very samples
    assert np.array_equal(got["begun.y"], [*[-7.0] * 5, *y[:-5]])
    weights = 0.6 * y[:-4][1:] + 0.4 * y[:-4][:-1]  # 0.034 s before t_k is 0.6 of the way from t_{k-4} to t_{k-3}
    assert got["between.y"][4:-1] == pytest.approx(weights[: len(got["between.y"][4:-1])], abs=1e-14)
    assert got["whole.y"].tolist() == [max(k - 4, 0) for k in range(101)]  # the newest that is old enough


@pytest.mark.parametrize("integrator", ROUNDING)
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_a_delayed_feedback_keeps_to_the_method_of_steps(wired, trajectories, method, integrator):
    """dx/dt = -x(t - 1), x = 1 before: x = 1 - t, then 1 - t + (t - 1)²/2, exact for methods of order two."""
    text = """
    run: {stop: 2, step: 0.0625}
    blocks:
      x: {own:Integrator, inputs: {u: minus.y}, start: {x: 1}}
      minus: {own:Gain, parameters: {k: -1}, inputs: {u: {from: x.x, delay: 1}}}
    """
    direct = text.replace("inputs: {u: minus.y}", "inputs: {u: {from: minus.y, delay: 1}}").replace(
        "{u: {from: x.x, delay: 1}}", "{u: x.x}"
    )
    for which in (direct, text) if method == "joint" else (direct,):
        settings = f"run.method={method}", f"run.integrator={integrator}"
        x = trajectories(wired(which, *settings), "x.x")["x.x"]
        t = np.arange(33) * 0.0625
        assert x == pytest.approx(np.where(t <= 1, 1 - t, 1 - t + (t - 1) ** 2 / 2), abs=ROUNDING[integrator])


def test_a_delay_cuts_a_loop_and_its_start_value_the_initialization(wired, trajectories):
    text = """
    run: {stop: 0.5, step: 0.1}
    blocks:
      a: {own:Integers, inputs: {u: b.y}}
      b: {own:Integers, inputs: {u: {from: a.y, delay: 0.2}}, start: {u: 3}}
    """
    assert trajectories(wired(text), "a.y")["a.y"].tolist() == [3] * 6
    with pytest.raises(DiagramErrors, match="algebraic loop"):
        wired(text.replace(", start: {u: 3}", ""))


START_VALUES = """
run: {stop: 1, step: 0.1}
blocks:
  source: {own:Sine}
  late: {own:Gain, inputs: {u: {from: source.y, delay: 0.2}}, start: {u: 5}}
  x: {own:Integrator, inputs: {u: late.y}}
  two: {own:Integrator, inputs: {u: nothing.y}, start: {x: 2}}
  nothing: {own:Gain, parameters: {k: 0}, inputs: {u: two.x}}
  first: {own:Gain, inputs: {u: {from: two.x, delay: 0.25}}, start: {u: 5}}
  later: {own:Integrator, inputs: {u: {from: first.y, delay: 0.13}}}
"""


@pytest.mark.parametrize("step", [0.1, 0.025])
def test_where_a_start_value_ends_an_extrapolation_begins_anew(wired, trajectories, step):
    """dx/dt = 5 up to 0.2 s, then sin 3 (t - 0.2): the first step holds it, and then lines miss 5/12 h^3 of its bend.

    A line through the jump would miss some 2 h.
    """
    network = wired(START_VALUES, "run.extrapolation=1", f"run.step={step}", "run.integrator=heun")
    x = trajectories(network, "x.x", engine="python")["x.x"]
    assert abs(x[-1] - (1.0 + (1.0 - math.cos(2.4)) / 3.0)) <= (1.5 + 5 / 12 * 3 * 1.8) * step**2


def test_a_start_value_that_ends_arrives_through_a_second_delay(wired, trajectories):
    """Which is read as 5 up to 0.25 + 0.13 s, between two points, and as 2 after that."""
    x = trajectories(wired(START_VALUES, "run.integrator=heun"), "later.x", engine="python")["later.x"]
    assert x[-1] == pytest.approx(5 * 0.38 + 2 * 0.62, abs=1e-14)


CORNERS = """
run: {stop: 2, step: 0.05, integrator: dormand-prince, extrapolation: 2}
blocks:
  source: {own:Sine}
  hold: {own:Gain, period: 0.2, inputs: {u: source.y}}
  lag: {block: FirstOrder, parameters: {T: 0.2}, inputs: {u: WIRE}}
  x: {own:Integrator, inputs: {u: lag.x}}
"""


@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_where_what_is_sampled_bends_a_state_a_parabola_begins_anew(wired, trajectories, method, delay):
    """A lag of samples has a corner at each, and a parabola through one is of order 2; x integrates the lag."""
    lag, exact_x = 0.0, [0.0]
    for k in range(20):  # tenths of a second
        sample = (k - round(10.0 * delay)) // 2
        u = math.sin(0.6 * sample) if sample >= 0 else 1.0
        later = u + (lag - u) * math.exp(-0.5)
        lag, exact_x = later, [*exact_x, exact_x[-1] + 0.1 * u - 0.2 * (later - lag)]
    late = f"{{from: hold.y, delay: {delay}}}}}, start: {{u: 1}}}}"
    text = CORNERS.replace("WIRE}}", late if delay else "hold.y}}")
    errors = []
    for step in (0.05, 0.025, 0.0125):
        network = wired(text, f"run.step={step}", f"run.method={method}")
        x = trajectories(network, "x.x")["x.x"][:: round(0.1 / step)]
        errors.append(np.abs(x - exact_x).max())
    assert math.log2(errors[0] / errors[2]) / 2.0 == pytest.approx(3.0, abs=0.3), errors


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("delay: 0.034}}}\n  begun", "delay: 0.009}}}\n  begun", "`u` is read 0.009 s late, which is less than a step"),
        ("delay: 0.034}}}\n  begun", "delay: -1}}}\n  begun", "above zero"),
        ("delay: 0.034}}}\n  begun", "extrapolation: 1}}}\n  begun", "reads its inputs at communication points only"),
        ("{from: source.y, delay: 0.034}", "{delay: 0.034}", "does not say what is read"),
        ("{from: source.y, delay: 0.034}", "{from: source.y, dellay: 0.034}", "no key `dellay`"),
        ("step: 0.01", "step: 0.01, extrapolation: 1", "`run.extrapolation` changes nothing"),
        ("step: 0.01", "step: 0.01, extrapolation: 3", "must be a whole number from 0 to 2"),
    ],
)
def test_what_cannot_be_is_refused_at_its_place(wired, old, new, said):
    assert DELAYED.count(old) == 1
    with pytest.raises(DiagramErrors, match=said) as caught:
        wired(DELAYED.replace(old, new))
    assert all(error.position.line for error in caught.value.errors)


@pytest.mark.parametrize("step", ["", "step: .nan, ", "step: 0, "])
def test_a_delay_where_no_step_is_known_is_no_mistake_more(wired, step):
    with pytest.raises(DiagramErrors, match=r"run\.step") as caught:
        wired(DELAYED.replace("step: 0.01", step))
    assert len(caught.value.errors) == 1


def test_what_a_wire_says_is_resolved_to_the_same_diagram(wired, tmp_path):
    network = wired(DELAYED)
    path = tmp_path / "resolved.yaml"
    path.write_text(network.diagram.resolved())
    assert {n: c.couplings for n, c in run.load(path).components.items()} == {
        n: c.couplings for n, c in network.components.items()
    }
