"""What a swapped block keeps, drops and takes by default, and that nothing of it happens in silence."""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors, DroppedValue, WrongValue
from cosim.export.exporter import export_fmu
from cosim.language import diagram
from cosim.terminal import cli

BODIES = """
from cosim import Block, Input, Output, Parameter, State

class Push(Block):
    y = Output(unit="N")
    def outputs(time, y):
        y[0] = 1.0 + time

class Body(Block):
    '''m dv/dt = u, dx/dt = v.'''
    u = Input(unit="N")
    x = State(output=True, unit="m")
    v = State(unit="m/s")
    mass = Parameter(unit="kg", default=1.0)
    def derivatives(u, v, mass, d_x, d_v):
        d_x[0] = v
        d_v[0] = u / mass

class Other(Block):
    '''The same under other names; its position is no state of its own.'''
    force = Input(unit="N", start=0.0)
    x = Output(unit="m")
    path = State(unit="m")
    v = State(unit="m/s")
    m = Parameter(unit="kg", default=1.0)
    x_0 = Parameter(unit="m", default=0.0)
    drag = Parameter(unit="N*s/m", default=0.0)
    def outputs(path, x_0, x):
        x[0] = x_0 + path
    def derivatives(force, v, m, drag, d_path, d_v):
        d_path[0] = v
        d_v[0] = (force - drag * v) / m

class Grams(Block):
    '''A mass by the same name in another unit.'''
    u = Input(unit="N")
    x = State(output=True, unit="m")
    mass = Parameter(unit="g", default=1000.0)
    def derivatives(u, mass, d_x):
        d_x[0] = u / mass
"""
BASE = """\
run: {stop: 2, step: 0.125}
blocks:
  push: {python: own.py:Push}
  body:
    python: own.py:Body
    parameters: {mass: 2}
    start: {x: 3}
    inputs: {u: push.y}
    integrator: rk4
record: {signals: [body.x]}
"""
PASTED = """\
extends: base.yaml
blocks:
  body:
    python: own.py:Other
    parameters: {x_0: 3, m: 2}
    inputs: {force: push.y}
    drop: [mass, start.x, inputs.u]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(BODIES)
    (tmp_path / "base.yaml").write_text(BASE)
    return tmp_path


def mistakes(*arguments, **more):
    with pytest.raises(DiagramErrors) as caught:
        run.load(*arguments, **more)
    return caught.value.errors


def test_what_the_diagram_gave_and_the_new_type_does_not_take_is_one_mistake_with_the_lines_to_paste(folder):
    (error,) = mistakes("base.yaml", swaps=["body=own.py:Other"])
    assert type(error) is DroppedValue and str(error.position) == "--swap body=own.py:Other"
    assert "block body: Other does not take what the diagram gives Body" in error.message
    for entry, place in (("parameters.mass", "6:18"), ("start.x", "7:13"), ("inputs.u", "8:14")):
        assert f"{entry} at base.yaml:{place}" in error.message
    for line in (
        "parameters: {m: 2, x_0: 3}",
        "inputs: {force: push.y}",
        "drop: [mass, x, u]",
        "--set 'blocks.body.drop=[mass, x, u]'",
    ):
        assert line in error.fix, error.fix


def test_an_overlay_that_hands_on_or_waives_everything_runs(folder, trajectories):
    (folder / "a.yaml").write_text(PASTED)
    native = trajectories(run.load("base.yaml"), "body.x", engine="python")["body.x"]
    network = run.load("a.yaml")
    assert np.allclose(trajectories(network, "body.x", engine="python")["body.x"], native, rtol=1e-12)
    assert [str(swap) for swap in network.swaps] == [
        "body: Body → Other: keeps integrator; drops mass, start.x, inputs.u; defaults drag = 0.0"
    ]


@pytest.mark.parametrize("missing", ["mass", "start.x", "inputs.u"])
def test_each_single_drop_has_to_be_waived(folder, missing):
    names = [name for name in ("mass", "start.x", "inputs.u") if name != missing]
    (folder / "a.yaml").write_text(PASTED.replace("[mass, start.x, inputs.u]", f"[{', '.join(names)}]"))
    (error,) = mistakes("a.yaml")
    assert type(error) is DroppedValue and str(error.position).startswith("a.yaml:4:")
    assert f"{missing.rpartition('.')[2]} at base.yaml:" in error.message
    assert error.message.count(" at base.yaml") == 1


def test_a_waiver_on_the_command_line_and_one_that_names_nothing(folder):
    swaps, settings = ["body=own.py:Other"], ["blocks.body.drop=[mass, start.x, inputs.u]"]
    assert run.load("base.yaml", settings, swaps).swaps[0].drops == ("mass", "start.x", "inputs.u")
    (error,) = mistakes("base.yaml", ["blocks.body.drop=[mass, start.x, inputs.u, masss]"], swaps)
    assert type(error) is WrongValue and "nothing called `masss`" in error.message and "`mass`" in error.fix
    (error,) = mistakes("base.yaml", ["blocks.body.drop=mass"])
    assert type(error) is WrongValue and "name: ~" in error.fix


def test_nothing_takes_away_what_was_written_for_another_type_too(folder):
    settings = ["blocks.body.parameters.mass=~", "blocks.body.start=~", "blocks.body.inputs.u=~"]
    swap = run.load("base.yaml", settings, ["body=own.py:Other"]).swaps[0]
    assert (swap.keeps, swap.drops) == (("integrator",), ())


def test_a_name_in_another_unit_is_not_the_same_between_files(folder):
    (error,) = mistakes("base.yaml", swaps=["body=own.py:Grams"])
    assert "parameters.mass at base.yaml:6:18 (in kg there, in g here)" in error.message


def test_a_name_in_another_unit_is_not_the_same(folder, monkeypatch):
    import own_blocks_of_this_test as own

    from cosim.wiring import library

    found = {"Body": [own.Body], "Grams": [own.Grams]}
    monkeypatch.setattr(library, "_libraries", lambda name="": (found, [], dict.fromkeys((own.Body, own.Grams), "own")))
    (folder / "base.yaml").write_text(BASE.replace("python: own.py:Body", "block: Body"))
    (error,) = mistakes("base.yaml", swaps=["body=Grams"])
    assert "parameters.mass at base.yaml:6:18 (in kg there, in g here)" in error.message


@pytest.fixture(autouse=True)
def own_blocks(tmp_path, monkeypatch):
    (tmp_path / "own_blocks_of_this_test.py").write_text(BODIES)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("own_blocks_of_this_test", None)


@pytest.mark.parametrize("key", ["period: 0.25", "inner_steps: 3", "dimensions: {n: 1}"])
def test_a_key_that_goes_with_the_old_type_only(folder, key):
    text = BASE.replace("    integrator: rk4\n", f"    {key}\n")
    text = text.replace("    parameters: {mass: 2}\n    start: {x: 3}\n    inputs: {u: push.y}\n", "")
    (folder / "base.yaml").write_text(text)
    (folder / "inner.yaml").write_text("run: {stop: 1, step: 1}\noutputs: {x: p.y}\nblocks: {p: {python: own.py:Push}}")
    errors = mistakes("base.yaml", swaps=["body=inner.yaml"])
    dropped = [error for error in errors if isinstance(error, DroppedValue)]
    name = key.partition(":")[0]
    assert len(dropped) == 1 and re.search(rf"{name}(\.n)? at base.yaml:6:", dropped[0].message)


def test_an_integrator_is_dropped_by_what_has_no_continuous_states(folder):
    swaps, waiver = ["body=own.py:Push"], ["blocks.body.drop=[mass, start.x, inputs.u, integrator]", "record=~"]
    (error,) = [e for e in mistakes("base.yaml", ["record=~"], swaps) if isinstance(e, DroppedValue)]
    assert "integrator at base.yaml:9:" in error.message and "drop: [mass, x, u, integrator]" in error.fix
    assert "drops mass, start.x, inputs.u, integrator" in str(run.load("base.yaml", waiver, swaps).swaps[0])


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
def test_an_fmu_with_other_names_is_refused_and_the_lines_offered_make_it_right(folder, trajectories):
    """An FMU that calls the mass `m` and the force `force`, and calculates its position."""
    (folder / "other.yaml").write_text(
        "run: {stop: 2, step: 0.125}\nblocks:\n  body: {python: own.py:Other, start: {}, integrator: rk4}\n"
    )
    export_fmu(run.load("other.yaml"), ["body"], folder / "other.fmu")
    (error,) = mistakes("base.yaml", swaps=["body=other.fmu"])
    assert type(error) is DroppedValue
    for words in ("parameters.mass at base.yaml:6", "start.x at base.yaml:7", "inputs.u at base.yaml:8"):
        assert words in error.message
    assert "ports: {mass: m, u: force}" in error.fix and "parameters: {x_0: 3}" in error.fix
    (folder / "a.yaml").write_text(
        "extends: base.yaml\nblocks:\n  body:\n    fmu: other.fmu\n    drop: [start.x, integrator]\n"
        "    ports: {mass: m, u: force}\n    parameters: {x_0: 3}\n"
    )
    network = run.load("a.yaml")
    native = trajectories(run.load("base.yaml", ["blocks.body.integrator=rk4"]), "body.x", engine="python")["body.x"]
    found = trajectories(network, "body.x")["body.x"]
    assert np.allclose(found, native, rtol=1e-12)
    assert "keeps mass, u" in str(network.swaps[0]) and "drops start.x" in str(network.swaps[0])


def test_run_and_check_say_what_a_swap_does(folder, capsys):
    (folder / "a.yaml").write_text(PASTED)
    line = "body: Body → Other: keeps integrator; drops mass, start.x, inputs.u; defaults drag = 0.0"
    assert cli.main(["check", "a.yaml"]) == 0
    assert line in capsys.readouterr().out
    assert cli.main(["run", "a.yaml", "--engine", "python"]) == 0
    assert line in capsys.readouterr().out
    assert cli.main(["run", "a.yaml", "--engine", "python", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["swaps"] == [line]


def test_a_type_that_is_replaced_twice_answers_for_both(folder):
    (folder / "a.yaml").write_text(PASTED)
    error = next(e for e in mistakes("a.yaml", swaps=["body=own.py:Body"]) if isinstance(e, DroppedValue))
    assert "Body does not take what the diagram gives Other: parameters.x_0" in error.message
    swap = run.load("a.yaml", ["blocks.body.drop=[x_0, m, force]", "blocks.body.inputs.u=push.y"], ["body=own.py:Body"])
    assert "mass" not in swap.diagram.blocks["body"].parameters  # it was dropped for good
    assert "defaults mass = 1.0" in str(swap.swaps[0])


SHIPPED = sorted((Path(__file__).parents[2] / "diagrams").glob("*.yaml"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
@pytest.mark.parametrize("wired", [False, True], ids=["read", "wired"])
def test_a_resolved_diagram_loads_again_as_the_same(path, wired, tmp_path):
    loaded = run.load(path).diagram if wired else diagram.load(path)
    (tmp_path / path.name).write_text(loaded.resolved())
    again = run.load(tmp_path / path.name)
    first = run.load(path)
    assert again.diagram.resolved() == first.diagram.resolved()
    assert list(again.components) == list(first.components)
    for name, component in first.components.items():
        assert component.wires == again.components[name].wires
        for variable, value in component.values.items():
            assert np.array_equal(value, again.components[name].values[variable], equal_nan=value.dtype.kind == "f")


def test_a_resolved_swap_loads_again_before_it_is_wired(formation, tmp_path):
    settings = ["blocks.observer.drop=[gamma_1, gamma_2, c_v, centres, width]"]
    loaded = diagram.load(formation, settings, ["observer=FiniteTimeObserver"])
    (tmp_path / "a.yaml").write_text(loaded.resolved())
    assert run.load(tmp_path / "a.yaml").components["observer"].declaration.name == "FiniteTimeObserver"


RENAMED = """
from cosim import Block, Output, Parameter

class Old(Block):
    length = Parameter(default=1.0, unit="m")
    y = Output()
    def outputs(length, y):
        y[0] = length

class New(Block):
    length_s = Parameter(default=1.0, unit="s")
    span = Parameter(default=1.0, unit="m")
    y = Output()
    def outputs(length_s, span, y):
        y[0] = length_s * span
"""


@pytest.mark.parametrize(("before", "offered"), [("Old", "span"), ("Gone", "length_s")])
def test_an_offer_goes_by_the_unit_where_it_is_known_and_else_by_the_name(tmp_path, before, offered):
    """A length in m is no `length_s` in s; of a type that is not there any more the name is all that is known."""
    (tmp_path / "own.py").write_text(RENAMED)
    base = f"run: {{stop: 1, step: 1}}\nblocks:\n  b: {{python: own.py:{before}, parameters: {{length: 2}}}}\n"
    (tmp_path / "base.yaml").write_text(base)
    (tmp_path / "over.yaml").write_text("extends: base.yaml\nblocks:\n  b: {python: own.py:New}\n")
    with pytest.raises(DiagramErrors) as caught:
        run.load(tmp_path / "over.yaml")
    (error,) = caught.value.errors
    assert "New does not take what the diagram gives" in error.message
    assert f"parameters: {{{offered}: 2}}" in error.fix and "drop: [length]" in error.fix
