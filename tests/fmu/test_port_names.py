"""`ports:` gathers variables of an FMU to arrays, by lists and ranges of names."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors
from tests.fmu import feedthrough, machine

KINDS = {
    "2 cs": (2, "cs", ""),
    "3 cs": (3, "cs", ""),
    "3 events": (3, "cs", feedthrough.EVENTFUL),
    "2 me": (2, "me", 'completedIntegratorStepNotNeeded="true"'),
    "3 me": (3, "me", ""),
}
CODE = """
import math

from cosim import Block, Input, Output


class Pairs(Block):
    pair = Output(2)
    whole = Output(2, dtype=int)
    truth = Output(2, 1, dtype=bool)

    def outputs(time, pair, whole, truth):
        pair[0] = math.sin(time)
        pair[1] = math.cos(time)
        whole[0] = int(time * 10.0 + 0.5)
        whole[1] = -whole[0]
        truth[0, 0] = whole[0] % 2 == 0
        truth[1, 0] = whole[0] % 3 == 0
"""
PORTS = """{pair: [u1, u2], whole: "i{1..2}", truth: [[b1], [b2]],
           pair_out: "u{1..2}_out", whole_out: [i1_out, i2_out], truth_out: [["b1_out"], [b2_out]]}"""


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The test FMU by kind."""
    folder = tmp_path_factory.mktemp("ports")
    return {kind: feedthrough.build(folder / kind.replace(" ", ""), *what) for kind, what in KINDS.items()}


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("kind", KINDS)
def test_gathered_values_arrive_in_their_places(write, fmus, trajectories, kind, engine):
    code = write(CODE, "pairs.py")
    text = f"""
        run: {{stop: 2, step: 0.1}}
        fleets: {{robot: 2}}
        blocks:
          source: {{python: {code}:Pairs, per: robot}}
          plant:
            fmu: {fmus[kind]}
            per: robot
            ports: {PORTS}
            inputs: {{pair: source.pair, whole: source.whole, truth: source.truth}}
        """
    names = ("pair", "whole", "truth")
    network = run.load(write(text))
    wanted = [f"{block}.{name}{end}" for name in names for block, end in (("source", ""), ("plant", "_out"))]
    got = trajectories(network, *wanted, engine=engine)
    late = 1 if kind.endswith("cs") else 0
    for name in names:
        here = got[f"plant.{name}_out"]
        assert np.array_equal(here[late:], got[f"source.{name}"][: len(here) - late]), name
    assert got["plant.truth_out"].shape == (21, 2, 2, 1)


@pytest.mark.parametrize("version", "23")
def test_gathered_states_are_one_state(machines, partners, trajectories, version):
    """The lag and the height of `machine.c` as one vector, beside the same FMU as it is."""
    text = f"""
        run: {{stop: 1, step: 0.01}}
        blocks:
          source: {{type: Source}}
          plain: {{fmu: {machines[version]}, mode: model-exchange, inputs: {{u: source.u}}, start: {{x: 0.5, h: 2}}}}
          plant:
            fmu: {machines[version]}
            mode: model-exchange
            ports: {{both: [h, x], T_lag: T}}
            parameters: {{T_lag: 1}}
            inputs: {{u: source.u}}
            start: {{both: [2, 0.5]}}
        """
    network = run.load(partners(text))
    assert {v.name for v in network.components["plant"].declaration.continuous()} == {"both", "v"}
    got = trajectories(network, "plain.x", "plain.h", "plant.both")
    assert np.array_equal(got["plant.both"][:, 0], got["plain.h"].ravel())
    assert np.array_equal(got["plant.both"][:, 1], got["plain.x"].ravel())
    assert np.ptp(got["plain.x"]) > 0.1


def test_an_element_of_what_is_gathered_by_itself_is_told_to_be_one(tmp_path, write):
    path = machine.build(tmp_path / "own", 2, "cs", edit=lambda xml: xml.replace('name="u"', 'name="u[1]"'))
    text = f"run: {{stop: 1, step: 1}}\nblocks: {{plant: {{fmu: {path}, ports: {{p: ['u[1]']}}}}}}\n"
    with pytest.raises(DiagramErrors, match=r"`u\[1\]` is an element of `u`, which is one array") as caught:
        run.load(write(text))
    assert "name `u`" in str(caught.value)


def test_arrays_gather_to_arrays_of_more_axes(tmp_path, write, trajectories):
    """A row of FMI 3 as a matrix of one."""
    path = feedthrough.build(tmp_path / "arrays", 3, "cs", feedthrough.EVENTFUL)
    keys = f"fmu: {path}, ports: {{m: [a], out: [a_out]}}, start: {{m: [[1, 2, 3, 4]]}}"
    text = f"run: {{stop: 1, step: 0.5}}\nblocks: {{plant: {{{keys}}}}}\n"
    network = run.load(write(text))
    assert network.components["plant"].declaration.variables["m"].shape == (1, 4)
    got = trajectories(network, "plant.out")
    assert np.array_equal(got["plant.out"], np.broadcast_to([[1.0, 2.0, 3.0, 4.0]], (3, 1, 4)))


def test_two_ranges_are_a_matrix(tmp_path, write):
    from tests.fmu import machine
    from tests.fmu.machine import Model, V

    variables = tuple(
        V(f"a_{i}_{j}", 10 * i + j, "Float64", "input", str(10 * i + j)) for j in (1, 2, 3) for i in (0, 1)
    )
    path = machine.pack(tmp_path, 2, Model("machine", variables), machine.SOURCE, "cs")
    text = f'run: {{stop: 1, step: 1}}\nblocks: {{plant: {{fmu: {path}, ports: {{a: "a_{{0..1}}_{{1..3}}"}}}}}}\n'
    variable = run.load(write(text)).components["plant"].declaration.variables["a"]
    assert variable.shape == (2, 3)
    assert variable.start == [[1, 2, 3], [11, 12, 13]]


@pytest.mark.parametrize(
    ("ports", "words"),
    [
        ("{p: [u1, u9]}", "has no variable `u9`"),
        ('{p: "u{1..4}"}', "has no variable `u4`"),
        ('{p: "u{2..1}"}', "the range 2..1 is empty or too long"),
        ('{p: "u{1..999999999}"}', "is empty or too long"),
        ("{p: []}", "`blocks.plant.ports.p` is an empty list"),
        ("{p: [u1, [u2]]}", "`p` gathers shapes that differ, () and (1,)"),
        ("{p: [u1, a]}", "`p` gathers shapes that differ, () and (4,)"),
        ("{p: [u1, i1]}", "`p` gathers variables of two types, Float64 and Int64"),
        ("{p: [u1, u1_out]}", "`p` gathers variables of two causalities, input and output"),
        ("{p: [u1, u3]}", "`p` gathers variables of two variabilities, continuous and discrete"),
        ("{p: [u1, u1]}", "`p` and `p` name one variable, `u1`"),
        ("{p: [u1, u2], q: u1}", "`p` and `q` name one variable, `u1`"),
        ("{u3: [u1, u2]}", "`u3` is to name `u1`, `u2`, but the FMU has a variable `u3` of its own"),
        ("{p: [time]}", "the variable `time` of `feedthrough3.fmu` is the time"),
        ("{p: 3}", "`blocks.plant.ports.p` must be text"),
        ("{p: [3]}", "`blocks.plant.ports.p` must be text"),
    ],
)
def test_what_does_not_go_together_is_refused(write, fmus, ports, words):
    text = f"run: {{stop: 1, step: 1}}\nblocks: {{plant: {{fmu: {fmus['3 cs']}, ports: {ports}}}}}\n"
    with pytest.raises(DiagramErrors) as caught:
        run.load(write(text))
    (error,) = caught.value.errors
    assert words in str(error)
    assert error.position.line == 2


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("inputs: {u1: plant.p}", "fix: `u1` is `p[1]` here"),
        ("start: {u2: 1}", "fix: `u2` is `p[2]` here"),
        ("start: {p: [1, 2, 3]}", "p"),
    ],
)
def test_elements_are_found_in_their_array(write, fmus, keys, words):
    text = f"run: {{stop: 1, step: 1}}\nblocks: {{plant: {{fmu: {fmus['3 cs']}, ports: {{p: [u1, u2]}}, {keys}}}}}\n"
    with pytest.raises(DiagramErrors) as caught:
        run.load(write(text))
    assert words in str(caught.value)


def test_a_variable_that_is_called_time_needs_another_name(tmp_path, write, trajectories):
    """FMI 2 has the independent variable by its causality, not by its name."""
    from tests.fmu import machine
    from tests.fmu.machine import Model, V

    variables = (V("time", 101, "Float64", "output", None), V("u", 1, "Float64", "input", "3"))

    def edit(xml):
        return xml.replace('name="time" valueReference="0"', 'name="t" valueReference="0"')

    path = machine.pack(tmp_path, 2, Model("feedthrough", variables), feedthrough.SOURCE, "cs", edit=edit)
    with pytest.raises(DiagramErrors, match="it has a variable called `time`"):
        run.load(write(f"run: {{stop: 1, step: 1}}\nblocks: {{plant: {{fmu: {path}}}}}\n"))
    keys = f"fmu: {path}, ports: {{clock: time}}, start: {{u: 3}}"
    network = run.load(write(f"run: {{stop: 1, step: 1}}\nblocks: {{plant: {{{keys}}}}}\n"))
    assert [*trajectories(network, "plant.clock")["plant.clock"].ravel()] == [3.0, 3.0]
