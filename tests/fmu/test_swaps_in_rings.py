"""A block equals its own FMU, bit for bit, also where blocks read each other in a ring."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import run
from cosim.fmu.export import export
from tests.fmu.test_export import native

BLOCKS = Path(__file__).parents[1] / "oracle_blocks.py"
RING = """
run: {stop: 2, step: 0.125, method: METHOD}
blocks:
  wave: {type: Wave, parameters: {f: 2.0}}
  sum: {type: Sum, parameters: {b: 0.25}, inputs: {u: wave.y, w: gain.y}}
  leak: {type: Leak, parameters: {a: 0.5}, start: {x: [1, 2]}, inputs: {u: sum.y}, integrator: rk4, inner_steps: 2}
  chain: {type: Chain, parameters: {a: -1.5}, start: {x: [0.5, -1]}, inputs: {u: mixed.x}}
  hold: {type: Hold, period: 0.25, start: {z: [1, 1]}, inputs: {u: leak.y}}
  filter: {type: Sampled, period: 0.375, inputs: {u: leak.x}}
  both: {type: Sum, inputs: {u: hold.z, w: filter.y}}
  mixed: {type: Mixed, period: 0.25, start: {x: [1, 0], z: [0.5, 0]}, inputs: {u: both.y}}
  gain: {type: Drift, parameters: {a: 0.125}, inputs: {u: chain.x}}
"""
FIXED = {"leak": "[integrator, inner_steps]", "hold": "[period]", "filter": "[period]", "mixed": "[period]"}
NAMES = ("leak.x", "leak.y", "chain.x", "chain.y", "sum.y", "gain.y", "hold.z", "filter.y", "mixed.x")


def wired(folder, method, swaps=()):
    path = folder / "ring.yaml"
    path.write_text(RING.replace("METHOD", method).replace("type: ", f"python: {BLOCKS}:"))
    names = [swap.partition("=")[0] for swap in swaps]
    drop = [f"blocks.{name}.drop={FIXED[name]}" for name in names if name in FIXED]  # what an FMU has in it
    return run.load(path, drop, swaps)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """The FMU of a block, made once."""
    folder = tmp_path_factory.mktemp("rings")
    network = wired(folder, "jacobi")

    def of(block: str) -> Path:
        path = folder / f"{block}.fmu"
        return path if path.exists() else export(network, [block], path)

    return of


BLOCKS_IN_RING = ("leak", "chain", "wave", "sum", "gain", "hold", "filter", "mixed")
# Not among them: a sampled output is held to the end of a step, and nobody knows of an FMU's that it is sampled.
PAIRS = [(b, m) for b in BLOCKS_IN_RING for m in ("jacobi", "gauss-seidel") if (b, m) != ("filter", "gauss-seidel")]


@pytest.mark.parametrize(("block", "method"), PAIRS)
def test_a_block_in_a_ring_is_its_own_fmu(tmp_path, fmu, method, block):
    network = wired(tmp_path, method, [f"{block}={fmu(block)}"])
    assert network.slaves[block].declaration.kind("step")  # a Co-Simulation FMU
    expected, got = (native(n, *NAMES) for n in (wired(tmp_path, method), network))
    assert abs(expected["leak.x"]).max() > 0.5
    for name in NAMES:
        assert got[name].tobytes() == expected[name].tobytes(), name
