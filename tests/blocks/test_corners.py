"""Blocks with corners and jumps under integrators: as exact as if the signal had none, against scipy's quadrature."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from tests.blocks.library_runs import run_diagram

WAVE = "{block: Sine, parameters: {amplitude: 1.3, frequency: 1, phase: 0.4}}"
STOP = 1.9
POINTS, VALUES = [-1.0, -0.2, 0.5, 1.1], [2.0, -1.0, 3.0, 2.5]
ROWS = np.array([[0, 1, 4], [2, 3, -1], [5, 4, 0]])


def wave(t):
    return 1.3 * math.sin(2 * math.pi * t + 0.4)


def times(*levels):
    """When the wave is at some levels (s)."""
    angles = [a for level in levels for s in [math.asin(level / 1.3)] for a in (s, math.pi - s)]
    found = [(a - 0.4) / (2 * math.pi) + k for a in angles for k in range(-1, 4)]
    return sorted(t for t in found if 0 < t < STOP)


def line(t):
    return np.interp(wave(t), POINTS, VALUES)


def beyond(t):
    u = wave(t)
    if u < POINTS[0]:
        return VALUES[0] + (u - POINTS[0]) * (VALUES[1] - VALUES[0]) / (POINTS[1] - POINTS[0])
    if u > POINTS[-1]:
        return VALUES[-1] + (u - POINTS[-1]) * (VALUES[-1] - VALUES[-2]) / (POINTS[-1] - POINTS[-2])
    return line(t)


def plane(t):
    """Bilinear, with the wave against -1, 0, 1 and twice the time against 0, 1, 3."""
    column = [np.interp(2 * t, [0, 1, 3], ROWS[i]) for i in range(3)]
    return np.interp(wave(t), [-1, 0, 1], column)


TABLE = f"points: {POINTS}, values: {VALUES}"
PLANE = f"points_1: [-1, 0, 1], points_2: [0, 1, 3], values: {ROWS.tolist()}"
CASES = [
    ("Sign", "", "u: w.y", lambda t: math.copysign(1, wave(t)), times(0)),
    (
        "Switch",
        "threshold: 0.7",
        "control: w.y, u_1: w.y, u_2: 3",
        lambda t: wave(t) if wave(t) > 0.7 else 3,
        times(0.7),
    ),
    (
        "Quantiser",
        "interval: 0.8",
        "u: w.y",
        lambda t: 0.8 * math.floor(wave(t) / 0.8 + 0.5),
        times(-1.2, -0.4, 0.4, 1.2),
    ),
    ("LookUp1D", TABLE, "u: w.y", line, times(*POINTS)),
    ("LookUp1D", f"{TABLE}, extrapolate: true", "u: w.y", beyond, times(*POINTS)),
    ("LookUp1D", "points: [-1, 1], values: [0, 2], extrapolate: true", "u: w.y", lambda t: wave(t) + 1, [0.5]),
    ("LookUp2D", PLANE, "u_1: w.y, u_2: r.y", plane, [*times(-1, 0, 1), 0.5, 1.5]),
]


@pytest.mark.parametrize(("block", "parameters", "inputs", "function", "corners"), CASES)
def test_no_stage_of_an_integrator_looks_across_one(block, parameters, inputs, function, corners):
    """What sums b up, by the rule of Runge and Kutta, which is Simpson's here: its error is h^4 / 2880 y''''."""
    text = f"""
    run: {{stop: {STOP}, step: 0.02, integrator: rk4, method: joint}}
    blocks:
      w: {WAVE}
      r: {{block: Ramp, parameters: {{slope: 2}}}}
      b: {{block: {block}, parameters: {{{parameters}}}, inputs: {{{inputs}}}}}
      sum: {{block: Integrator, inputs: {{u: b.y}}}}
    """
    found = run_diagram(text, "sum.x")["sum.x"].ravel()[-1]
    ends = [0.0, *sorted({*corners, STOP})]
    expected = sum(quad(function, begin, end, epsabs=1e-13)[0] for begin, end in pairwise(ends))
    steepest = 8 * 1.3 * (2 * math.pi) ** 4  # y'''' of the steepest table's line
    assert found == pytest.approx(expected, abs=0.02**4 / 2880 * steepest * STOP)


def test_what_a_sampled_block_sets_is_followed_at_once():
    """So a sampled controller that reads a switch behind another one is no sample late."""
    text = """
    run: {stop: 1, step: 0.05}
    blocks:
      w: {block: Sine, parameters: {phase: 0.1}}
      held: {block: ZeroOrderHold, period: 0.1, inputs: {u: w.y}}
      sign: {block: Sign, inputs: {u: held.y}}
      switch: {block: Switch, inputs: {control: held.y, u_1: 2, u_2: -2}, parameters: {threshold: 0}}
      level: {block: Quantiser, inputs: {u: held.y}, parameters: {interval: 0.5}}
      later: {block: UnitDelay, period: 0.1, inputs: {u: switch.y}}
    """
    found = run_diagram(text, "held.y", "sign.y", "switch.y", "level.y", "later.y")
    u = found["held.y"].ravel()
    np.testing.assert_array_equal(found["sign.y"].ravel(), np.sign(u))
    np.testing.assert_array_equal(found["switch.y"].ravel(), 2 * np.sign(u))
    np.testing.assert_array_equal(found["level.y"].ravel(), 0.5 * np.floor(u / 0.5 + 0.5))
    np.testing.assert_array_equal(found["later.y"].ravel()[2:], found["switch.y"].ravel()[:-2])


def test_what_begins_at_a_threshold_may_cross_it_from_there():
    text = """
    run: {stop: 0.9, step: 0.1}
    blocks:
      w: {block: Sine}
      down: {block: Sine, parameters: {amplitude: -1}}
      above: {block: Compare, inputs: {u: w.y}}
      count: {block: Counter, inputs: {u: w.y}}
      none: {block: Counter, inputs: {u: down.y}}
      switch: {block: Switch, inputs: {control: down.y, u_1: 2, u_2: -2}, parameters: {threshold: 0}}
      sign: {block: Sign, inputs: {u: down.y}}
      sum: {block: Integrator, inputs: {u: sign.y}}
    """
    found = run_diagram(text, "above.above", "count.count", "none.count", "switch.y", "sum.x")
    t = found["time"]
    inside = (t > 0.05) & (abs(t - 0.5) > 0.05)
    np.testing.assert_array_equal(found["above.above"].ravel()[inside], (t < 0.5)[inside])
    np.testing.assert_array_equal(found["switch.y"].ravel()[inside], np.where(t < 0.5, -2.0, 2.0)[inside])
    assert (found["count.count"][-1], found["none.count"][-1]) == (1, 1)
    np.testing.assert_allclose(found["sum.x"].ravel(), -np.minimum(t, 1 - t), atol=1e-12)
