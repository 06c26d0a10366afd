"""Products and norms of vectors."""

import math

import numpy as np
import pytest

from cosim.blocks.vectors import dot, norm, norm_of_all, norm_of_difference


def test_products_and_norms():
    a, b = np.random.default_rng(4).normal(size=(2, 5, 3))
    assert dot(a[0], b[0]) == pytest.approx(a[0] @ b[0], rel=1e-13)
    assert norm(a[0]) == pytest.approx(np.linalg.norm(a[0]), rel=1e-13)
    assert norm_of_difference(a[0], b[0]) == pytest.approx(np.linalg.norm(a[0] - b[0]), rel=1e-13)
    assert norm_of_all(a) == pytest.approx(np.linalg.norm(a), rel=1e-13)


def test_sums_begin_with_zero():
    """So that no sum of zeros is -0."""
    assert math.copysign(1.0, dot(np.array([-0.0]), np.ones(1))) == 1.0
