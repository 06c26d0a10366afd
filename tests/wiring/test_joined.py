"""Inputs for which several sources are joined, and wires that take some members: values, units, rules."""

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.compilation import compile_program
from cosim.engine.program import build
from cosim.engine.simulation import Simulation
from cosim.errors import DiagramErrors
from cosim.study import study_file
from cosim.study.plan import Member
from cosim.study.variants import Variants
from cosim.wiring import conditions
from cosim.wiring.network import Signal

BLOCKS = '''
from cosim import Block, Input, Output, Parameter, condition, rule

class Constant(Block):
    """A scalar."""
    k = Parameter(default=1.0)
    y = Output()
    def outputs(k, y):
        y[0] = k

class Pose(Block):
    """Two lengths and an angle."""
    y = Output(3, unit=("m", "m", "rad"))
    def outputs(y):
        y[0], y[1], y[2] = 1.0, 2.0, 3.0

class Total(Block):
    """Reads a vector."""
    u = Input("n")
    y = Output()
    small = condition("k below 5")(lambda u: (u.parameters["k"][()] < 5.0, f"k = {u.parameters['k']}"))
    def outputs(u, y):
        y[0] = 0.0
        for q in range(u.size):
            y[0] += u[q]

class Length(Block):
    u = Input(2, unit="m")
    y = Output(unit="m")
    def outputs(u, y):
        y[0] = u[0] + u[1]

class Place(Block):
    u = Input(3, unit=("m", "m", "rad"))
    y = Output(unit="rad")
    def outputs(u, y):
        y[0] = u[2]

class Angle(Block):
    u = Input(unit="rad")
    y = Output(unit="rad")
    def outputs(u, y):
        y[0] = u

class Pass(Block):
    u = Input()
    y = Output()
    def outputs(u, y):
        y[0] = u

class Last(Block):
    """Looks at what stands two blocks before it."""
    u = Input()
    y = Output()
    low = rule("k below 5")(lambda u: u.inputs["u"].parameters["k"] < 5.0)
    def outputs(u, y):
        y[0] = u
'''
HEAD = "run: {stop: 1, step: 0.5}\nfleets: {ship: 3}\nblocks:\n"


@pytest.fixture
def load(tmp_path):
    (tmp_path / "blocks.py").write_text(BLOCKS)

    def loaded(text):
        path = tmp_path / "diagram.yaml"
        path.write_text(HEAD + text.replace("type: ", "python: blocks.py:"))
        return run.load(path)

    return loaded


def value(network, name, engine):
    table = build(network, "jacobi")
    simulation = Simulation(table, None if engine == "python" else compile_program(table))
    simulation.initialize()
    return simulation.value(Signal(*name.split(".")))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("per", [", per: ship", ""])
@pytest.mark.parametrize("sources", ["[a.y, b.y]", '[b.y, "all.y[2..3]"]'])
def test_a_vector_that_is_joined_reaches_every_member(load, engine, per, sources):
    text = "  a: {type: Constant, parameters: {k: 2}}\n  b: {type: Constant, parameters: {k: 5}}\n"
    text += "  all: {type: Constant, per: ship, parameters: {k: [9, -4, 6]}}\n"
    total = value(load(f"{text}  s: {{type: Total{per}, inputs: {{u: {sources}}}}}\n"), "s.y", engine)
    assert total.tolist() == ([7.0] * 3 if per else 7.0)


@pytest.mark.parametrize(
    ("block", "source", "words"),
    [
        ("Length", '"p.y[1..2]"', ""),
        ("Angle", '"p.y[3]"', ""),
        ("Place", '["p.y[2]", "p.y[1]", "p.y[3]"]', ""),
        ("Length", '"p.y[2..3]"', r"`u` is in m, but p.y\[2..3\] is in \(m, rad\)"),
        ("Angle", '"p.y[1]"', r"`u` is in rad, but p.y\[1\] is in m"),
        ("Place", '["p.y[3]", "p.y[1..2]"]', r"`u` is in m, but p.y\[3\] is in rad"),
    ],
)
def test_units_are_those_of_the_members_that_are_taken(load, block, source, words):
    text = f"  p: {{type: Pose}}\n  t: {{type: {block}, inputs: {{u: {source}}}}}\n"
    if words:
        with pytest.raises(DiagramErrors, match=words):
            load(text)
    else:
        load(text)


@pytest.mark.parametrize(("values", "holds"), [((1, 2), True), ((1, 9), False), ((9, 1), False)])
def test_a_condition_holds_if_it_holds_for_every_block_that_is_joined(load, values, holds):
    text = "".join(f"  {n}: {{type: Constant, parameters: {{k: {k}}}}}\n" for n, k in zip("ab", values, strict=True))
    network = load(text + "  s: {type: Total, inputs: {u: [a.y, b.y]}}\n")
    assert [finding.holds for finding in conditions.conditions(network)] == [holds]


def test_a_study_judges_rules_that_look_far_upstream(load, tmp_path):
    load("  c: {type: Constant}\n  p: {type: Pass, inputs: {u: c.y}}\n  l: {type: Last, inputs: {u: p.y}}\n")
    (tmp_path / "study.yaml").write_text("diagram: diagram.yaml\ngrid: {blocks.c.parameters.k: [1, 4, 9]}\n")
    variants = Variants(study_file.load(tmp_path / "study.yaml"))
    name = next(iter(variants.study.variants))
    for k in (1, 4):
        variants.prepared(Member(name, settings=(("blocks.c.parameters.k", k),)))
    with pytest.raises(DiagramErrors, match="k below 5"):
        variants.prepared(Member(name, settings=(("blocks.c.parameters.k", 9),)))


def test_a_number_that_its_data_type_cannot_hold_is_refused(tmp_path):
    (tmp_path / "blocks.py").write_text(BLOCKS.replace("Parameter(default=1.0)", 'Parameter(dtype="float32")'))
    path = tmp_path / "diagram.yaml"
    for k, good in (("1e38", True), ("1e39", False), ("-1e39", False)):
        path.write_text(f"{HEAD}  c: {{python: blocks.py:Constant, parameters: {{k: {k}}}}}\n")
        if good:
            assert run.load(path).components["c"].values["k"] == np.float32(1e38)
        else:
            with pytest.raises(DiagramErrors, match="does not fit float32"):
                run.load(path)


def test_a_member_of_one_number_is_that_number(write):
    text = 'run: {stop: 1, step: 0.1}\nblocks:\n  u: {block: Sine}\n  k: {block: Gain, inputs: {u: "u.y[1]"}}\n'
    with pytest.raises(DiagramErrors, match=r"u\.y is one number\n    fix: write u\.y"):
        run.load(write(text))


def test_a_number_where_a_vector_is_taken_is_told_to_be_written_as_a_list(write):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  u: {block: Sine}\n"
    text += "  k: {block: LQR, inputs: {x: SOURCE}, parameters: {A: [[1]], B: [[1]], Q: [[1]]}}\n"
    with pytest.raises(DiagramErrors, match=r"fix: write \[u\.y\], or the sources of all elements, as a list"):
        run.load(write(text.replace("SOURCE", "u.y")))
    assert run.load(write(text.replace("SOURCE", "[u.y]"))).components["k"].axes
