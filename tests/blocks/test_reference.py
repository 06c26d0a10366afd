"""Formation reference (43)."""

import numpy as np
import pytest

from cosim.blocks.reference import CircularFormationReference, SineWavePath


def reference(time: float, angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    place, centre, robot = np.zeros(2), np.zeros((3, 3)), np.zeros((3, 3))
    SineWavePath.outputs(time, 0.2, 1.0, 0.3, *centre)
    CircularFormationReference.calculate(angle, 1.8, place)
    CircularFormationReference.outputs(centre[0], place, robot[0])
    CircularFormationReference.outputs_derivatives(*centre[1:], *robot[1:])
    return robot[0], robot[1], robot[2]


@pytest.mark.parametrize("i", range(1, 7))
@pytest.mark.parametrize("t", [0.0, 4.2, 30.0])
def test_position(i, t):
    expected = [1.8 * np.cos(i * np.pi / 3) + 0.2 * t, 1.8 * np.sin(i * np.pi / 3) + np.sin(0.3 * t), 0.0]
    np.testing.assert_allclose(reference(t, i * np.pi / 3)[0], expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("t", [0.5, 7.0])
def test_derivatives_are_those_of_the_position(t):
    h = 1e-3
    before, now, after = (reference(t + k * h, 1.0) for k in (-1, 0, 1))
    np.testing.assert_allclose(now[1], (after[0] - before[0]) / (2 * h), atol=h**2)
    np.testing.assert_allclose(now[2], (after[1] - before[1]) / (2 * h), atol=h**2)
