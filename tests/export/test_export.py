"""Exported FMUs against the native run: the same kernels give the same bits."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from cosim.engine import compilation, program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.errors import ResultError
from cosim.export.exporter import export_fmu
from cosim.wiring.network import Network, Signal
from tests.fmu.fmu_host import Host

BLOCKS = Path(__file__).with_name("blocks_for_tests.py")
STEP, STEPS = 0.01, 200
DIAGRAM = f"""
title: Test
run: {{stop: {STEP * STEPS}, step: {STEP}}}
fleets: {{robot: 3}}
blocks:
  wave: {{type: Wave, per: robot, parameters: {{f: "i"}}}}
  robot:
    type: Robot
    per: robot
    parameters: {{mass: [1.0, 2.0, 3.0]}}
    start: {{x: [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]}}
    inputs: {{u: wave.y}}
    integrator: rk4
    inner_steps: 2
  filter: {{type: Filter, per: robot, inputs: {{u: robot.x}}}}
  counter: {{type: Counter, per: robot, period: 0.03, inputs: {{u: filter.y}}}}
  mean: {{type: Mean, inputs: {{x: robot.x}}}}
  range: {{type: Range, per: robot, inputs: {{x: robot.x}}}}
"""
VERSIONS = ("2.0", "3.0")


def wired(folder: Path, text: str = DIAGRAM) -> Network:
    path = folder / "diagram.yaml"
    path.write_text(text.replace("type: ", f"python: {BLOCKS}:"))
    return run.load(path)


def native(network: Network, *names: str) -> dict[str, np.ndarray]:
    """Signals at every step."""
    built = program.build(network, network.diagram.run.method)
    signals = tuple(Signal(*name.rsplit(".", 1)) for name in names)
    one = Simulation(built, compilation.compile_program(built), [Probes(signals)])
    one.initialize()
    parts = [[samples.values[s].copy() for s in signals] for (samples,) in one.batches()]
    return {name: np.concatenate([part[k] for part in parts]) for k, name in enumerate(names)}


SIGNALS = ("wave.y", "robot.x", "robot.v", "filter.y", "filter.z", "counter.y", "counter.count", "mean.mean")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("export")


@pytest.fixture(scope="module")
def network(folder):
    return wired(folder)


@pytest.fixture(scope="module")
def truth(network):
    return native(network, *SIGNALS)


@pytest.fixture(scope="module")
def fmus(network, folder):
    """Exported on demand, each once: blocks and version to path."""
    made: dict[tuple[str, str], Path] = {}

    def get(blocks: str, version: str) -> Path:
        key = (blocks, version)
        if key not in made:
            name = f"{blocks.replace(',', '_')}_{version[0]}.fmu"
            names = blocks.split(",") if blocks else []
            member = 1 if blocks == "" or "mean" in names else 2  # a mixture has arrays over the fleet, and no member
            made[key] = export_fmu(network, names, folder / name, version, member=member)
        return made[key]

    return get


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("blocks", ["robot", "filter", "counter", "robot,filter", "robot,filter,mean", "range", ""])
def test_fmpy_finds_nothing_to_complain_of(fmus, blocks, version):
    assert validate_fmu(str(fmus(blocks, version))) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_output_is_bit_identical_in_co_simulation(fmus, truth, version):
    host = Host(fmus("robot", version)).initialize(u=truth["wave.y"][0, 1])
    for k in range(STEPS):
        assert host.get("x").tobytes() == truth["robot.x"][k, 1].tobytes()
        assert host.get("v").tobytes() == truth["robot.v"][k, 1].tobytes()
        host.set("u", truth["wave.y"][k, 1])
        host.step(k * STEP, STEP)
    assert np.ptp(truth["robot.x"][:, 1], axis=0).min() > 0.1
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_larger_communication_step_takes_inner_steps_of_the_diagrams_size(fmus, truth, version):
    """With a constant input, five steps in one are the same five steps, on the diagram's grid of times."""
    one, five = (Host(fmus("robot", version)).initialize(u=[1.0, -1.0]) for _ in range(2))
    for k in range(0, 50, 5):
        for j in range(5):
            one.step((k + j) * STEP, STEP)
        five.step(k * STEP, 5 * STEP)
        assert one.get("x").tobytes() == five.get("x").tobytes()
    for host in (one, five):
        host.free()


def test_an_importer_that_adds_up_its_time_gets_the_same_bits(fmus, truth):
    host = Host(fmus("robot", "3.0")).initialize(u=truth["wave.y"][0, 1])
    time = 0.0
    for k in range(STEPS):
        host.set("u", truth["wave.y"][k, 1])
        host.step(time, STEP)
        time += STEP
    assert time != STEPS * STEP
    assert host.get("x").tobytes() == truth["robot.x"][STEPS, 1].tobytes()
    host.free()


def test_feedthrough_is_bit_identical_in_event_mode(fmus, truth):
    host = Host(fmus("filter", "3.0"), events=True).initialize(u=truth["robot.x"][0, 1])
    for k in range(STEPS):
        host.set("u", truth["robot.x"][k, 1])
        assert host.get("y").tobytes() == truth["filter.y"][k, 1].tobytes()
        assert host.new_discrete_states() is None
        host.fmu.enterStepMode()
        host.step(k * STEP, STEP)
        assert host.get("z").tobytes() == truth["filter.z"][k + 1, 1].tobytes()
        host.fmu.enterEventMode()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_feedthrough_in_model_exchange_is_bit_identical_under_euler(fmus, truth, version):
    host = Host(fmus("filter", version), me=True).initialize(u=truth["robot.x"][0, 1])
    assert host.new_discrete_states() is None
    host.fmu.enterContinuousTimeMode()
    z = host.states(2)
    for k in range(STEPS):
        host.fmu.setTime(k * STEP)
        host.set("u", truth["robot.x"][k, 1])
        host.set_states(z)
        assert host.get("y").tobytes() == truth["filter.y"][k, 1].tobytes()
        z = z + STEP * host.derivatives(2)
        assert z.tobytes() == truth["filter.z"][k + 1, 1].tobytes()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_several_blocks_keep_their_wires(fmus, truth, version):
    host = Host(fmus("robot,filter", version))
    inputs = {name for name, v in host.variables.items() if v.causality == "input"}
    assert inputs in ({"robot.u"}, {"robot.u[1]", "robot.u[2]"})
    host.set("robot.u", truth["wave.y"][0, 1])
    host.initialize()
    for k in range(STEPS):
        assert host.get("filter.y").tobytes() == truth["filter.y"][k, 1].tobytes()
        host.set("robot.u", truth["wave.y"][k, 1])
        host.step(k * STEP, STEP)
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_blocks_of_different_fleets_are_exported_over_the_whole_fleet(fmus, truth, version):
    host = Host(fmus("robot,filter,mean", version))
    host.set("robot.u", truth["wave.y"][0])
    host.initialize()
    for k in range(STEPS):
        assert host.get("mean.mean").tobytes() == truth["mean.mean"][k].tobytes()
        host.set("robot.u", truth["wave.y"][k])
        host.step(k * STEP, STEP)
    assert host.get("robot.x").tobytes() == truth["robot.x"][STEPS].tobytes()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_whole_diagram_runs_alone_with_all_its_rates(fmus, truth, version):
    host = Host(fmus("", version)).initialize()
    for k in range(STEPS + 1):
        for name in SIGNALS:
            np.testing.assert_array_equal(host.get(name), truth[name][k].reshape(-1), name)
        if k < STEPS:
            host.step(k * STEP, STEP)
    host.free()


def test_a_sampled_block_in_event_mode_is_bit_identical(fmus, truth):
    host = Host(fmus("counter", "3.0"), events=True).initialize(u=truth["filter.y"][0, 1])
    for k in range(STEPS):
        host.set("u", truth["filter.y"][k, 1])
        assert host.get("y").tobytes() == truth["counter.y"][k, 1].tobytes(), k
        assert host.get("count") == truth["counter.count"][k, 1]
        host.new_discrete_states()
        host.fmu.enterStepMode()
        host.step(k * STEP, STEP)
        host.fmu.enterEventMode()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_sampled_block_in_model_exchange_announces_its_instants(fmus, truth, version):
    host = Host(fmus("counter", version), me=True).initialize(u=truth["filter.y"][0, 1])
    for k in range(STEPS):
        if k % 3 == 0:
            host.set("u", truth["filter.y"][k, 1])
            assert host.get("y").tobytes() == truth["counter.y"][k, 1].tobytes(), k
            assert host.get("count") == truth["counter.count"][k, 1]
            following = host.new_discrete_states()
            assert following == pytest.approx((k + 3) * STEP, rel=1e-12)
            host.fmu.enterContinuousTimeMode()
        else:
            host.set("u", truth["filter.y"][k, 1])  # between two instants, inputs are not looked at
            assert host.get("y").tobytes() == truth["counter.y"][k, 1].tobytes(), k
        host.fmu.setTime(min((k + 1) * STEP, following))
        if (k + 1) % 3 == 0:
            host.fmu.enterEventMode()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_simulates_both_kinds(fmus, network, version):
    """With constant inputs: Co-Simulation gives the native bits, CVode the solution within its tolerance."""
    path = str(fmus("robot,filter", version))
    names = ["robot.x", "filter.y"] if version == "3.0" else ["robot.x[1]", "robot.x[2]", "filter.y[1]"]
    u = {"robot.u": [0.3, -0.2]} if version == "3.0" else {"robot.u[1]": 0.3, "robot.u[2]": -0.2}
    common = {"stop_time": 1.0, "start_values": u, "output": names, "output_interval": 0.1}
    cs = simulate_fmu(path, fmi_type="CoSimulation", **common)
    me = simulate_fmu(path, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-8, **common)
    host = Host(path)
    host.set("robot.u", [0.3, -0.2])
    host.initialize()
    for k in range(100):
        host.step(k * STEP, STEP)
    x = np.array(cs["robot.x"][-1]) if version == "3.0" else np.array([cs["robot.x[1]"][-1], cs["robot.x[2]"][-1]])
    assert x.tobytes() == host.get("robot.x").tobytes()
    for name in names:
        # rk4 is exact to 1e-8 here; the filter is integrated by Euler with its input held, an error of order step.
        tolerance = 1e-6 if "robot" in name else 5 * STEP * 0.5
        np.testing.assert_allclose(np.array(me[name])[-1], np.array(cs[name])[-1], atol=tolerance)
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_handles_the_sample_instants_of_model_exchange(fmus, version):
    path = str(fmus("counter", version))
    result = simulate_fmu(path, fmi_type="ModelExchange", stop_time=1.0, output=["count"], output_interval=0.1)
    # Counted at 0, 0.03, …, seen one period later: at 1.0 s, 33 instants after the first have passed.
    assert result["count"][-1] == 33


@pytest.mark.parametrize("version", VERSIONS)
def test_a_discrete_output_that_changes_asks_for_event_mode(fmus, version):
    host = Host(fmus("range", version), me=True).initialize(x=[0.0, 0.0])
    host.new_discrete_states()
    host.fmu.enterContinuousTimeMode()
    assert host.get("near") == 1
    assert host.fmu.completedIntegratorStep() == (False, False)
    host.set("x", [3.0, 0.0])
    assert host.fmu.completedIntegratorStep() == (True, False)
    host.fmu.enterEventMode()
    assert host.get("near") == 0
    host.new_discrete_states()
    host.fmu.enterContinuousTimeMode()
    assert host.fmu.completedIntegratorStep() == (False, False)
    host.free()


def test_members_of_a_fleet_depend_on_themselves_only(fmus):
    host = Host(fmus("robot,filter,mean", "2.0"))
    found = {u.variable.name: {d.name for d in u.dependencies} for u in host.description.outputs}
    assert found["filter.slow[2,1]"] == {"filter.z[2,1]", "filter.z[2,2]"}
    assert found["filter.y[3,1]"] == {f"{s}[3,{q}]" for s in ("robot.x", "filter.z") for q in (1, 2)}
    assert found["mean.mean[1]"] == {f"robot.x[{i},{q}]" for i in (1, 2, 3) for q in (1, 2)}
    host.free()


def test_an_export_replaces_its_own_fmu_and_nothing_else(network, fmus, folder):
    own = fmus("filter", "3.0")
    content = own.read_bytes()
    own.write_bytes(content)
    assert export_fmu(network, ["filter"], own, "3.0", member=2).read_bytes() == content
    foreign = folder / "foreign.fmu"
    with zipfile.ZipFile(foreign, "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription generationTool="another"/>')
    for path in (network.diagram.path, foreign, folder):
        before = path.read_bytes() if path.is_file() else None
        with pytest.raises(ResultError, match="exists and is not an FMU of this program"):
            export_fmu(network, ["filter"], path)
        assert (path.read_bytes() if path.is_file() else None) == before
    assert not [p for p in folder.iterdir() if p.name.startswith(".")]


STIFF = """
run: {{stop: 200, step: 4, integrator: {integrator}, tolerance: 1.0e-6}}
blocks:
  o: {{type: VanDerPol, parameters: {{mu: 30}}}}
  f: {{type: Follow, inputs: {{u: o.x}}}}
"""


@pytest.mark.parametrize("mode", ["co-simulation", "model-exchange"])
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("integrator", ["dormand-prince", "rodas5p"])
def test_steps_within_a_tolerance_are_the_same_in_an_fmu(write, trajectories, tmp_path, version, mode, integrator):
    """Co-Simulation takes the steps inside, Model Exchange has them taken; either remembers the last one."""
    path = write(STIFF.format(integrator=integrator))
    network = run.load(path)
    fmu = export_fmu(network, ["o"], tmp_path / "o.fmu", version)

    swapped = run.load(path, [f"blocks.o.mode={mode}"], [f"o={fmu}"])
    expected, got = (trajectories(one, "o.x", "o.v", "f.x") for one in (network, swapped))
    for name in expected:
        assert expected[name].tobytes() == got[name].tobytes(), name
    assert np.ptp(expected["o.x"]) > 3.9  # it has jumped
    if mode == "model-exchange":
        jointly = run.load(path, [f"blocks.o.mode={mode}", "run.method=joint"], [f"o={fmu}"])
        np.testing.assert_allclose(trajectories(jointly, "o.x")["o.x"], expected["o.x"], rtol=2e-3)


def test_an_fmu_says_where_no_step_keeps_the_tolerance(write, trajectories, tmp_path):
    """As Co-Simulation it fails like any FMU, with words of its own."""
    text = (
        "run: {stop: 9, step: 3, integrator: heun, tolerance: 1.0e-6}\nblocks:\n  p: {type: Riccati, start: {y: 2}}\n"
    )
    path = write(text)  # y = 1/(1/2 - sin t), with a pole at pi/6
    fmu = export_fmu(run.load(path), [], tmp_path / "p.fmu")
    outcome = run.Run(run.load(path, ["blocks.p.mode=co-simulation"], [f"p={fmu}"])).execute()
    assert outcome.status == "failed" and "no inner step keeps the tolerance" in str(outcome.error)
