"""Events and ends of exported blocks, found by importers: the loop of this package, and FMPy with CVode."""

from __future__ import annotations

import math

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import cosim
from cosim.engine import run
from cosim.results.result_file import open_result
from tests.engine.test_block_endings import BLOCKS, FALL
from tests.fmu.test_crossings import BALL, TEXT, check, recorded

BOTH = [(version, mode) for version in (2, 3) for mode in ("co-simulation", "model-exchange")]
STONE = """
run: {{stop: 2, step: 0.01, method: {method}, integrator: heun}}
blocks:
  s: {{{block}}}
  way: {{python: own.py:Sum, inputs: {{u: s.v}}}}
record: {{signals: [s.h, s.v, way.x]}}
"""
TWO = '''
from cosim import Block, Indicator, Parameter, State


class Pendulum(Block):
    """x'' = -x: counts where x is zero, in both directions, and where v falls through zero."""

    x = State(2, output=True, start=[1.0, 0.5])
    v = State(2, output=True)
    n = State(2, output=True, start=0, dtype="int32")
    tops = State(output=True, start=0, dtype="int32")
    middle = Indicator(2)
    top = Indicator(crossing="falling")

    def derivatives(x, v, d_x, d_v):
        for k in range(2):
            d_x[k] = v[k]
            d_v[k] = -x[k]

    def indicators(x, v, middle, top):
        for k in range(2):
            middle[k] = x[k]
        top[0] = v[0]

    def event(middle, top, n, tops, next_n, next_tops):
        for k in range(2):
            if middle[k] != 0:
                next_n[k] = n[k] + 1
        if top < 0:
            next_tops[0] = tops + 1
'''


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """FMUs by block and version: a ball that bounces, a stone that ends the run, and a pendulum."""
    folder = tmp_path_factory.mktemp("exported")
    for name, text in (("ball", BALL), ("own", BLOCKS), ("two", TWO)):
        (folder / f"{name}.py").write_text(text)
    types = {"ball": "ball.py:Ball", "stone": "own.py:Stone", "pendulum": "two.py:Pendulum"}
    found = {}
    for name, block in types.items():
        path = folder / f"{name}.yaml"
        path.write_text(f"run: {{stop: 1.9, step: 0.01, integrator: heun}}\nblocks: {{b: {{python: {block}}}}}\n")
        for version in (2, 3):
            found[name, version] = folder / f"{name}{version}.fmu"
            cosim.export_fmu(cosim.load(path).network, ["b"], found[name, version], f"{version}.0")
    return found


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "joint"])
@pytest.mark.parametrize("version", [2, 3])
def test_a_ball_in_model_exchange(exported, tmp_path, version, method, engine):
    text = TEXT.format(method=method, fmu=exported["ball", version], more=", mode: model-exchange")
    check(*recorded(tmp_path, text, engine=engine))


@pytest.mark.parametrize("name", ["ball", "stone", "pendulum"])
@pytest.mark.parametrize("version", [2, 3])
def test_descriptions_are_valid(exported, name, version):
    assert not validate_fmu(str(exported[name, version]))
    description = fmpy.read_model_description(str(exported[name, version]))
    assert description.modelExchange and description.coSimulation
    if version == 2:
        assert description.numberOfEventIndicators == {"ball": 1, "stone": 1, "pendulum": 3}[name]
    else:
        assert len(description.eventIndicators) == {"ball": 1, "stone": 1, "pendulum": 2}[name]


@pytest.mark.parametrize(("version", "mode"), BOTH)
def test_another_importer_finds_the_bounces(exported, version, mode):
    """FMPy's solver, which knows nothing of ours, comes to the same times within its tolerance."""
    kind = "ModelExchange" if mode == "model-exchange" else "CoSimulation"
    found = fmpy.simulate_fmu(
        str(exported["ball", version]),
        stop_time=1.9,
        fmi_type=kind,
        solver="CVode",
        relative_tolerance=1e-9,
        output_interval=0.01,
        output=["h", "bounces", "last"],
    )
    hits = [FALL]
    for k in range(1, 12):
        hits.append(hits[-1] + 2 * FALL * 0.7**k)
    assert found["bounces"][-1] == 4 and found["last"][-1] == pytest.approx(hits[3], abs=1e-6)
    assert found["h"].min() > -1e-6


@pytest.mark.parametrize(("version", "mode"), BOTH)
def test_each_crossing_is_counted_once(exported, tmp_path, version, mode):
    """cos(t) is zero at pi/2 + k pi, in both directions; -sin(t) falls through zero at 2 k pi, from k = 0."""
    text = f"""
run: {{stop: 30, step: 0.1, integrator: rk4}}
blocks: {{p: {{fmu: {exported["pendulum", version]}, mode: {mode}}}}}
record: {{signals: [p.n, p.tops]}}
"""
    (tmp_path / "d.yaml").write_text(text)
    outcome = run.Run(run.load(tmp_path / "d.yaml"), output=tmp_path / "d.nc").execute()
    assert outcome.status == "completed"
    with open_result(tmp_path / "d.nc") as result:
        wanted = np.floor(result.times / math.pi + 0.5)
        assert np.array_equal(result["p.n"], np.stack([wanted, wanted], 1))
        assert result["p.tops"][-1] == 1 + math.floor(30 / (2 * math.pi))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(("version", "mode"), BOTH)
@pytest.mark.parametrize("method", ["jacobi", "iterated"])
def test_a_block_ends_the_run_as_an_fmu(exported, tmp_path, version, mode, method, engine):
    """FMI 2's Co-Simulation says that it may end early nowhere, so that only methods that repeat steps come there."""
    (tmp_path / "own.py").write_text(BLOCKS)
    (tmp_path / "d.yaml").write_text(
        STONE.format(method=method, block=f"fmu: {exported['stone', version]}, mode: {mode}")
    )
    outcome = run.Run(run.load(tmp_path / "d.yaml"), engine, tmp_path / "d.nc").execute()
    late = (version, mode, method) == (2, "co-simulation", "jacobi")
    assert outcome.status == ("terminated" if late else "completed")
    assert "ended the simulation at t = 0.451524 s" in outcome.reason
    with open_result(tmp_path / "d.nc") as result:
        assert result.times[-1] == pytest.approx(0.45 if late else FALL, abs=1e-9)
        assert result["s.h"] == pytest.approx(1 - 9.81 / 2 * result.times**2, abs=1e-9)


@pytest.mark.parametrize(("version", "mode"), BOTH)
def test_another_importer_is_told_of_the_end(exported, version, mode):
    kind = "ModelExchange" if mode == "model-exchange" else "CoSimulation"
    found = fmpy.simulate_fmu(
        str(exported["stone", version]),
        stop_time=2,
        fmi_type=kind,
        output_interval=0.01,
        output=["h", "v"],
        early_return_allowed=True,
    )
    assert found["time"][-1] == pytest.approx(FALL, abs=0.011)
    assert np.abs(found["h"] - (1 - 9.81 / 2 * found["time"] ** 2)).max() < 1e-3
