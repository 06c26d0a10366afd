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
  mass: {python: own.py:Mass, start: {F: 0.0}}
  drag: {python: own.py:Drag, start: {v: 0.0, a: 0.0}}
  cosine: {python: own.py:Cosine, start: {u: 0.0}}
"""
ALONE = """
run: {{stop: 0.5, step: 0.1, method: {method}}}
blocks:
  one: {{fmu: {fmu}, mode: {mode}, inputs: {{u: one.y}}{more}}}
  late: {{python: own.py:Begun, inputs: {{u: one.y}}}}
"""
PAIR = """
run: {{stop: 0.5, step: 0.1, method: {method}}}
blocks:
  mass: {{python: own.py:Mass, inputs: {{F: drag.F}}}}
  drag: {{python: own.py:Drag, inputs: {{v: mass.v, a: mass.a}}}}
"""
FLEET = """
run: {{stop: 0.5, step: 0.1}}
fleets: {{m: 5}}
blocks:
  a: {{fmu: {fmu}, mode: {mode}, isolate: {isolate}, per: m, parameters: {{k: "0.3*i - 1.1"}}, inputs: {{u: b.y}}}}
  b: {{python: own.py:Line, per: m, inputs: {{u: a.y}}, parameters: {{k: 0.5}}}}
"""
INNER = """
run: {stop: 0.5, step: 0.1}
blocks:
  a: {python: own.py:Line, inputs: {u: b.y}}
  b: {python: own.py:Line, parameters: {k: -3.0}, inputs: {u: a.y}}
  in: {python: own.py:Line, start: {u: 0.0}}
inputs: {u: in.u}
outputs: {y: a.y, z: in.y}
"""
OUTER = """
run: {stop: 0.5, step: 0.1}
blocks:
  one: {diagram: inner.yaml, inputs: {u: one.y}}
  two: {diagram: inner.yaml, inputs: {u: two.z}}
"""
COSINE = 0.739085133215160641655312
SUMS = """
class Sums(Block):
    u = Input()
    x = State(output=True)
    def derivatives(u, d_x):
        d_x[0] = u
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Blocks as FMUs of both versions, beside their file."""
    made = tmp_path_factory.mktemp("rings")
    (made / "own.py").write_text(BLOCKS)
    (made / "cut.yaml").write_text(CUT)
    network = run.load(made / "cut.yaml")
    for block in ("a", "b", "mass", "drag", "cosine"):
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
@pytest.mark.parametrize(
    ("mode", "method"),
    [
        *[("model-exchange", method) for method in ("jacobi", "gauss-seidel", "iterated", "joint")],
        *[("co-simulation", method) for method in ("jacobi", "gauss-seidel", "iterated")],
    ],
)
@pytest.mark.parametrize("k", [0.25, 4.0, -3.0, None])
def test_an_fmu_that_reads_itself(folder, trajectories, k, mode, method, engine):
    """y = k y + 1 + t, and (None) y = cos y; what begins at y has begun where that is solved."""
    fmu, more = ("cosine3.fmu", "") if k is None else ("a3.fmu", f", parameters: {{k: {k}}}")
    (folder / "d.yaml").write_text(ALONE.format(method=method, mode=mode, fmu=fmu, more=more))
    got = trajectories(run.load(folder / "d.yaml"), "one.y", "late.x", engine=engine)
    y = np.full(6, COSINE) if k is None else (1.0 + 0.1 * np.arange(6)) / (1.0 - k)
    np.testing.assert_allclose(got["one.y"], y, rtol=1e-12)
    np.testing.assert_allclose(got["late.x"], y[0], rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("isolated", ["a", ""])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_a_ring_of_fmi_2_co_simulation_runs_with_its_delay(folder, trajectories, method, isolated, engine):
    """Such an FMU's output is that of its last step, with what it read before it: that cuts the loop.

    At initialization it is solved.
    """
    (folder / "d.yaml").write_text(RING.format(method=method))
    swaps = [f"{block}={folder}/{block}2.fmu" for block in "ab"]
    settings = [f"blocks.{block}.mode=co-simulation" for block in "ab"]
    network = run.load(folder / "d.yaml", [*settings, *(f"blocks.{b}.isolate=true" for b in isolated)], swaps)
    got = trajectories(network, "a.y", "b.y", engine=engine)
    a, b = -0.8, 0.6
    for k in range(6):
        np.testing.assert_allclose((got["a.y"][k], got["b.y"][k]), (a, b), rtol=1e-12)
        later, before = 1.1 + 0.1 * k, a
        a = -3.0 * b + later
        b = 0.5 * (a if method == "gauss-seidel" else before) + later


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("swapped", [["mass", "drag"], ["mass"], ["drag"]])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_a_ring_of_fmi_2_co_simulation_with_states(folder, trajectories, method, swapped, engine):
    """F = 1 - v - a / 2, 2 a = F, dv/dt = a: solved at initialization; then an FMU's F or a is of what it read before.

    A block beside one FMU is evaluated where that has stepped, which is where a ring is entered: it is no feedthrough.
    """
    (folder / "d.yaml").write_text(PAIR.format(method=method))
    swaps, settings = [f"{b}={folder}/{b}2.fmu" for b in swapped], [f"blocks.{b}.mode=co-simulation" for b in swapped]
    network = run.load(folder / "d.yaml", settings, swaps)
    got = trajectories(network, "mass.v", "mass.a", "drag.F", engine=engine)
    v, a, F = 0.0, 0.4, 0.8
    for k in range(6):
        np.testing.assert_allclose([got[n][k] for n in ("mass.v", "mass.a", "drag.F")], [v, a, F], rtol=0, atol=1e-12)
        delayed = 1.0 - v - 0.5 * a
        v, a = v + 0.05 * (delayed if swapped == ["drag"] and method == "gauss-seidel" else F), F / 2.0
        F = 1.0 - v - 0.5 * a if swapped == ["mass"] or (len(swapped) == 2 and method == "gauss-seidel") else delayed
        a = F / 2.0 if swapped == ["drag"] else a  # the mass hands its F on at once


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("isolate", ["true", "false"])
@pytest.mark.parametrize(
    ("version", "mode"), [("3", "co-simulation"), ("3", "model-exchange"), ("2", "model-exchange")]
)
def test_a_fleet_of_fmus_in_a_loop(folder, trajectories, version, mode, isolate, engine):
    """Each member with its own gain: a = (1 + t) (k + 1) / (1 - k / 2)."""
    (folder / "d.yaml").write_text(FLEET.format(fmu=folder / f"a{version}.fmu", mode=mode, isolate=isolate))
    got = trajectories(run.load(folder / "d.yaml"), "a.y", engine=engine)["a.y"]
    time, k = 1.0 + 0.1 * np.arange(6)[:, None], 0.3 * np.arange(1, 6) - 1.1
    np.testing.assert_allclose(got, time * (k + 1.0) / (1.0 - 0.5 * k), rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_loops_in_a_diagram_and_around_one(folder, trajectories, engine):
    """A diagram as a block brings its loop with it, and is part of another that goes through its ports."""
    (folder / "inner.yaml").write_text(INNER)
    (folder / "d.yaml").write_text(OUTER)
    got = trajectories(run.load(folder / "d.yaml"), "one/a.y", "two/in.y", engine=engine)
    time = 1.0 + 0.1 * np.arange(6)
    np.testing.assert_allclose(got["one/a.y"], 1.25 * time / 1.75, rtol=1e-12)
    np.testing.assert_allclose(got["two/in.y"], time / 0.75, rtol=1e-12)


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
