"""The arena's two segments: to save and restore a step is one copy of the first, and the second stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import compilation, program
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.master import tables
from cosim.wiring.network import Signal

EVERYTHING = """
run: {{stop: 2, step: 0.01, method: {method}, integrator: {integrator}, inner_steps: 2}}
fleets: {{robot: 3}}
blocks:
  o: {{type: Oscillator, per: robot, start: {{x: ["i", "2 * i", "3 * i"]}}}}
  count: {{type: Counter, per: robot, period: 0.05, inputs: {{u: o.x}}}}
  gain: {{type: Gain, per: robot, parameters: {{k: 0.5}}, inputs: {{u: o.x}}}}
  lag: {{type: Lag, per: robot, inputs: {{u: gain.y}}}}
"""


def watched(one: Simulation, first: int, last: int) -> dict[Signal, np.ndarray]:
    """What the probes see of the steps from one to another."""
    one.control[tables.TICK], one.control[tables.LAST], one.control[tables.FINAL] = first, last, 1
    assert one.host and one.host.run("run") == tables.OK
    (samples,) = one.buffers.take()
    return {signal: values.copy() for signal, values in samples.values.items()}


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("integrator", ["euler", "rk4", "dormand-prince"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_a_step_is_saved_and_restored_by_one_copy(wired, method, integrator, engine):
    network = wired(EVERYTHING.format(method=method, integrator=integrator))
    built = program.build(network, method)
    kernels = compilation.compile_program(built) if engine == "native" else None
    one = Simulation(built, kernels, [Probes(tuple(network.signals()))])
    one.initialize()
    constants = one.arena[built.layout.changing :].copy()
    watched(one, 0, 50)
    saved = one.arena[: built.layout.changing].copy()
    expected = watched(one, 50, 120)
    assert not np.array_equal(one.arena[: built.layout.changing], saved)
    one.arena[: built.layout.changing] = saved
    again = watched(one, 50, 120)
    for signal, values in expected.items():
        assert values.tobytes() == again[signal].tobytes(), signal
    assert np.array_equal(one.arena[built.layout.changing :], constants)


def test_what_a_diagram_gives_a_block_lies_with_the_constants_and_what_it_computes_does_not(wired):
    layout = program.build(wired(EVERYTHING.format(method="jacobi", integrator="euler")), "jacobi").layout
    for signal, place in layout.places.items():
        assert (place.offset >= layout.changing) == (layout.network.variable(signal).causality == "parameter"), signal
