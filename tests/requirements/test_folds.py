"""One number of each sample's elements: as exact arithmetic and numpy have it, compiled or not, however they lie."""

import math
from fractions import Fraction

import numpy as np
import pytest

from cosim.requirements.folds import FEW, LARGEST, LENGTH, SMALLEST, TOTAL, fold, folded
from cosim.requirements.two_engines import kernel

SHAPES = [(5, 3), (5, 4, 3), (1, 1), (7, FEW), (4, FEW + 1), (3, 2, FEW + 1), (0, 3)]
NUMPYS = {LARGEST: np.max, SMALLEST: np.min}


@pytest.fixture(params=[True, False], ids=["compiled", "interpreted"])
def one(request):
    with np.errstate(all="ignore"):  # as monitors do
        yield kernel(fold, request.param)


def samples(shape):
    """Numbers of all sizes, as a view of rows that have more, as a run's samples are."""
    random = np.random.default_rng(3)
    wide = random.normal(size=(shape[0], 5 + math.prod(shape[1:]))) * 10.0 ** random.integers(-5, 5, shape[0])[:, None]
    return wide[:, 2:-3].reshape(shape) if shape[0] else np.zeros(shape)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("sizes", [False, True])
def test_extremes_are_numpys(one, shape, sizes):
    given, left = samples(shape), len(shape) - 2
    for kind, numpys in NUMPYS.items():
        if shape[0] or shape[-1]:
            expected = numpys(np.abs(given) if sizes else given, axis=-1)
            np.testing.assert_array_equal(folded(one, kind, given, left, sizes), expected)


@pytest.mark.parametrize("shape", SHAPES[:-1], ids=str)
def test_sums_and_lengths_are_the_exact_ones_but_for_rounding(one, shape):
    """An addition of n numbers is off by at most n units of rounding of the sum of their sizes."""
    given, left, n = samples(shape), len(shape) - 2, shape[-1]
    totals, lengths = folded(one, TOTAL, given, left), folded(one, LENGTH, given, left)
    for index in np.ndindex(*shape[:-1]):
        row = [Fraction(x) for x in given[index].tolist()]
        assert abs(Fraction(totals[index]) - sum(row)) <= n * Fraction(2.0**-53) * sum(map(abs, row))
        assert lengths[index] == pytest.approx(math.sqrt(sum(x * x for x in row)), rel=(n + 3) * 2.0**-53)


@pytest.mark.parametrize("at", [0, 1, 2])
@pytest.mark.parametrize("kind", [LARGEST, SMALLEST, TOTAL, LENGTH])
@pytest.mark.parametrize("sizes", [False, True])
def test_what_is_no_number_makes_none(one, at, kind, sizes):
    given = np.array([[1.0, -2.0, math.inf], [1.0, 2.0, 3.0]])
    given[0, at] = math.nan
    found = folded(one, kind, given, 0, sizes)
    assert np.isnan(found[0]) and np.isfinite(found[1])


def test_infinite_elements_are_the_extremes(one):
    given = np.array([[-math.inf, 2.0, -3.0]])
    assert folded(one, LARGEST, given, 0) == 2.0 and folded(one, LARGEST, given, 0, True) == math.inf
    assert folded(one, SMALLEST, given, 0) == -math.inf and folded(one, SMALLEST, given, 0, True) == 2.0
    assert folded(one, LENGTH, given, 0) == math.inf


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1.0, 1e160, 1e300])
def test_lengths_of_numbers_of_any_size(one, size):
    assert folded(one, LENGTH, np.array([[3.0, 4.0]]) * size, 0) == pytest.approx(5.0 * size, rel=1e-15)
    assert folded(one, LENGTH, np.full((1, FEW + 4), size), 0) == pytest.approx(6.0 * size, rel=1e-14)


def test_elements_that_lie_in_columns_or_backwards(one):
    given = np.arange(24.0).reshape(2, 3, 4)
    for view in (given.transpose(0, 2, 1), given[:, ::-1], given[:, :, ::-2], given[::-1]):
        np.testing.assert_array_equal(folded(one, LARGEST, view, 0), view.reshape(2, -1).max(axis=1))
        np.testing.assert_array_equal(folded(one, SMALLEST, view, 1), view.min(axis=2))
