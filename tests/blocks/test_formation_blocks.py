"""What can stand in the place of a part of the formation: the same bits in both engines."""

from pathlib import Path

import pytest

from cosim.engine import run

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
OVERLAYS = (
    "proper_differentiator.yaml",
    "third_order.yaml",
    "safety/velocity_obstacles.yaml",
    "safety/control_barrier.yaml",
)
ALL = [*OVERLAYS, *(f"observers/{path.name}" for path in sorted((DIAGRAMS / "observers").glob("*.yaml")))]


@pytest.mark.parametrize("name", ALL)
def test_both_engines_give_the_same_bits(name, trajectories):
    network = run.load(DIAGRAMS / name, ["run.stop=0.02", "metrics={}"])
    signals = [
        f"{block}.{variable.name}"
        for block in ("differentiator", "observer", "safety", "controller")
        if block in network.components
        for variable in network.components[block].declaration.variables.values()
        if variable.causality == "output"
    ]
    native, python = (trajectories(network, *signals, engine=engine) for engine in ("native", "python"))
    for signal in signals:
        assert native[signal].tobytes() == python[signal].tobytes(), signal
