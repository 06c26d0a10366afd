"""Runs of one library block, for tests against an oracle."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from cosim.engine import program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.wiring.network import Signal

#: What the inputs of a block are wired to, unless a test says otherwise.
WAVES = "  wave: {block: Sine, parameters: {amplitude: 1, frequency: 1}}\n"


def run_diagram(text: str, *signals: str) -> dict[str, np.ndarray]:
    """Run a diagram as plain Python, and return signals at every step, and `time`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "diagram.yaml"
        path.write_text(text, encoding="utf-8")
        network = run.load(path)
    built = program.build(network, network.diagram.run.method)
    probed = tuple(Signal(*name.split(".")) for name in signals)
    simulation = Simulation(built, None, [Probes(probed)])
    simulation.initialize()
    parts, times = [[] for _ in signals], []
    for (samples,) in simulation.batches():
        times.append(samples.times.copy())
        for part, signal in zip(parts, probed, strict=True):
            part.append(samples.values[signal].copy())
    return {name: np.concatenate(p) for name, p in zip(("time", *signals), (times, *parts), strict=True)}


def run_block(
    name: str,
    parameters: str = "",
    inputs: str = "",
    others: str = WAVES,
    outputs: tuple[str, ...] = ("y",),
    stop: float = 2.0,
    step: float = 1e-3,
    rest: str = "",
    settings: str = "integrator: dormand-prince, method: joint",
) -> dict[str, np.ndarray]:
    """Run one block `b` beside others; rest: more keys of it, such as `period: 0.01`."""
    text = (
        f"run: {{stop: {stop}, step: {step}, {settings}}}\nblocks:\n{others}"
        f"  b: {{block: {name}, parameters: {{{parameters}}}, inputs: {{{inputs}}}{', ' + rest if rest else ''}}}\n"
    )
    found = run_diagram(text, *(f"b.{output}" for output in outputs))
    return {key.removeprefix("b."): value for key, value in found.items()}
