"""Several blocks in one FMU are coupled as the diagram says: by its method, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu

MASSES = """
run: {{stop: 1, step: 0.05, integrator: rk4, method: {method}{more}}}
blocks:
  a: {{block: SecondOrder, parameters: {{omega: 3, zeta: 0.2}}, inputs: {{u: b.x}}, start: {{x: 1}}}}
  slow: {{block: UnitDelay, period: 0.1, inputs: {{u: a.x}}}}
  b: {{block: SecondOrder, parameters: {{omega: 2, zeta: 0.3}}, inputs: {{u: twice.y}}}}
  twice: {{block: Gain, parameters: {{k: 0.5}}, inputs: {{u: a.x}}}}
"""
ALONE = """
run: {{stop: 1, step: 0.05, integrator: rk4, method: joint}}
blocks:
  f: {{fmu: whole.fmu, mode: {mode}, ports: {{{ports}}}}}
"""
NAMES = ("a.x", "a.v", "b.x", "b.v", "slow.y")


def exported(tmp_path, method: str, version: str = "3.0", more: str = "", text: str = MASSES):
    path = tmp_path / "whole.yaml"
    path.write_text(text.format(method=method, more=more))
    network = run.load(path)
    export_fmu(network, [], tmp_path / "whole.fmu", version)
    return network


@pytest.fixture
def bits_agree(tmp_path, trajectories):
    """Run a diagram, and its FMU alone, and compare them at every step."""

    def compare(network, mode: str, method: str, names=NAMES) -> None:
        ports = {name.replace(".", "_"): name for name in names}
        path = tmp_path / "alone.yaml"
        path.write_text(ALONE.format(mode=mode, ports=", ".join(f"{own}: {name}" for own, name in ports.items())))
        found = trajectories(run.load(path, [f"run.method={method}"]), *(f"f.{own}" for own in ports))
        expected = trajectories(network, *names)
        for own, name in ports.items():
            np.testing.assert_array_equal(found[f"f.{own}"], expected[name], name)

    return compare


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated", "joint"])
def test_co_simulation_has_the_bits_of_the_diagrams_method(tmp_path, bits_agree, method, version):
    bits_agree(exported(tmp_path, method, version), "co-simulation", "jacobi")


def test_the_methods_differ(tmp_path, trajectories):
    """So that the test before says something: each couples otherwise, and jointly there is no error of coupling."""
    ends = {m: trajectories(exported(tmp_path, m), "b.x")["b.x"][-1] for m in ("jacobi", "gauss-seidel", "joint")}
    assert abs(ends["jacobi"] - ends["joint"]) > 1e-3 < abs(ends["gauss-seidel"] - ends["joint"])
    assert abs(ends["jacobi"] - ends["gauss-seidel"]) > 1e-3


def test_extrapolation_inside_has_the_same_bits(tmp_path, bits_agree):
    bits_agree(exported(tmp_path, "gauss-seidel", more=", extrapolation: 2"), "co-simulation", "jacobi")


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_model_exchange_has_no_coupling_of_its_own_whatever_the_method(tmp_path, bits_agree, method):
    """All derivatives at one instant: integrated by rk4 it is the diagram, jointly by rk4, to the bit."""
    text = MASSES.replace("  slow: {{block: UnitDelay, period: 0.1, inputs: {{u: a.x}}}}\n", "")
    network = exported(tmp_path, method, text=text)
    jointly = run.load(Path(network.diagram.path), ["run.method=joint"])
    bits_agree(jointly, "model-exchange", "joint", NAMES[:4])
