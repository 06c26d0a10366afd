"""Rings of FMUs with feedthrough: an algebraic loop of foreign blocks is solved as one of native blocks is."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from tests.engine.test_loops import BLOCKS

RING = """
run: {{stop: 0.5, step: 0.1, method: {method}}}
blocks:
  a: {{python: own.py:Line, inputs: {{u: b.y}}, parameters: {{k: -3.0}}}}
  b: {{python: own.py:Line, inputs: {{u: a.y}}, parameters: {{k: 0.5}}}}
"""
CUT = """
run: {stop: 0.5, step: 0.1}
blocks:
  a: {python: own.py:Line, start: {u: 0.0}, parameters: {k: -3.0}}
  b: {python: own.py:Line, start: {u: 0.0}, parameters: {k: 0.5}}
"""
SUMS = """
class Sums(Block):
    u = Input()
    x = State(output=True)
    def derivatives(u, d_x):
        d_x[0] = u
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Both blocks as FMUs of both versions, beside their file."""
    made = tmp_path_factory.mktemp("rings")
    (made / "own.py").write_text(BLOCKS)
    (made / "cut.yaml").write_text(CUT)
    network = run.load(made / "cut.yaml")
    for block in ("a", "b"):
        for version in ("2.0", "3.0"):
            export_fmu(network, [block], made / f"{block}{version[0]}.fmu", version)
    return made


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("swapped", ["a", "ab"])
@pytest.mark.parametrize(
    ("version", "mode", "method"),
    [
        *[(v, "model-exchange", m) for v in "23" for m in ("jacobi", "gauss-seidel", "joint")],
        ("3", "co-simulation", "jacobi"),
        ("3", "co-simulation", "gauss-seidel"),
    ],
)
def test_a_ring_of_fmus_has_its_closed_form(folder, trajectories, version, mode, method, swapped, engine):
    (folder / "d.yaml").write_text(RING.format(method=method))
    swaps = [f"{block}={folder}/{block}{version}.fmu" for block in swapped]
    network = run.load(folder / "d.yaml", [f"blocks.{block}.mode={mode}" for block in swapped], swaps)
    got = trajectories(network, "a.y", "b.y", engine=engine)
    time = 1.0 + 0.1 * np.arange(6)
    np.testing.assert_allclose(got["a.y"], -2.0 * time / 2.5, rtol=1e-12)
    np.testing.assert_allclose(got["b.y"], 1.5 * time / 2.5 - 0.0 * time, rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_ring_of_fmi_2_co_simulation_runs_with_its_delay(folder, trajectories, engine):
    """Such an FMU's output is that of its last step: what it reads waits for the next, which cuts the loop."""
    (folder / "d.yaml").write_text(RING.format(method="jacobi"))
    swaps = [f"{block}={folder}/{block}2.fmu" for block in "ab"]
    network = run.load(folder / "d.yaml", [f"blocks.{block}.mode=co-simulation" for block in "ab"], swaps)
    got = trajectories(network, "a.y", "b.y", engine=engine)
    assert all(np.isfinite(got[name]).all() for name in ("a.y", "b.y"))
    np.testing.assert_allclose(got["a.y"][0], -0.8, rtol=1e-12)  # at initialization it is solved


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("swapped", ["", "a", "b", "ab"])
def test_what_reads_a_ring_waits_for_its_turns_under_gauss_seidel(folder, trajectories, swapped, engine):
    """Blocks without states are evaluated when they are read, their Co-Simulation FMUs after their turn: the same.

    a = -2 (1 + t) / 2.5, which `last` integrates at the later time of each step.
    """
    text = RING.format(method="gauss-seidel").replace(
        "blocks:", "blocks:\n  last: {python: own.py:Sums, inputs: {u: a.y}}"
    )
    (folder / "own.py").write_text(BLOCKS + SUMS)
    (folder / "d.yaml").write_text(text)
    swaps = [f"{block}={folder}/{block}3.fmu" for block in swapped]
    network = run.load(folder / "d.yaml", [f"blocks.{block}.mode=co-simulation" for block in swapped], swaps)
    got = trajectories(network, "last.x", engine=engine)["last.x"]
    later = 1.0 + 0.1 * np.arange(6)
    expected = -0.8 * 0.1 * (np.cumsum(later) - 1.0)
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-15)
