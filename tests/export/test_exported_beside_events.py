"""An exported FMU beside a block whose events cut the steps of all."""

import math

import pytest

import cosim

DIAGRAM = """
run: {stop: 1, step: 0.01, integrator: rk4}
blocks:
  wanted: {block: Step, parameters: {at: 0.5}}
  plant: {block: FirstOrder, inputs: {u: wanted.y}}
metrics: {last: {signal: plant.x, reduce: final}}
"""


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_what_is_left_of_a_step_after_an_event_just_before_its_end_has_a_length(tmp_path, method):
    """An FMU takes no step of 0 s. 1 - exp(-t) half a second after the step, to RK4's h^4 t exp(-t) / 120 = 2.5e-11."""
    path = tmp_path / "d.yaml"
    path.write_text(DIAGRAM, encoding="utf-8")
    diagram = cosim.load(path).set({"run.method": method})
    cosim.export_fmu(diagram.network, ["plant"], tmp_path / "plant.fmu")
    for tried in (diagram, diagram.swap(plant=tmp_path / "plant.fmu")):
        for at in (0.5, 0.5 - 2e-13, 0.5 - 1e-11):
            run = tried.set({"blocks.wanted.at": at}).run()
            assert run.metrics["last"] == pytest.approx(-math.expm1(-(1 - at)), abs=3e-11)


def test_late_in_a_long_run_that_length_is_still_seen_by_the_clock(tmp_path):
    """At 4,096 s a double's neighbours are 9e-13 s apart."""
    path = tmp_path / "d.yaml"
    path.write_text(DIAGRAM, encoding="utf-8")
    diagram = cosim.load(path).set({"run.stop": 4097, "run.step": 0.5, "blocks.wanted.at": 4096})
    cosim.export_fmu(diagram.network, ["plant"], tmp_path / "plant.fmu")
    assert diagram.swap(plant=tmp_path / "plant.fmu").run().metrics == diagram.run().metrics
