"""Values keep the limits that their variables declare, or the diagram is refused at the value's place."""

from __future__ import annotations

import pytest

from cosim.engine import run
from cosim.errors import DeclarationError, DiagramErrors, WrongValue
from cosim.language.values import Value
from cosim.wiring.network import Signal
from cosim.wiring.revaluing import revalue

OWN = """
from cosim import Block, Input, Output, Parameter, State

class Arm(Block):
    u = Input(unit="N.m", min=-5, max=5.0, start=0.0)
    q = State(2, output=True, min=(-1.0, -10.0), max=2.0)
    J = Parameter("n", unit="kg.m2", default=1.0, min=0.5, max=10.0)
    count = Parameter(dtype=int, default=3, min=1)
    y = Output(max=1.0)
    def outputs(u, count, y):
        y[0] = 100.0 * u + count
    def derivatives(u, J, q, d_q):
        for i in range(2):
            d_q[i] = u / J[0]

class Wrong(Block):
    c = Parameter("n", default=[1.0, 2.0, 3.0], min=(0.0, 0.0))
    T = Parameter(default=0.0, min=0.1)
    y = Output()
    def outputs(c, T, y):
        y[0] = c[0] + T
"""
DIAGRAM = """
run: {stop: 1, step: 0.1}
fleets: {arm: 3}
blocks:
  arm:
    python: own.py:Arm
    per: arm
    dimensions: {n: 2}
"""


@pytest.fixture
def load(tmp_path):
    (tmp_path / "own.py").write_text(OWN)

    def loaded(text: str):
        (tmp_path / "d.yaml").write_text(DIAGRAM + text)
        return run.load(tmp_path / "d.yaml")

    return loaded


def only_error(load, text: str):
    with pytest.raises(DiagramErrors) as caught:
        load(text)
    (error,) = caught.value.errors
    return error


@pytest.mark.parametrize(
    ("text", "message", "fix"),
    [
        ("    parameters: {J: 0.25}\n", "block arm: `J[1]` is 0.25, below its minimum, 0.5", "from 0.5 to 10 kg.m2"),
        (
            "    parameters: {J: [[1, 1], [1, 10.5], [1, 1]]}\n",
            "block arm: `J[2]` of arm 2 is 10.5, above its maximum, 10",
            "from 0.5 to 10",
        ),
        ("    parameters: {J: '4*i'}\n", "block arm: `J[1]` of arm 3 is 12, above its maximum, 10", "0.5 to 10"),
        ("    parameters: {count: 0}\n", "block arm: `count` is 0, below its minimum, 1", "from 1 on"),
        ("    start: {u: -5.1}\n", "block arm: `u` is -5.1, below its minimum, -5", "from -5 to 5 N.m"),
        ("    start: {q: [0, -11]}\n", "block arm: `q[2]` is -11, below its minimum, -10", "from (-1, -10) to 2"),
        ("    start: {q: [-2, -2]}\n", "block arm: `q[1]` is -2, below its minimum, -1", "from (-1, -10) to 2"),
    ],
)
def test_a_value_beyond_a_limit_is_an_error_at_its_place(load, text, message, fix):
    error = only_error(load, text)
    assert isinstance(error, WrongValue)
    assert error.message == message and fix in error.fix
    assert (error.position.line, error.position.column > 10) == (9, True)


@pytest.mark.parametrize("text", ["    parameters: {J: [0.5, 10]}\n", "    start: {u: -5, q: [-1.0, 2.0]}\n"])
def test_limits_are_allowed_themselves(load, text):
    assert load(text).components["arm"].values["count"] == 3


def test_what_is_computed_is_not_held_to_limits(load, trajectories):
    got = trajectories(load("    start: {u: 3.0}\n"), "arm.y", engine="native")
    assert got["arm.y"][0, 0] == 303.0


def test_other_values_for_the_same_network_are_held_to_limits_too(load):
    network = load("")
    signal, position = Signal("arm", "J"), network.components["arm"].entry.position
    assert revalue(network, {signal: Value.of(9.0, position)}).components["arm"].values["J"].max() == 9.0
    with pytest.raises(DiagramErrors, match="`J\\[1\\]` is 11, above its maximum, 10"):
        revalue(network, {signal: Value.of(11.0, position)})


def test_a_default_beyond_a_limit_is_named_as_such(load):
    errors = only_error(load, "  wrong: {python: own.py:Wrong, parameters: {c: [1, 2]}}\n")
    assert errors.message == "block wrong: the default of `T`: `T` is 0, below its minimum, 0.1"


def test_limits_for_each_element_have_to_be_as_many(load):
    error = only_error(load, "  wrong: {python: own.py:Wrong, parameters: {T: 1}}\n")
    assert isinstance(error, DeclarationError)
    assert error.message == "block wrong: `min` of `c` has 2 entries for 3 elements"
