"""Arithmetic, vectors and tables against numpy and scipy."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tests.blocks.library_runs import run_block

OTHERS = """  a: {block: Sine, parameters: {amplitude: [1, 2, 3], frequency: 1, phase: 0.2}}
  d: {block: Sine, parameters: {amplitude: [0.5, 1, 2], frequency: 0.7, phase: 1.1, bias: 3}}
"""
T = np.linspace(0.0, 1.0, 101)[:, None]
A = np.array([1, 2, 3]) * np.sin(2 * np.pi * T + 0.2)
B = 3 + np.array([0.5, 1, 2]) * np.sin(1.4 * np.pi * T + 1.1)
TWO = "u_1: a.y, u_2: b.y"


def found(name, parameters="", inputs=TWO, output="y"):
    return run_block(name, parameters, inputs.replace("b.y", "d.y"), OTHERS, (output,), stop=1.0, step=0.01)[output]


@pytest.mark.parametrize(
    ("name", "parameters", "inputs", "expected"),
    [
        ("Sum", "", TWO, A + B),
        ("Sum", "signs: [1, -1]", TWO, A - B),
        ("Sum", "signs: [-1, 1, 1]", "u_1: a.y, u_2: b.y, u_3: a.y", B),
        ("Gain", "k: 3", "u: a.y", 3 * A),
        ("Gain", "k: [1, -1, 2]", "u: a.y", [1, -1, 2] * A),
        ("MatrixGain", "K: [[1, 2, 3], [0, 1, -1]]", "u: a.y", A @ np.array([[1, 2, 3], [0, 1, -1]]).T),
        ("Bias", "bias: 2", "u: a.y", A + 2),
        ("Product", "", TWO, A * B),
        ("Division", "", TWO, A / B),
        ("Power", "exponent: 2", "u: a.y", A**2),
        ("Power", "exponent: 0.5, signed: true", "u: a.y", np.sign(A) * np.sqrt(abs(A))),
        ("Abs", "", "u: a.y", abs(A)),
        ("Sqrt", "", "u: b.y", np.sqrt(B)),
        ("Exp", "", "u: a.y", np.exp(A)),
        ("Log", "", "u: b.y", np.log(B)),
        ("Sin", "", "u: a.y", np.sin(A)),
        ("Cos", "", "u: a.y", np.cos(A)),
        ("Tan", "", "u: b.y", np.tan(B)),
        ("Minimum", "", TWO, np.minimum(A, B)),
        ("Maximum", "", TWO, np.maximum(A, B)),
        ("Norm", "", "u: a.y", np.linalg.norm(A, axis=1)),
        ("Dot", "", TWO, (A * B).sum(axis=1)),
        ("Total", "", "u: a.y", A.sum(axis=1)),
        ("Mean", "", "u: a.y", A.mean(axis=1)),
        ("Select", "elements: [3, 1]", "u: a.y", A[:, [2, 0]]),
        ("Select", "elements: 2", "u: a.y", A[:, 1]),
        ("Join", "", "u: [a.y, b.y]", np.concatenate([A, B], axis=1)),
        ("Cross", "", TWO, np.cross(A, B)),
        ("Saturation", "lower: -0.5, upper: [1, 0.5, 2]", "u: a.y", np.clip(A, -0.5, [1, 0.5, 2])),
        ("DeadZone", "lower: -0.5, upper: 1", "u: a.y", A - np.clip(A, -0.5, 1)),
        ("Sign", "", "u: a.y", np.sign(A)),
        ("Quantiser", "interval: 0.25", "u: a.y", 0.25 * np.floor(A / 0.25 + 0.5)),
        ("Switch", "threshold: 0.3", 'u_1: a.y, control: "a.y[1]", u_2: b.y', np.where(A[:, :1] >= 0.3, A, B)),
        ("LookUp1D", "points: [-2, 0, 1], values: [5, 1, 2]", "u: a.y", np.interp(A, [-2, 0, 1], [5, 1, 2])),
        ("Sensor", "gain_error: 0.1, bias: 1, upper: 3", "u: a.y", np.minimum(1.1 * A + 1, 3)),
    ],
)
def test_against_numpy(name, parameters, inputs, expected):
    np.testing.assert_allclose(found(name, parameters, inputs), expected, rtol=1e-13, atol=1e-14)


def test_angles():
    np.testing.assert_allclose(found("Atan2", "", "y: a.y, x: b.y", "theta"), np.arctan2(A, B), atol=1e-15)
    turned = found("Rotation", "", 'u: "a.y[1..2]", theta: "b.y[1]"')
    c, s = np.cos(B[:, 0]), np.sin(B[:, 0])
    expected = np.stack([c * A[:, 0] - s * A[:, 1], s * A[:, 0] + c * A[:, 1]], axis=1)
    np.testing.assert_allclose(turned, expected, atol=1e-14)
    counts = found("Encoder", "counts_per_turn: 100", "u: a.y", "counts")
    np.testing.assert_array_equal(counts, np.floor(A * 100 / (2 * np.pi)))


def test_outer_lines_of_a_table():
    y = found("LookUp1D", "points: [-0.5, 0, 0.5], values: [1, 0, 2], extrapolate: true", "u: a.y")
    expected = np.where(A < 0, -2 * A, 4 * A)
    np.testing.assert_allclose(y, expected, atol=1e-13)


def test_table_of_two_variables_is_scipys():
    p, q, table = [-3, -1, 0, 4], [1, 3, 6], np.random.default_rng(1).normal(size=(4, 3)).round(3)
    y = found("LookUp2D", f"points_1: {p}, points_2: {q}, values: {table.tolist()}")
    inside = np.stack([np.clip(A, -3, 4), np.clip(B, 1, 6)], axis=-1)
    np.testing.assert_allclose(y, RegularGridInterpolator((p, q), table)(inside), atol=1e-13)
