"""Readers of single values of a diagram."""

import math

import pytest

from cosim.language.reader import multiple


@pytest.mark.parametrize("steps", [1, 3, 10, 30_000, 10**9])
@pytest.mark.parametrize("step", [1e-3, 0.1, 1 / 3])
def test_a_time_is_whole_steps_within_a_billionth_of_itself(steps, step):
    assert multiple(steps * step, step) == steps
    if steps < 10**8:  # from there on, a billionth of the time is a good part of a step
        assert multiple(steps * step * (1 + 0.9e-9), step) == steps
        assert multiple(steps * step * (1 - 0.9e-9), step) == steps
        assert multiple(steps * step * (1 + 1.2e-9), step) is None
        assert multiple(steps * step * (1 - 1.2e-9), step) is None


@pytest.mark.parametrize(
    ("value", "step"), [(0.0, 1.0), (1.0, 0.0), (0.5, 1.0), (2.0**53, 1.0), (math.nan, 1.0), (-1.0, 1.0)]
)
def test_what_is_no_number_of_steps(value, step):
    assert multiple(value, step) is None
