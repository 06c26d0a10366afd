"""What importers find in an exported FMU: value references, scalars, numbers only; algebraic loops within."""

from __future__ import annotations

import logging
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from cosim.engine import run
from cosim.errors import NotExportable
from cosim.export.exporter import export_fmu
from tests.engine.test_loops import BLOCKS as LOOPED
from tests.export.test_export import native
from tests.fmu.fmu_host import Host

BLOCKS = Path(__file__).with_name("blocks_for_tests.py")
VERSIONS = ("2.0", "3.0")
STEP = 0.1
FLEET = f"""
run: {{stop: 1, step: {STEP}}}
fleets: {{robot: 3}}
blocks:
  robot: {{python: {BLOCKS}:Robot, per: robot, inputs: {{u: wave.y}}, start: {{x: ["0.1*i", 0.2]}}}}
  wave: {{python: {BLOCKS}:Wave, per: robot, parameters: {{f: "i"}}}}
  mean: {{python: {BLOCKS}:Mean, inputs: {{x: robot.x}}}}
"""
LOOPS = """
run: {stop: 1, step: 0.1}
blocks:
  a: {python: own.py:Line, inputs: {u: b.y}, parameters: {k: -3.0}}
  b: {python: own.py:Line, inputs: {u: a.y}, parameters: {k: 0.5}}
  mass: {python: own.py:Mass, inputs: {F: drag.F}}
  drag: {python: own.py:Drag, inputs: {v: mass.v, a: mass.a}}
  held: {python: own.py:Held, inputs: {u: free.y}, period: 0.2}
  free: {python: own.py:Line, inputs: {u: held.y}, parameters: {k: 0.5}}
"""


def load(folder: Path, text: str, own: str = ""):
    (folder / "own.py").write_text(own)
    (folder / "d.yaml").write_text(text)
    return run.load(folder / "d.yaml")


# ---- value references, scalars ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return load(tmp_path_factory.mktemp("fleet"), FLEET)


@pytest.fixture(scope="module")
def fmus(fleet, tmp_path_factory):
    """The fleet and its mean, as FMI 2, as FMI 3, and as FMI 3 of scalars."""
    folder = tmp_path_factory.mktemp("scalars")
    kinds = {"2": ("2.0", False), "3": ("3.0", False), "scalars": ("3.0", True)}
    return {
        name: export_fmu(fleet, ["robot", "mean"], folder / f"fmu{name}.fmu", version, scalars=scalars)
        for name, (version, scalars) in kinds.items()
    }


@pytest.mark.parametrize("kind", ["2", "3", "scalars"])
def test_value_references_are_places_in_the_list_from_1(fmus, kind):
    """So an importer that takes 0 for none, or a reference for a place, is right."""
    description = read_model_description(fmus[kind])
    references = [v.valueReference for v in description.modelVariables]
    assert references == list(range(1, len(references) + 1))
    assert validate_fmu(str(fmus[kind])) == []


def test_scalars_of_fmi_3_are_called_as_those_of_fmi_2_are(fmus):
    two, three = (read_model_description(fmus[kind]) for kind in ("2", "scalars"))
    assert [v.name for v in three.modelVariables] == [v.name for v in two.modelVariables]
    assert all(v.dimensions in (None, []) for v in three.modelVariables)
    assert "robot.x[2,1]" in {v.name for v in three.modelVariables}
    for kind in ("outputs", "derivatives", "initialUnknowns"):
        told = [[(u.variable.name, [d.name for d in u.dependencies]) for u in getattr(d, kind)] for d in (two, three)]
        assert told[0] == told[1]
    assert [v.start for v in three.modelVariables] == [v.start for v in two.modelVariables]
    assert [v.unit for v in three.modelVariables] == [v.unit for v in two.modelVariables]
    states = {v.name: v.derivative.name for v in three.modelVariables if v.derivative}
    assert states["der(robot.v[3,2])"] == "robot.v[3,2]"


def test_scalars_have_the_bits_of_arrays(fmus):
    hosts = {kind: Host(fmus[kind]) for kind in ("3", "scalars")}
    names = [f"robot.u[{i},{q}]" for i in (1, 2, 3) for q in (1, 2)]
    push = np.linspace(-1.0, 1.0, 6)
    hosts["3"].set("robot.u", push)
    for name, value in zip(names, push, strict=True):
        hosts["scalars"].set(name, value)
    for k, host in [(k, host) for host in hosts.values() for k in range(11)]:
        if k == 0:
            host.initialize()
        else:
            host.step((k - 1) * STEP, STEP)
    whole = hosts["3"].get("robot.x")
    parts = [hosts["scalars"].get(name.replace(".u", ".x"))[0] for name in names]
    assert np.array(parts).tobytes() == whole.tobytes() and np.ptp(whole) > 0.1
    for host in hosts.values():
        host.free()


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_scalars_as_it_does_arrays(fmus, interface):
    common = {"fmi_type": interface, "stop_time": 1.0, "output_interval": STEP, "solver": "Euler"}
    scalars = simulate_fmu(str(fmus["scalars"]), output=["mean.mean[2]", "robot.x[3,1]"], **common)
    arrays = simulate_fmu(str(fmus["3"]), output=["mean.mean", "robot.x"], **common)
    assert scalars["mean.mean[2]"].tobytes() == arrays["mean.mean"][:, 1].copy().tobytes()
    assert scalars["robot.x[3,1]"].tobytes() == arrays["robot.x"][:, 2, 0].copy().tobytes()


def test_what_comes_by_way_of_the_whole_fleet_depends_on_all_of_it(tmp_path):
    """Though on the last stretch each member reads its own."""
    text = FLEET + (
        f"  filter: {{python: {BLOCKS}:Filter, per: robot, inputs: {{u: robot.x}}}}\n"
        f"  crowd: {{python: {BLOCKS}:Mean, per: robot, inputs: {{x: filter.y}}}}\n"
    )
    path = export_fmu(load(tmp_path, text), ["robot", "filter", "crowd", "mean"], tmp_path / "crowd.fmu", "2.0")
    found = {u.variable.name: {d.name for d in u.dependencies} for u in read_model_description(path).outputs}
    every = {f"{name}[{i},{q}]" for name in ("robot.x", "filter.z") for i in (1, 2, 3) for q in (1, 2)}
    assert found["crowd.mean[2,1]"] == every
    assert found["filter.y[2,1]"] == {name for name in every if "[2," in name}


# ---- what is no number ------------------------------------------------------------------------------------------

STRANGE = """
import math
from cosim import Block, Input, Output, Parameter, State

class Log(Block):
    'keeps what it saw; nothing yet'
    near = Input(finite=False)
    limit = Parameter(default=math.inf)
    rows = State(2, start=math.nan, finite=False)
    table = Output(2, finite=False)
    later = Output(finite=False)
    y = Output()
    def outputs(near, limit, rows, time, table, later, y):
        table[0], table[1] = rows[0], near
        later[0] = time if time < 0.05 else math.inf
        y[0] = 1.0 if near < limit else 2.0
    def update(rows, next_rows):
        next_rows[0] = rows[0]

class Far(Block):
    y = Output(finite=False)
    def outputs(y):
        y[0] = math.inf
"""


@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_no_number_at_the_initialization_is_left_out_and_said(tmp_path, caplog, version):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  log: {python: own.py:Log, period: 0.1, inputs: {near: far.y}}\n"
    network = load(tmp_path, text + "  far: {python: own.py:Far}\n", STRANGE)
    with caplog.at_level(logging.WARNING, "cosim"):
        path = export_fmu(network, ["log"], tmp_path / "log.fmu", version)
    assert "left out, as importers refuse what is NaN or infinite at the" in caplog.text
    assert "initialization: `log.limit`, `log.rows`, `log.table`" in caplog.text
    assert "in the FMU with 0 or the limit: `log.near`" in caplog.text
    assert "refuse of an FMU: `log.later`" in caplog.text
    with zipfile.ZipFile(path) as archive:
        description = archive.read("modelDescription.xml").decode()
    assert not any(f'"{word}"' in description or f" {word}" in description for word in ("NaN", "INF", "-INF"))
    assert validate_fmu(str(path)) == []
    host = Host(path).initialize()
    assert {*host.variables} >= {"near", "later", "y"} and not {*host.variables} & {"limit", "rows", "rows[1]", "table"}
    assert [math.isfinite(host.get(name)[0]) for name in ("near", "later", "y")] == [True] * 3
    assert host.get("near") == 0.0 and host.get("y") == 1.0  # the parameter keeps the diagram's value
    host.free()


# ---- algebraic loops --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def looped(tmp_path_factory):
    return load(tmp_path_factory.mktemp("looped"), LOOPS, LOOPED)


@pytest.fixture(scope="module")
def looped_fmus(looped, tmp_path_factory):
    folder = tmp_path_factory.mktemp("looped_fmus")
    return {version: export_fmu(looped, [], folder / f"all{version[0]}.fmu", version) for version in VERSIONS}


@pytest.mark.parametrize("reads", [1, 3])
@pytest.mark.parametrize("version", VERSIONS)
def test_loops_within_an_fmu_have_their_closed_form_and_the_bits_of_a_run(looped, looped_fmus, version, reads):
    """However often an importer reads between two steps."""
    truth = native(looped, "a.y", "b.y", "mass.a", "mass.v", "drag.F", "held.y", "free.y")
    host = Host(looped_fmus[version]).initialize()
    for k in range(11):
        for name in [*truth] * reads:
            assert host.get(name).tobytes() == truth[name][k].tobytes(), (name, k)
        if k < 10:
            host.step(k * STEP, STEP)
    host.free()
    time = 1.0 + 0.1 * np.arange(11)  # a = -3 b + t, b = a / 2 + t; m a = 1 - v - a / 2
    np.testing.assert_allclose(truth["a.y"], -2.0 * time / 2.5, rtol=1e-12)
    np.testing.assert_allclose(truth["mass.a"], (1.0 - truth["mass.v"]) / 2.5, rtol=1e-12)


@pytest.mark.parametrize("version", VERSIONS)
def test_loops_within_an_fmu_are_solved_in_model_exchange(looped_fmus, version):
    host = Host(looped_fmus[version], me=True).initialize()
    host.new_discrete_states()
    host.fmu.enterContinuousTimeMode()
    for k, v in enumerate((0.0, 0.5, -2.0)):
        host.fmu.setTime(0.05 * k)
        host.set_states(np.array([v]))
        assert host.get("mass.a") == pytest.approx((1.0 - v) / 2.5, rel=1e-12)
        assert host.derivatives(1) == pytest.approx((1.0 - v) / 2.5, rel=1e-12)
        assert host.get("a.y") == pytest.approx(-2.0 * (1.0 + 0.05 * k) / 2.5, rel=1e-12)
    host.free()


def test_what_a_loop_within_depends_on_is_told(looped_fmus):
    description = read_model_description(looped_fmus["3.0"])
    found = {u.variable.name: {d.name for d in u.dependencies} for u in description.outputs}
    assert found["mass.a"] == found["drag.F"] == {"mass.v"}
    assert found["a.y"] == found["b.y"] == {"time"}


@pytest.mark.parametrize("version", VERSIONS)
def test_a_loop_without_a_solution_ends_with_its_name(tmp_path, version):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {python: own.py:Line, inputs: {u: b.y}}\n"
    network = load(tmp_path, text + "  b: {python: own.py:Line, inputs: {u: a.y}}\n", LOOPED)
    host = Host(export_fmu(network, [], tmp_path / "ring.fmu", version))
    with pytest.raises(FMICallException):
        host.initialize(**{"a.k": 4.0, "b.k": 0.25})  # y = y + c
    assert host.messages[-1].startswith("no solution was found of the algebraic loop of b, a at t = 0 s, for a.y")
    host.fmu.reset()
    assert host.initialize().get("a.y") == pytest.approx(1.25 / (1.0 - 0.25 * 0.25), rel=1e-12)
    host.free()


def test_a_loop_that_only_given_start_values_cut_is_refused(tmp_path):
    """An importer may give none, and then each would wait for the other."""
    own = (
        "from cosim import Block, Input, State\n\nclass Copy(Block):\n    u = Input()\n    x = State(output=True)\n"
        "    def start(u, x):\n        x[0] = u\n    def derivatives(u, x, d_x):\n        d_x[0] = u - x\n"
    )
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {python: own.py:Copy, inputs: {u: b.x}, start: {x: 1}}\n"
    network = load(tmp_path, text + "  b: {python: own.py:Copy, inputs: {u: a.x}}\n", own)
    with pytest.raises(NotExportable, match="algebraic loop at initialization") as caught:
        export_fmu(network, [], tmp_path / "ring.fmu")
    assert "one by one" in caught.value.fix and caught.value.position
