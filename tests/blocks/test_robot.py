"""Omnidirectional robot (42), its control gain, and its uncertainty."""

import numpy as np
import pytest

from cosim.blocks.control_gain import OmnidirectionalGain
from cosim.blocks.robot import OmnidirectionalRobot
from cosim.blocks.uncertainty import Uncertainty

MASS, INERTIA, RADIUS = 4.8, 0.15, 0.24


def transformation(theta):
    """T_i of (42) as printed."""
    return np.array(
        [
            [-np.sin(theta), -np.sin(np.pi / 3 - theta), np.sin(np.pi / 3 + theta)],
            [np.cos(theta), -np.cos(np.pi / 3 - theta), -np.cos(np.pi / 3 + theta)],
            [RADIUS, RADIUS, RADIUS],
        ]
    )


def gain(theta):
    return np.diag([1 / MASS, 1 / MASS, 1 / INERTIA]) @ transformation(theta)


@pytest.mark.parametrize("theta", np.linspace(-7, 7, 9))
def test_gain_and_its_inverse(theta):
    g, g_inverse = np.zeros((3, 3)), np.zeros((3, 3))
    OmnidirectionalGain.outputs(np.array([1.0, 2.0, theta]), MASS, INERTIA, RADIUS, g, g_inverse)
    np.testing.assert_allclose(g, gain(theta), atol=1e-14)
    np.testing.assert_allclose(g @ g_inverse, np.eye(3), atol=1e-14)


def test_motion():
    rng = np.random.default_rng(8)
    x, v, u, w = rng.normal(size=(4, 3))
    d_x, d_v = np.zeros(3), np.zeros(3)
    OmnidirectionalRobot.derivatives(x, v, u, w, MASS, INERTIA, RADIUS, d_x, d_v)
    assert np.array_equal(d_x, v)
    np.testing.assert_allclose(d_v, gain(x[2]) @ u + w, rtol=1e-13)


def test_velocity_is_no_port():
    assert OmnidirectionalRobot.declaration.variables["v"].causality == "local"


@pytest.mark.parametrize("i", [1, 6])
def test_uncertainty(i):
    x, t, w = np.array([0.7, -1.3, 2.1]), 3.3, np.zeros(3)
    Uncertainty.outputs(t, x, float(i), 1.0, w)
    phase = i * np.pi / 5
    expected = [
        0.5 * np.sin(0.7) + np.tanh(0.7) + 0.6 * np.sin(0.6 * t + phase),
        0.3 * np.sin(-1.3) - 1.4 * np.exp(-2.3) + 0.8 * np.sin(0.4 * t + phase),
        0.2 * np.cos(2.1) + np.sin(0.5 * t + phase),
    ]
    np.testing.assert_allclose(w, expected, rtol=1e-14)
