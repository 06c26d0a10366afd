"""A block equals its own FMU, bit for bit, also where blocks read each other in a ring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.wiring import conditions
from tests.export.test_export import native

BLOCKS = Path(__file__).parents[1] / "oracle_blocks.py"
EXPORTED = Path(__file__).parents[1] / "export" / "blocks_for_tests.py"
RING = """
run: {stop: 2, step: 0.125, method: METHODRUN}
blocks:
  wave: {type: Wave, parameters: {f: 2.0}}
  sum: {type: Sum, parameters: {b: 0.25}, inputs: {u: wave.y, w: gain.y}}
  leak: {type: Leak, parameters: {a: 0.5}, start: {x: [1, 2]}, inputs: {u: sum.y}LEAK}
  chain: {type: Chain, parameters: {a: -1.5}, start: {x: [0.5, -1]}, inputs: {u: mixed.x}}
  hold: {type: Hold, period: 0.25, start: {z: [1, 1]}, inputs: {u: leak.y}}
  filter: {type: Sampled, period: 0.375, inputs: {u: leak.x}}
  both: {type: Sum, inputs: {u: hold.z, w: filter.y}}
  mixed: {type: Mixed, period: 0.25, start: {x: [1, 0], z: [0.5, 0]}, inputs: {u: both.y}}
  gain: {type: Drift, parameters: {a: 0.125}, inputs: {u: chain.x}}
"""
# What an FMU has in it.
FIXED = {"leak": "[integrator, inner_steps]", "hold": "[period]", "filter": "[period]", "mixed": "[period]"}
OWN = ", integrator: rk4, inner_steps: 2"
NAMES = ("leak.x", "leak.y", "chain.x", "chain.y", "sum.y", "gain.y", "hold.z", "filter.y", "mixed.x")


MODES = ("co-simulation", "model-exchange")
METHODS = ("jacobi", "gauss-seidel", "joint")


def wired(folder, method, swaps=(), mode=MODES[0]):
    path = folder / "ring.yaml"
    joint = method == "joint"  # which has one integrator for all
    text = RING.replace("RUN", OWN if joint else "").replace("LEAK", "" if joint else OWN).replace("METHOD", method)
    path.write_text(text.replace("type: ", f"python: {BLOCKS}:"))
    fixed = FIXED if mode == MODES[0] else FIXED | {"leak": "[]"}  # its integrator is not in the FMU then
    settings = []
    for name in (swap.partition("=")[0] for swap in swaps):
        settings += [f"blocks.{name}.mode={mode}", f"blocks.{name}.drop={fixed.get(name, '[]')}"]
    return run.load(path, settings, swaps)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """The FMU of a block for a version of FMI, made once."""
    folder = tmp_path_factory.mktemp("rings")
    network = wired(folder, "jacobi")

    def of(block: str, version: str = "3.0") -> Path:
        path = folder / f"{block}{version[0]}.fmu"
        return path if path.exists() else export_fmu(network, [block], path, version)

    return of


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    """What the blocks themselves do under a method, computed once."""
    folder, known = tmp_path_factory.mktemp("truth"), {}

    def of(method: str) -> dict[str, np.ndarray]:
        if method not in known:
            known[method] = native(wired(folder, method), *NAMES)
        return known[method]

    return of


def assert_same(network, expected):
    got = native(network, *NAMES)
    assert abs(expected["leak.x"]).max() > 0.5
    for name in NAMES:
        assert got[name].tobytes() == expected[name].tobytes(), name


BLOCKS_IN_RING = ("leak", "chain", "wave", "sum", "gain", "hold", "filter", "mixed")
# Not among them: what is sampled inside a step sees the newest inputs, see the warning below.
PAIRS = [(b, m) for b in BLOCKS_IN_RING for m in METHODS[:2] if (b, m) != ("mixed", "gauss-seidel")]


@pytest.mark.parametrize(("block", "method"), PAIRS)
def test_a_block_in_a_ring_is_its_own_fmu(tmp_path, fmu, truth, method, block):
    network = wired(tmp_path, method, [f"{block}={fmu(block)}"])
    assert network.components[block].declaration.kind("step")  # a Co-Simulation FMU
    assert_same(network, truth(method))


@pytest.mark.parametrize("method", METHODS[:2])
def test_a_sampled_block_without_feedthrough_is_its_own_fmi_2_fmu(tmp_path, fmu, truth, method):
    network = wired(tmp_path, method, [f"hold={fmu('hold', '2.0')}"])
    assert network.components["hold"].declaration.kind("step")
    assert_same(network, truth(method))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("block", BLOCKS_IN_RING)
def test_a_block_in_a_ring_is_its_own_fmu_in_model_exchange(tmp_path, fmu, truth, method, block, version):
    network = wired(tmp_path, method, [f"{block}={fmu(block, version)}"], MODES[1])
    assert not network.components[block].declaration.kind("step")
    assert_same(network, truth(method))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("method", METHODS)
def test_sampled_fmus_in_model_exchange_hand_each_other_what_is_new(tmp_path, fmu, truth, method, version):
    """All sampled blocks at once: an event of one sees what another publishes at the same instant."""
    names = ("hold", "filter", "mixed")
    network = wired(tmp_path, method, [f"{name}={fmu(name, version)}" for name in names], MODES[1])
    assert_same(network, truth(method))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_states_sampled_inside_a_step_warn_under_gauss_seidel(tmp_path, fmu, version):
    told = {}
    for method in METHODS[:2]:
        network = wired(tmp_path, method, [f"mixed={fmu('mixed', version)}"])
        told[method] = [f for f in conditions.conditions(network) if "sampled" in f.text and f.holds is False]
    assert not told["jacobi"]
    (finding,) = told["gauss-seidel"]
    assert finding.component == "mixed" and "z may see" in finding.numbers


RAMP = """
run: {stop: 2, step: 0.125, method: METHOD}
blocks:
  ramp: {type: Drift, start: {u: [0, 0]}}
  hold: {type: Hold, period: 0.25, start: {z: [0, 0]}, inputs: {u: ramp.y}}
  filter: {type: Sampled, period: 0.375, inputs: {u: ramp.y}}
  sum: {type: Sum, inputs: {u: hold.z, w: filter.y}}
"""


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(("mode", "method"), [*((MODES[0], m) for m in METHODS[:2]), *((MODES[1], m) for m in METHODS)])
def test_what_is_sampled_is_of_the_sample_time(tmp_path, fmu, mode, method, version):
    """u = t: z⁺ = t, seen a period later; and y = z + t + t / 8 with z⁺ = z / 2 + t."""
    path = tmp_path / "ramp.yaml"
    path.write_text(RAMP.replace("METHOD", method).replace("type: ", f"python: {BLOCKS}:"))
    swapped = ["hold", "filter"] if (mode, version) != (MODES[0], "2.0") else ["hold"]  # no delay of feedthrough
    settings = [s for b in swapped for s in (f"blocks.{b}.mode={mode}", f"blocks.{b}.drop=[period]")]
    got = native(run.load(path, settings, [f"{b}={fmu(b, version)}" for b in swapped]), "hold.z", "filter.y", "sum.y")
    steps = np.arange(17)
    held = np.maximum(steps // 2 - 1, 0) * 0.25
    samples, states = np.arange(6) * 0.375, [0.0]
    for sample in samples[:-1]:
        states.append(0.5 * states[-1] + sample)
    y = (states + 1.125 * samples)[steps // 3]
    assert np.array_equal(got["hold.z"], np.stack([held, held], 1))
    assert np.array_equal(got["filter.y"], np.stack([y, y], 1))
    assert np.array_equal(got["sum.y"], np.stack([held + y, held + y], 1))


KEEP = """
run: {stop: 2, step: 0.125, method: METHOD, integrator: rk4}
blocks:
  rise: {type: Rise}
  keep: {type: Keep, period: 0.25, inputs: {n: rise.n}}
"""


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("method", METHODS)
def test_integers_are_sampled_at_communication_points_only(tmp_path, method, version):
    """Not at the last stage of an integration, at the same time, whose values are other ones: m is n a period ago."""
    path = tmp_path / "keep.yaml"
    path.write_text(KEEP.replace("METHOD", method).replace("type: ", f"python: {EXPORTED}:"))
    fmu = export_fmu(run.load(path), ["keep"], tmp_path / "keep.fmu", version)
    settings = ["blocks.keep.mode=model-exchange", "blocks.keep.drop=[period]"]
    got = native(run.load(path, settings, [f"keep={fmu}"]), "rise.n", "keep.m")
    n, m = got["rise.n"].ravel(), got["keep.m"].ravel()
    assert np.array_equal(m[2:], n[: len(m) - 2][np.arange(len(m) - 2) // 2 * 2])
    assert n[-1] == pytest.approx(1e4 * (1 - np.exp(-2)), abs=2)


BEFORE = """
run: {stop: 1, step: 0.125, method: gauss-seidel}
blocks:
  first: {type: Integral, start: {x: [1, 2]}, inputs: {u: second.x}}
  second: {type: Integral, start: {x: [3, -1]}, inputs: {u: gain.y}}
  gain: {type: Sum, parameters: {a: -0.5, b: 0.25}, inputs: {u: first.x, w: second.x}}
"""


def test_an_fmu_whose_locals_alone_read_inputs_is_no_feedthrough(tmp_path):
    """Among its locals is its derivative, which is its input: it takes its turn where the block does."""
    path = tmp_path / "before.yaml"
    path.write_text(BEFORE.replace("type: ", f"python: {BLOCKS}:"))
    fmu = export_fmu(run.load(path), ["first"], tmp_path / "first.fmu", "3.0")
    names = ("first.x", "second.x")
    expected, got = (native(run.load(path, swaps=swaps), *names) for swaps in ((), (f"first={fmu}",)))
    assert all(got[name].tobytes() == expected[name].tobytes() for name in names)
