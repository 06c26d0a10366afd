"""Constants in the place of wires: what they are, where they are seen, and that they come and go like wires."""

from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors, DroppedValue, WrongShape, WrongType, WrongValue
from cosim.export.exporter import export_fmu
from cosim.terminal import cli
from cosim.wiring import overview

BLOCKS = """
from cosim import Block, Input, Output, Parameter, State

class Push(Block):
    '''y = k f + b for each element, if it is on.'''
    f = Input("n", unit="N")
    k = Input(dtype=int, start=1)
    on = Input(dtype=bool, start=True)
    y = Output("n", unit="N")
    def outputs(f, k, on, y):
        for q in range(y.size):
            y[q] = k * f[q] if on else 0.0

class Ramp(Block):
    y = Output(unit="N")
    def outputs(time, y):
        y[0] = time

class Body(Block):
    '''m dv/dt = u, dx/dt = v.'''
    u = Input(unit="N", max=10.0)
    x = State(output=True, unit="m")
    v = State(unit="m/s")
    m = Parameter(unit="kg", default=2.0)
    def derivatives(u, v, m, d_x, d_v):
        d_x[0] = v
        d_v[0] = u / m

class Heavy(Block):
    u = Input(unit="kN")
    x = State(output=True, unit="m")
    def derivatives(u, d_x):
        d_x[0] = u

class Twin(Block):
    '''As Body, at another rate.'''
    u = Input(unit="N")
    x = State(output=True, unit="m")
    def derivatives(u, d_x):
        d_x[0] = u
"""
ONE = """
run: {stop: 1, step: 0.125}
blocks:
  ramp: {python: "own.py:Ramp"}
  body: {python: "own.py:Body", inputs: {u: 4}}
record: {signals: [body.x]}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(BLOCKS)
    Path("one.yaml").write_text(ONE)
    return tmp_path


def last(trajectories, name, *settings, of="one.yaml", swaps=(), engine="native"):
    return trajectories(run.load(of, settings, swaps), name, engine=engine)[name][-1]


def mistake(*settings, of="one.yaml", swaps=()):
    with pytest.raises(DiagramErrors) as caught:
        run.load(of, settings, swaps)
    (error,) = caught.value.errors
    assert error.fix
    return error


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_constant_force_gives_a_constant_acceleration(folder, trajectories, engine):
    """Explicit Euler in steps h from rest: v_k = a k h, so x_n = a h^2 n (n - 1) / 2."""
    assert last(trajectories, "body.x", engine=engine) == 2.0 * 0.125**2 * 8 * 7 / 2
    assert last(trajectories, "body.x", "blocks.body.inputs.u=pi/2", engine=engine) == pytest.approx(
        np.pi / 4 * 0.125**2 * 28, rel=1e-15
    )


def test_a_wire_is_replaced_by_a_constant_and_back(folder, trajectories):
    Path("wired.yaml").write_text("extends: one.yaml\nblocks: {body: {inputs: {u: ramp.y}}}\n")
    Path("again.yaml").write_text("extends: wired.yaml\nblocks: {body: {inputs: {u: 4}}}\n")
    Path("late.yaml").write_text("extends: one.yaml\nblocks: {body: {inputs: {u: {from: ramp.y, delay: 0.25}}}}\n")
    wired = last(trajectories, "body.x", of="wired.yaml")
    assert wired != last(trajectories, "body.x")
    assert last(trajectories, "body.x", of="again.yaml") == last(trajectories, "body.x")
    assert last(trajectories, "body.x", "blocks.body.inputs.u=ramp.y") == wired
    for name in ("wired.yaml", "late.yaml"):
        assert last(trajectories, "body.x", "blocks.body.inputs.u=4", of=name) == last(trajectories, "body.x")


def test_arrays_numbers_truth_values_and_fleets(folder, trajectories):
    Path("fleet.yaml").write_text("""
run: {stop: 1, step: 1}
fleets: {robot: 3}
blocks:
  all: {python: "own.py:Push", inputs: {f: [1, "2*pi"], k: 3, on: true}}
  each: {python: "own.py:Push", per: robot, inputs: {f: [[1], [2], [3]], k: [1, 2, 3], on: [true, false, true]}}
  number: {python: "own.py:Push", per: robot, dimensions: {n: 2}, inputs: {f: "i/N"}}
""")
    network = run.load("fleet.yaml")
    found = trajectories(network, "all.y", "all.f", "each.y", "number.y", "each.on", "each.k")
    assert found["all.y"][-1].tolist() == [3.0, 6 * np.pi]
    assert found["all.f"][-1].tolist() == [1.0, 2 * np.pi]
    assert found["each.y"][-1].tolist() == [[1.0], [0.0], [9.0]]
    assert found["number.y"][-1].tolist() == [[1 / 3] * 2, [2 / 3] * 2, [1.0] * 2]
    assert found["each.on"].dtype == bool and found["each.k"].dtype == np.int64


def test_check_and_the_result_show_it(folder, capsys):
    wires = {wire.port: wire for part in overview.describe(run.load("one.yaml")).parts for wire in part.wires}
    assert wires["u"].constant == "4 N" and wires["u"].sources == ()
    assert cli.main(["check", "one.yaml"]) == 0
    assert "u = 4 N" in capsys.readouterr().out
    assert cli.main(["run", "one.yaml", "--csv", "one.csv", "--set", "record.signals=[body.x, body.u]"]) == 0
    rows = Path("one.csv").read_text().splitlines()
    assert rows[0].split(",") == ["time", "body.x", "body.u"]
    assert {row.split(",")[2] for row in rows[1:]} == {"4.0"}


def test_the_whole_diagram_as_text_has_it(folder):
    network = run.load("one.yaml", ["blocks.body.inputs.u=2*pi"])
    Path("again.yaml").write_text(network.diagram.resolved())
    assert run.load("again.yaml").components["body"].values["u"].tolist() == [2 * np.pi]


def test_a_diagram_in_a_diagram_hands_it_on(folder, trajectories):
    Path("inner.yaml").write_text("""
run: {stop: 1, step: 0.125}
inputs: {force: body.u}
outputs: {x: body.x}
blocks: {body: {python: "own.py:Body"}, push: {python: "own.py:Push", inputs: {f: [1]}}}
""")
    Path("outer.yaml").write_text("""
run: {stop: 1, step: 0.125}
blocks: {plant: {diagram: inner.yaml, inputs: {force: 4}}, ramp: {python: "own.py:Ramp"}}
record: {signals: [plant.x]}
""")
    assert last(trajectories, "plant/body.x", of="outer.yaml") == last(trajectories, "body.x")
    wired = last(trajectories, "plant/body.x", "blocks.plant.inputs.force=ramp.y", of="outer.yaml")
    assert wired == last(trajectories, "body.x", "blocks.body.inputs.u=ramp.y")


def test_a_swap_keeps_it_unless_the_unit_is_another(folder, trajectories):
    network = run.load("one.yaml", swaps=["body=own.py:Twin"])
    assert network.swaps[0].keeps == ("u",) and network.components["body"].values["u"].tolist() == [4.0]
    with pytest.raises(DiagramErrors) as caught:
        run.load("one.yaml", swaps=["body=own.py:Heavy"])
    (error,) = [error for error in caught.value.errors if isinstance(error, DroppedValue)]
    assert "in N there, in kN here" in error.message
    assert run.load("one.yaml", ["blocks.body.drop=[u]", "blocks.body.start={u: 1}"], ["body=own.py:Heavy"])


def test_an_fmu_is_given_it_as_the_block_is(folder, trajectories):
    export_fmu(run.load("one.yaml"), ["body"], Path("body.fmu"))
    network = run.load("one.yaml", swaps=["body=body.fmu"])
    assert trajectories(network, "body.x")["body.x"][-1] == last(trajectories, "body.x")
    assert not [rule for rule in network.components["body"].declaration.rules if "connected" in rule.text]


@pytest.mark.parametrize(
    ("setting", "kind", "said", "fix"),
    [
        ("blocks.body.inputs.u=[1, 2]", WrongShape, "`u` has the shape ()", "one number"),
        ("blocks.body.inputs.u=true", WrongType, "`true` is no number", "write 1"),
        ("blocks.body.inputs.u=11", WrongValue, "above its maximum, 10", "give a number"),
        ("blocks.body.inputs.u=.nan", WrongValue, "`.nan` is no value", "give a number"),
        ("blocks.body.inputs.u=ramp", WrongValue, "must have the form block.port", "write block.port"),
        ("blocks.body.inputs.u=[1, ramp.y]", WrongValue, "beside what it reads", "numbers only"),
        ("blocks.body.inputs.u={from: 1, delay: 0.25}", WrongValue, "`delay` does nothing", "write 1 alone"),
        ("blocks.body.start.u=1", WrongValue, "is a constant, so that its start value has no effect", "remove it"),
        ("blocks.body.inputs.w=1", None, "has no input `w`", "one of: u"),
    ],
)
def test_mistakes(folder, setting, kind, said, fix):
    error = mistake(setting)
    assert said in error.message and fix in error.fix
    assert kind is None or isinstance(error, kind)


def test_what_a_wired_input_reads_is_recorded_where_it_comes_from(folder):
    error = mistake("blocks.body.inputs.u=ramp.y", "record.signals=[body.u]")
    assert "`body.u`" in error.message and error.fix == "name ramp.y"


@pytest.mark.parametrize(("text", "wrong"), [("e", True), ("[2*e]", True), ("pi", False), ("2.71", False)])
def test_a_block_whose_name_is_a_number_may_be_meant(folder, text, wrong):
    Path("e.yaml").write_text(f"""
run: {{stop: 1, step: 1}}
blocks:
  e: {{python: "own.py:Ramp"}}
  push: {{python: "own.py:Push", dimensions: {{n: 1}}, inputs: {{f: {text}}}}}
""")
    Path("outer.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {in: {diagram: e.yaml}}\n")
    body = f"{{python: 'own.py:Push', dimensions: {{n: 1}}, inputs: {{f: {text}}}}}"
    Path("ramp.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {r: {python: 'own.py:Ramp'}}\n")
    Path("sub.yaml").write_text(f"run: {{stop: 1, step: 1}}\nblocks:\n  e: {{diagram: ramp.yaml}}\n  push: {body}\n")
    for name in ("e.yaml", "outer.yaml", "sub.yaml"):
        if wrong:
            error = mistake(of=name)
            assert "a block is called `e`" in error.message and "e.port" in error.fix
        else:
            run.load(name)
