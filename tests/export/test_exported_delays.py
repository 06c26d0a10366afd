"""Exported FMUs with wires that bring something late, and beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import cosim
from cosim.errors import CosimError, NotExportable

STEP, PERIOD, STOP = 0.01, 0.1, 1.0
LOOP = f"""
run: {{stop: {STOP}, step: {STEP}, integrator: dormand-prince}}
blocks:
  law: {{block: Gain, period: {PERIOD}, parameters: {{k: -1.5}}, inputs: {{u: plant.x}}}}
  plant:
    block: FirstOrder
    parameters: {{T: 0.5}}
    start: {{x: 1, u: 0}}
    inputs: {{u: {{from: law.y, delay: DELAY}}}}
record: {{period: {PERIOD}, signals: [plant.x]}}
"""
CHAIN = f"""
run: {{stop: {STOP}, step: {STEP}, integrator: heun}}
blocks:
  one: {{block: FirstOrder, parameters: {{T: 0.5}}, start: {{x: 1, u: 0}}}}
  plant:
    block: FirstOrder
    parameters: {{T: 0.25}}
    start: {{u: 0}}
    inputs: {{u: {{from: one.x, delay: DELAY}}}}
record: {{period: {PERIOD}, signals: [plant.x]}}
"""
ALONE = f"""
run: {{stop: {STOP}, step: STEP, integrator: dormand-prince}}
blocks:
  f: {{fmu: FILE, mode: MODE}}
record: {{period: {PERIOD}, signals: [f.plant.x]}}
"""


def loop(delay):
    """x at every multiple of the period: linear between two jumps."""
    x, u, t, arriving, found = 1.0, 0.0, 0.0, [], []
    for k in range(round(STOP / PERIOD) + 1):
        while arriving and arriving[0][0] <= k * PERIOD + 1e-12:
            at, later = arriving.pop(0)
            x, t, u = u + (x - u) * math.exp((t - at) / 0.5), at, later
        x, t = u + (x - u) * math.exp((t - k * PERIOD) / 0.5), k * PERIOD
        found.append(x)
        arriving.append((k * PERIOD + delay, -1.5 * x))
    return np.array(found)


def chain(delay):
    """dx/dt = 4 (exp(-2 (t - delay)) - x) from the delay on."""
    s = np.maximum(np.arange(0.0, STOP + PERIOD / 2, PERIOD) - delay, 0.0)
    return 2.0 * (np.exp(-2.0 * s) - np.exp(-4.0 * s))


@pytest.fixture
def exported(tmp_path):
    """A diagram, and what runs the FMU of its blocks, in steps of a size."""

    def export(text, delay, version, *blocks):
        path = tmp_path / "d.yaml"
        path.write_text(text.replace("DELAY", str(delay)), encoding="utf-8")
        diagram = cosim.load(path)
        cosim.export_fmu(diagram.network, blocks, tmp_path / "exported.fmu", version)

        def importing(mode, step=STEP):
            outer = tmp_path / "outer.yaml"
            outer.write_text(ALONE.replace("FILE", "exported.fmu").replace("MODE", mode).replace("STEP", str(step)))
            return cosim.load(outer)

        return diagram, importing

    return export


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("delay", [0.03, 0.1, 0.0345])
def test_a_sampled_loop_with_a_delay_is_exact_in_both_interfaces(exported, version, delay):
    """Dormand and Prince's error is (h / T)^6 / 720 = 9e-14 a step, and in Co-Simulation there are the native bits."""
    diagram, importing = exported(LOOP, delay, version)
    native = diagram.run()["plant.x"]
    assert native == pytest.approx(loop(delay), abs=1e-11)
    for step in (STEP, 5 * STEP):
        assert importing("co-simulation", step).run()["f.plant.x"].tobytes() == native.tobytes()
    assert importing("model-exchange").run()["f.plant.x"] == pytest.approx(loop(delay), abs=1e-11)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("delay", [0.05, 0.0345])
def test_what_changes_all_the_time_is_sampled_at_every_step_in_both_interfaces(exported, version, delay):
    """A line between two samples is h^2 |x''| / 8 = 5e-5 off; Heun's method T h^2 |x'''| / 12 = 2.3e-4, at most."""
    diagram, importing = exported(CHAIN, delay, version)
    native = diagram.run()["plant.x"]
    assert native == pytest.approx(chain(delay), abs=2.8e-4)
    assert importing("co-simulation").run()["f.plant.x"].tobytes() == native.tobytes()
    for step in (STEP, 5 * STEP):
        assert importing("model-exchange", step).run()["f.plant.x"] == pytest.approx(chain(delay), abs=5e-5)
    with pytest.raises(CosimError, match=r"sampled blocks and delays need a multiple of 0\.01 s, not 0\.005 s"):
        importing("co-simulation", STEP / 2).run()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("mode", "method"),
    [
        ("co-simulation", "jacobi"),
        ("co-simulation", "gauss-seidel"),
        ("co-simulation", "iterated"),
        ("model-exchange", "joint"),
    ],
)
def test_a_plant_as_an_fmu_hears_the_same_at_the_same_time(exported, tmp_path, version, mode, method):
    for delay in (0.1, 0.0345):
        diagram, _ = exported(LOOP, delay, version, "plant")
        diagram = diagram.set({"run.method": method})
        swapped = diagram.swap(plant=tmp_path / "exported.fmu").set({"blocks.plant.mode": mode})
        assert swapped.run()["plant.x"].tobytes() == diagram.run()["plant.x"].tobytes()


def test_an_fmu_may_go_on_beyond_the_end_of_its_diagram(exported):
    """Also where the first sample arrives after that."""
    text = LOOP.replace(f"period: {PERIOD},", f"period: {PERIOD}, offset: 0.25,", 1)
    whole = exported(text, 0.1, "3.0")[0].run()["plant.x"]
    _, importing = exported(text.replace(f"stop: {STOP}", "stop: 0.3"), 0.1, "3.0")
    assert importing("co-simulation").run()["f.plant.x"].tobytes() == whole.tobytes()
    assert importing("model-exchange").run()["f.plant.x"] == pytest.approx(whole, abs=1e-11)


def test_what_is_not_read_before_the_diagrams_end_is_not_exported(exported):
    with pytest.raises(NotExportable, match="`u` is read later than the diagram's end") as caught:
        exported(LOOP, 1.5, "3.0")
    assert caught.value.position.line and "run.stop of 1.5 s" in caught.value.fix
