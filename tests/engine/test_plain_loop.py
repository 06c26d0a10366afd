"""The loop without what most diagrams do not need: who gets it, and that it computes the same bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.compiling import kernels
from cosim.engine import compilation, loop_code, program
from cosim.engine.run import Run, load
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError
from cosim.machine import cache


def diagram(*lines, run="stop: 1, step: 0.1"):
    """A lag of a sine, with other settings and blocks."""
    blocks = ["wave: {block: Sine}", "lag: {block: FirstOrder, inputs: {u: wave.y}}", *lines]
    return "\n  ".join([f"run: {{{run}}}\nrecord: {{signals: [lag.x]}}\nblocks:", *blocks]) + "\n"


RING = ["a: {expression: cos(u), inputs: {u: b.y}}", "b: {expression: 0.5*u, inputs: {u: a.y}}"]


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        (diagram(), True),
        (diagram(run="stop: 1, step: 0.1, method: gauss-seidel, integrator: rk4, inner_steps: 2"), True),
        (diagram(run="stop: 1, step: 0.1, integrator: rodas4"), False),
        (diagram(run="stop: 1, step: 0.1, integrator: dormand-prince, tolerance: 1.0e-6"), False),
        (diagram(run="stop: 1, step: 0.1, method: iterated"), False),
        (diagram(run="stop: 1, step: 0.1, integrator: rk4, extrapolation: 1"), False),
        (diagram("sign: {block: Sign, inputs: {u: lag.x}}"), False),
        (diagram(*RING), False),
    ],
)
def test_what_most_diagrams_do_not_need_is_left_out_for_those(write, text, plain):
    network = load(write(text))
    assert compilation._is_plain(program.build(network, network.diagram.run.method)) is plain


@pytest.mark.parametrize(
    "run", ["method: jacobi, integrator: rk4", "method: gauss-seidel", "method: joint, integrator: heun"]
)
def test_both_loops_compute_the_same_bits(write, run):
    held = "held: {block: ZeroOrderHold, inputs: {u: lag.x}, period: 0.3}"
    ring = "back: {block: FirstOrder, inputs: {u: held.y}}"
    network = load(write(diagram(held, ring, run=f"stop: 20, step: 0.01, {run}")))
    built = program.build(network, network.diagram.run.method)
    whole = replace(compilation.compile_program(built), loop=kernels.module(loop_code.whole_loop()))
    assert compilation._is_plain(built)
    samples = []
    for compiled in (whole, replace(whole, loop=kernels.module(loop_code.plain_loop()))):
        done = Run(network, prepared=(built, compiled), kept=True)
        assert done.execute().status == "completed"
        times, values = done.samples.flat()
        samples.append([times, *values.values()])
    assert len(samples[0][0]) == 2001
    for one, other in zip(*samples, strict=True):
        np.testing.assert_array_equal(one, other)


def test_what_needs_more_fails_without_it(write):
    network = load(write(diagram(*RING)))
    built = program.build(network, network.diagram.run.method)
    compiled = compilation.compile_program(built)
    with pytest.raises(CosimError):
        Simulation(built, replace(compiled, loop=kernels.module(loop_code.plain_loop()))).initialize()
    assert (
        compilation.fitting(replace(compiled, loop=kernels.module(loop_code.plain_loop())), built).loop.name == "engine"
    )


def test_the_whole_loop_is_taken_where_it_is_found(monkeypatch, tmp_path):
    """So a cache has both only if a diagram came that needs more; what a run is does not depend on which it was."""
    kept = {"engine": b"whole", "engine-plain": b"plain"}
    monkeypatch.setattr(cache, "read", lambda entry: kept.get(entry.rpartition("-")[0]))
    for plain in (True, False):
        whole = kernels.module(loop_code.wanted(plain))
        assert whole.code == b"whole"
    del kept["engine"]
    loop = kernels.module(loop_code.wanted(plain=True))
    assert loop.code == b"plain" and loop.meaning == whole.meaning and loop.key != whole.key
