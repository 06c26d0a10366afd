"""Where a figure goes as the step goes to zero, of figures whose errors are known: powers of the step, jumps, noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.accuracy.limit import EPSILON, NO_ORDER, ORDER, ROUNDING, UNSETTLED, falls, limit, noise

STEPS = 1.0, 0.5, 0.25
ELSEWHERE = 10 / 11


def judged(y, highest, *, elsewhere=True, small=0.0):
    """The limit of a figure that is a function of the step."""
    beside = (ELSEWHERE, y(ELSEWHERE)) if elsewhere else None
    return limit([y(step) for step in STEPS], highest, small, elsewhere=beside)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("coefficient", [3e-9, -2.0, 1e40])
def test_one_power_of_the_step_is_found_to_rounding(order, coefficient):
    found = judged(lambda h: coefficient * h**order, order)
    assert found.kind == ORDER and found.order == pytest.approx(order)
    assert found.offset(coefficient) == pytest.approx(coefficient)
    # What is extrapolated counts twice: |y(h) - y(h/4)| + 2 |y(h/4) - y|, that is 1 + 4^-p of the error.
    assert found.error(coefficient) == pytest.approx(abs(coefficient) * (1 + 4.0**-order))
    assert found.low < 0.0 < found.high


def test_three_steps_that_agree_without_an_order_are_no_surer_than_the_fourth():
    """As where something slides from a point on that all three have in common: x(2 s) is 0, they say -4.287842e-4."""
    figures = -0.00042878422337265, -0.00042878630043271084, -0.00042878643012725696
    found = limit(figures, 4, 1e-15, believed=False, elsewhere=(ELSEWHERE, 0.0365))
    assert found.kind == NO_ORDER and found.low < 0.0 < found.high
    assert found.error(figures[0]) == pytest.approx(0.0365 - figures[0])


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1.5, 1.5))
def test_an_order_that_is_believed_is_right_within_a_factor_of_three(a, b, c, scale):
    """Two and three powers, of any signs: whoever claims an order, also a wrong one, knows the error."""
    for powers in ((1, 2), (1, 3), (2, 3)):
        first = a or 1.0

        def y(h, powers=powers, first=first):
            return first * h ** powers[0] + b * 10**scale * h ** powers[1] + (c * h**4 if powers[0] == 2 else 0.0)

        if abs(y(1.0)) < 1e-3:
            continue
        found = judged(y, powers[0], small=1e-13)
        if found.kind in (ORDER, UNSETTLED):
            assert 0.5 <= found.error(y(1.0)) / abs(y(1.0)) <= 3.0


def test_first_order_with_any_second_order_is_within_the_interval():
    """y = a h + b h^2 with Euler's order: also where the two cancel, at one of the steps or nearly."""
    for ratio in np.linspace(-8, 8, 1601):
        for elsewhere in (True, False):
            found = judged(lambda h, r=ratio: h + r * h * h, 1, elsewhere=elsewhere)
            assert found.kind == NO_ORDER or found.low <= 0.0 <= found.high, ratio


@pytest.mark.parametrize(
    "figures",
    [(1.0, 1.0, 0.5), (0.0, 1.0, 0.0), (1.0, 2.0, 4.0), (1.0, -0.5, 0.25), (1.0, 0.99, 0.981)],
    ids=["late", "to and fro", "away", "alternating", "too slow"],
)
def test_differences_that_do_not_fall_have_no_order_and_the_interval_holds_all_that_is_plausible(figures):
    found = limit(figures, 4, 0.0)
    assert found.kind == NO_ORDER and found.order is None
    spread = max(abs(figures[1] - figures[0]), abs(figures[2] - figures[1]))
    assert found.low <= figures[2] - spread and figures[2] + spread <= found.high
    assert all(found.error(figure) >= abs(figure - figures[2]) for figure in figures)


def test_an_error_of_h_times_anything_is_mostly_within_the_interval():
    """y = h θ with θ at random: what jumps make. Not always, as the three may be near each other by chance."""
    random = np.random.default_rng(1)
    missed, factors = 0, []
    for _ in range(2000):
        coarse, middle, fine, other = random.uniform(-1, 1, 4) * (*STEPS, ELSEWHERE)
        found = limit((coarse, middle, fine), 1, 0.0, elsewhere=(ELSEWHERE, other))
        missed += not found.low <= 0.0 <= found.high
        factors.append(found.error(coarse) / abs(coarse))
    assert missed < 0.05 * 2000 and np.mean(np.array(factors) < 0.3) < 0.01


def test_a_step_much_too_large_does_not_spoil_what_the_smaller_ones_agree_on():
    """The first difference is 1000 times the second, which no integrator of first order explains."""
    found = limit((1.0, 0.001, 0.0), 1, 0.0)
    assert found.kind == NO_ORDER and found.error(1.0) == pytest.approx(1.5, rel=0.01)


def test_whoever_is_not_believed_has_no_order():
    assert limit((1.0, 0.5, 0.25), 1, 0.0, believed=False).kind == NO_ORDER


@pytest.mark.parametrize("value", [1.0, -7e-12, 1e90])
def test_what_differs_by_rounding_is_said_to_and_never_surer_than_its_last_digit(value):
    small = noise(abs(value), 1000)
    for figures in ((value,) * 3, (value, value + 0.5 * small, value - 0.3 * small)):
        found = limit(figures, 4, small)
        assert found.kind == ROUNDING
        assert EPSILON * abs(value) <= found.error(figures[0]) <= 3.0 * small


def test_the_second_difference_may_be_rounding_where_the_first_is_no_more_than_an_order_explains():
    found = limit((1.0 + 3e-13, 1.0, 1.0 + 2e-15), 5, 1e-14)
    assert found.kind == ROUNDING and found.error(1.0 + 3e-13) >= 3e-13
    assert limit((2.0, 1.0, 1.0 + 2e-15), 5, 1e-14).kind == NO_ORDER


def test_nested_steps_have_their_points_in_common_and_another_step_tells():
    """y jumps by its slope times what a switch at 0.03 h is late: as late at h, h/2 and h/4, but not at 10/11 h."""
    late = 0.97
    same = (late, late, late)
    assert limit(same, 4, 1e-12).kind == ROUNDING
    found = limit(same, 4, 1e-12, elsewhere=(ELSEWHERE, 0.4))
    assert found.kind == NO_ORDER and found.low <= late - 0.57 and found.error(late) >= 0.57
    smooth = [late + 1e-3 * step**4 for step in STEPS]
    assert limit(smooth, 4, 1e-12, elsewhere=(ELSEWHERE, late + 1e-3 * ELSEWHERE**4)).kind == ORDER
    assert limit(smooth, 4, 1e-12, elsewhere=(ELSEWHERE, 0.4)).error(smooth[0]) >= 0.57


def test_a_course_of_noise_does_not_fall_and_a_smooth_one_does():
    random = np.random.default_rng(2)
    t = np.linspace(0, 1, 200)[:, None]
    smooth = [np.sin(t) + step * np.cos(3 * t) for step in STEPS]
    assert falls(*smooth, 1e-13)
    assert falls(*(np.where(t > 0.5, np.nan, course) for course in smooth), 1e-13)
    noisy = [np.sin(t) + random.normal(size=t.shape) for _ in STEPS]
    assert not falls(*noisy, 1e-13)
    walks = [np.cumsum(random.normal(size=t.shape), axis=0) for _ in STEPS]
    assert not falls(*walks, 1e-13)
    assert not falls(smooth[0], smooth[1], smooth[1][:-1], 1e-13)


def test_nothing_is_said_against_a_course_of_which_nothing_is_known():
    empty = np.empty((0, 3))
    assert falls(empty, empty, empty, 0.0)
    same = np.ones((5, 1))
    assert falls(same, same, same, 1e-16) and falls(same, same + 1e-16, same, 1e-15)


def test_numbers_of_any_size_are_judged():
    for scale in (1e-300, 1e99, 1e150):
        found = judged(lambda h, s=scale: s * (1.0 + h), 1)
        assert found.kind == ORDER and math.isfinite(found.error(2.0 * scale))
