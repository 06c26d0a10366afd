"""Balls that bounce, and runs of blocks that a test writes itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from cosim.engine import run
from cosim.results.result_file import open_result
from cosim.wiring.network import Network

METHODS = ("jacobi", "gauss-seidel", "iterated", "joint")
BALL = '''
import math
from cosim import Block, Indicator, Input, Output, Parameter, State


class Ball(Block):
    """d2h/dt2 = -g; at the ground v becomes -e v."""

    g = Parameter(default=9.81)
    e = Parameter(default=0.7)
    h = State(output=True, start=1.0)
    v = State(output=True)
    n = State(output=True, start=0, dtype=int)
    last = State(output=True, start=-1.0)
    ground = Indicator(crossing="falling")

    def derivatives(v, g, d_h, d_v):
        d_h[0] = v
        d_v[0] = -g

    def indicators(h, ground):
        ground[0] = h

    def event(time, ground, v, e, n, next_v, next_n, next_last):
        if ground < 0:
            next_v[0] = -e * v
            next_n[0] = n + 1
            next_last[0] = time
'''
BALLS = """
run: {stop: 1.9, step: 0.01, integrator: heun}
fleets: {ball: 3}
blocks:
  b: {own:Ball, per: ball, parameters: {e: [0.7, 0.8, 0.5]}, start: {h: [1, 0.5, 2]}}
record: {signals: [b.h, b.n, b.last]}
"""


def wire(folder: Path, blocks: str, text: str, *settings: str) -> Network:
    """A diagram in which `own:` names one of the blocks."""
    (folder / "own.py").write_text(blocks)
    path = folder / "d.yaml"
    path.write_text(text.replace("own:", "python: own.py:"))
    return run.load(path, settings)


def recorded(network: Network, output: Path, engine: str = "native") -> dict[str, Any]:
    """The recorded signals of a run that comes to its end, by name."""
    outcome = run.Run(network, engine, output).execute()
    assert outcome.status == "completed", outcome.error
    with open_result(output) as result:
        return {"time": result.times, **{name: result[name] for name in result.signals}}


def bounces(e: float, h: float, count: int = 30) -> list[float]:
    """When a ball hits the ground that falls from a height."""
    v = math.sqrt(2 * 9.81 * h)
    times = [v / 9.81]
    for k in range(1, count):
        times.append(times[-1] + 2 * v * e**k / 9.81)
    return times
