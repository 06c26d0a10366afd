"""Diagrams that the tests of this folder read, and how they read them."""

from pathlib import Path

import pytest

from cosim.errors import DiagramErrors
from cosim.language.diagram import load

BASE = """\
title: Two tanks
run: {stop: "3*10", step: 1e-3}
fleets: {tank: 2}
blocks:
  level:
    block: Tank
    per: tank
    parameters: {area: [1, 2], leak: "0.1*i"}
    start: {h: [0.5, "pi/3"]}
    inputs: {inflow: pump.q, other: [pump.q, level.h]}
    dimensions: {n: "2*1"}
    integrator: rk4
    inner_steps: 4
  pump:
    python: mine.py:Pump
    period: 0.01
    inputs: {h: level.h}
record: {period: 0.01, signals: [level.h, pump.q]}
metrics:
  highest: {signal: level.h, reduce: max, from: 10, to: 20}
  last: {signal: pump.q, reduce: final}
"""


INNER = """\
run: {stop: 1, step: 1}
inputs: {demand: [valve.u, sum.a], spare: []}
outputs: {level: tank.h}
blocks:
  valve: {block: Valve, parameters: {gain: 1}}
  tank: {block: Tank, inputs: {q: valve.q}, start: {h: 0}}
  sum: {block: Sum, inputs: {b: [tank.h, valve.q]}}
"""
OUTER = """\
run: {stop: 1, step: 0.1}
fleets: {plant: 2}
blocks:
  source: {block: Source, inputs: {h: plant.level}}
  plant:
    diagram: sub/inner.yaml
    per: plant
    inputs: {demand: source.y}
    parameters: {valve.gain: 2, tank.area: [1, 2]}
    start: {tank.h: 5}
  second: {diagram: sub/inner.yaml, inputs: {demand: plant.level}}
record: {signals: [plant.level, plant/valve.q]}
metrics: {m: {signal: second.level, reduce: max}}
outputs: {h: plant.level}
inputs: {d: source.u}
"""
HEAD = "run: {stop: 1, step: 0.1}\n"
BLOCKS = "blocks: {b: {block: B}}\n"
ONE = HEAD + BLOCKS


def write(name, text):
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return name


def mistakes(*args, **more):
    with pytest.raises(DiagramErrors) as caught:
        load(*args, **more)
    assert all(error.fix for error in caught.value.errors)
    return caught.value.errors


def mistake(*args, **more):
    (error,) = mistakes(*args, **more)
    return error


def plain(entries):
    return {name: node.plain() for name, node in entries.items()}


def same(a, b):
    """Whether two diagrams say the same, places aside."""
    views = []
    for diagram in (a, b):
        blocks = {name: entry.plain(diagram.path.parent) for name, entry in diagram.blocks.items()}
        views.append((diagram.resolved(), blocks, list(diagram.blocks), diagram.fleets, diagram.title))
    return repr(views[0]) == repr(views[1])  # as text, in which NaN is NaN
