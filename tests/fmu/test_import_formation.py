"""The paper's formation with blocks swapped for their own exported FMUs: the same bits wherever FMI allows them."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.wiring import conditions

STOP = "run.stop=30"
STATES = ("plant", "differentiator")  # blocks all of whose outputs are states
DIRECT = ("observer", "topology", "potential_field", "controller")
ALL = (*STATES, *DIRECT)
SIGNALS = ("plant.x", "controller.u", "observer.x_hat", "observer.w_hat", "potential_field.F")

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The FMU of a block, made once."""
    folder = tmp_path_factory.mktemp("formation")
    made = {}

    def fmu(formation, block: str, version: str):
        if (block, version) not in made:
            name = f"{block}_{version[0]}.fmu"
            made[block, version] = export_fmu(run.load(formation), [block], folder / name, version)
        return made[block, version]

    return fmu


@pytest.fixture(scope="module")
def native():
    """The native trajectories, computed once."""
    return {}


@pytest.fixture
def swapped(formation, exported, trajectories, native):
    """Whether a run with these blocks swapped has the native run's bits."""

    def same(blocks: tuple[str, ...], version: str, mode: str) -> bool:
        if not native:
            native.update(trajectories(run.load(formation, [STOP]), *SIGNALS))
        swaps = [f"{block}={exported(formation, block, version)}" for block in blocks]
        settings = [STOP, *(f"blocks.{block}.mode={mode}" for block in blocks)]
        got = trajectories(run.load(formation, settings, swaps), *SIGNALS)
        return all(np.array_equal(got[name], native[name]) for name in SIGNALS)

    return same


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("blocks", [*((b,) for b in STATES), STATES], ids="+".join)
def test_blocks_whose_outputs_are_states_as_cosimulation(swapped, blocks, version):
    assert swapped(blocks, version, "co-simulation")


@pytest.mark.parametrize("blocks", [*((b,) for b in DIRECT), ALL], ids="+".join)
def test_blocks_with_feedthrough_as_cosimulation_in_event_mode(swapped, blocks):
    assert swapped(blocks, "3.0", "co-simulation")


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("blocks", [*((b,) for b in ALL), ALL], ids="+".join)
def test_any_block_as_model_exchange(swapped, blocks, version):
    assert swapped(blocks, version, "model-exchange")


def test_feedthrough_as_fmi2_cosimulation_is_delayed_and_said_to_be(swapped, formation, exported):
    assert not swapped(("observer",), "2.0", "co-simulation")
    network = run.load(formation, [STOP], [f"observer={exported(formation, 'observer', '2.0')}"])
    finding = next(f for f in conditions.conditions(network) if f.component == "observer" and not f.holds)
    assert "w_hat on x" in finding.numbers
    assert "one step of delay" in finding.numbers
    outcome = run.Run(network).execute()
    assert any("one step of delay" in str(warning) for warning in outcome.warnings)
    assert "one step of delay" in outcome.as_json()


@pytest.mark.parametrize(
    ("version", "mode"), [("2.0", "co-simulation"), ("2.0", "model-exchange"), ("3.0", "co-simulation")]
)
def test_five_native_robots_and_one_fmu(formation, exported, trajectories, tmp_path, version, mode):
    """Whoever reads the plant reads five native robots and the sixth one."""
    blocks = yaml.safe_load(formation.read_text())["blocks"]
    plant = blocks["plant"]
    overlay: dict[str, dict] = {}
    for name, block in blocks.items():
        read = {p: s for p, s in block.get("inputs", {}).items() if str(s).startswith("plant.")}
        if read:
            overlay[name] = {"inputs": {p: [s, s.replace("plant", "sixth")] for p, s in read.items()}}
    overlay["plant"] = {
        "per": "native",
        "parameters": {name: value[:5] for name, value in plant["parameters"].items()},
        "start": {"x": plant["start"]["x"][:5]},
        "inputs": {"u": "controller.u[1..5]", "w": "uncertainty.w[1..5]"},
    }
    overlay["sixth"] = {
        "fmu": str(exported(formation, "plant", version)),
        "mode": mode,
        "parameters": {name: value[5] for name, value in plant["parameters"].items()},
        "start": {"x": plant["start"]["x"][5]},
        "inputs": {"u": "controller.u[6]", "w": "uncertainty.w[6]"},
    }
    mixed = tmp_path / "mixed.yaml"
    mixed.write_text(yaml.safe_dump({"extends": str(formation), "fleets": {"native": 5}, "blocks": overlay}))
    names = ("controller.u", "observer.x_hat")
    expected = trajectories(run.load(formation, [STOP]), *names)
    got = trajectories(run.load(mixed, [STOP]), *names)
    for name in names:
        assert np.array_equal(got[name], expected[name]), name
