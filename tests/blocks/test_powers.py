"""Cube root and signed powers."""

import math
from fractions import Fraction

import numpy as np
import pytest

from cosim.blocks.cube_root import HIGHEST, LOWEST, cube_root, cube_root_within
from cosim.blocks.signed_power import common_root, sign, signed_powers


def spread(count: int) -> np.ndarray:
    """Positive numbers of all sizes, mostly of those that errors have."""
    rng = np.random.default_rng(1)
    return np.concatenate([np.exp(rng.uniform(-60, 60, count)), np.exp(rng.uniform(-708, 709, count))])


def is_root(y: float, a: float) -> bool:
    """Whether y is less than one unit in the last place from a^(1/3), in exact arithmetic.

    Libraries' own cube roots are no oracle: some are farther off than ours.
    """
    unit = Fraction(math.ulp(y))
    return (Fraction(y) - unit) ** 3 < Fraction(a) < (Fraction(y) + unit) ** 3


def test_cube_root_is_within_one_unit_in_the_last_place():
    assert [a for a in spread(2000).tolist() if not is_root(cube_root(a), a)] == []


@pytest.mark.parametrize("root", [1.0, 2.0, 3.0, 0.1, 1e-5, 7.0, 1e100, 2.0**-341])
def test_cube_root_of_a_cube(root):
    assert cube_root(root**3) == pytest.approx(root, rel=2.3e-16)


def test_cube_root_beside_the_normal_numbers():
    assert cube_root(0.0) == 0.0
    assert cube_root(math.inf) == math.inf
    assert math.isnan(cube_root(math.nan))
    for extreme in (5e-324, LOWEST, math.nextafter(LOWEST, 1.0), HIGHEST, math.nextafter(HIGHEST, 0.0), 1.7e308):
        assert is_root(cube_root(extreme), extreme)


def test_cube_root_compiled_gives_the_same_bits():
    numba = pytest.importorskip("numba")
    within = numba.njit(error_model="numpy")(cube_root_within)
    compiled = numba.njit(lambda numbers: [within(a) for a in numbers])
    numbers = spread(2000)
    numbers = numbers[(numbers > LOWEST) & (numbers < HIGHEST)]
    assert [cube_root(a) for a in numbers] == compiled(numbers)


@pytest.mark.parametrize("beta", [2 / 3, 0.75, 0.6, 0.9])
@pytest.mark.parametrize("e", [-3.0, -1e-9, 0.0, 0.4, 8.0])
def test_signed_powers(beta, e):
    given, first, second = np.array([e, 1.0, -e]), np.zeros(3), np.zeros(3)
    signed_powers(given, beta, common_root(beta), first, second)
    assert first == pytest.approx(np.sign(given) * abs(given) ** beta, rel=1e-14)
    assert second == pytest.approx(np.sign(given) * abs(given) ** (2 * beta - 1), rel=1e-14)


@pytest.mark.parametrize("extreme", [0.0, 5e-324, -1e-300, 1e300, math.inf])
def test_an_extreme_error_changes_no_other_channel(extreme):
    first, second = np.zeros((2, 3))
    signed_powers(np.array([-0.3, extreme, 0.7]), 2 / 3, 3, first, second)
    roots = [-cube_root(0.3), math.copysign(cube_root(abs(extreme)), extreme), cube_root(0.7)]
    assert second.tolist() == roots
    assert first.tolist() == [math.copysign(r * r, r) for r in roots]


@pytest.mark.parametrize(("e", "expected"), [(3.0, 1.0), (-5e-324, -1.0), (0.0, 0.0), (-0.0, 0.0)])
def test_sign(e, expected):
    assert sign(e) == expected


@pytest.mark.parametrize(("beta", "root"), [(2 / 3, 3), (3 / 4, 4)])
def test_common_root_knows_rounded_exponents_only(beta, root):
    assert [common_root(beta + off) for off in (-1e-4, -1e-11, -1e-15, 0.0, 1e-15, 1e-11, 1e-4)] == [
        0, 0, root, root, root, 0, 0
    ]  # fmt: skip


def test_other_exponents_have_no_common_root():
    assert [common_root(beta) for beta in (0.51, 0.6, 0.7, 0.8, 0.99)] == [0] * 5
