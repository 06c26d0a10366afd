"""Which functions are seen at a glance to have nothing to lower: what takes whole arrays never is one of them."""

import math

import numpy as np
import pytest

from cosim.authoring.lowering import block_functions
from cosim.authoring.lowering.plain_functions import Glance
from cosim.engine import run
from tests.test_formation import ALL, DIAGRAMS

TABLE = np.array([1.0, 2.0])


def bits(a):
    return np.float64(a).view(np.int64)


def first(x):
    return x[0]


def same(x):
    return x


def elements(x, y):
    for q in range(x.size):
        y[q] = math.sqrt(x[q]) + TABLE[q] + first(x)


def filled(y, a):
    y.fill(math.nan)
    y[0] = bits(a)


def filled_with_an_array(x, y):
    y.fill(x)


def bits_of_an_array(x, y):
    y[0] = np.float64(x).view(np.int64)[0]


def view_of_a_new_array(y):
    y[0] = np.zeros(2).view(np.int64)[0]


def filled_new_array(y):
    np.zeros(2).fill(y)


def view_as_an_array(x, a, y):
    y[0] = np.float64(a).view(x)


def handed_on(x, y):
    y[0] = same(x)[1]


def table(a, y):
    y[0] = (TABLE * a)[0]


def added(x, y):
    y[:] = x + 1.0


def matrix(a, y):
    y[0] = a @ a


PLAIN = (bits, first, elements, filled)
WHOLE = (
    same,
    filled_with_an_array,
    bits_of_an_array,
    view_of_a_new_array,
    filled_new_array,
    view_as_an_array,
    handed_on,
    table,
    added,
    matrix,
)
AXES = {"x": 1, "y": 1, "a": 0}


def is_plain(function) -> bool:
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    return Glance().is_plain(function, {name: AXES[name] for name in names})


@pytest.mark.parametrize("function", PLAIN)
def test_what_takes_elements_and_numbers_is_plain(function):
    assert is_plain(function)


@pytest.mark.parametrize("function", WHOLE)
def test_what_takes_or_gives_a_whole_array_is_not(function):
    assert not is_plain(function)


@pytest.mark.parametrize("name", ALL)
def test_no_run_of_the_formation_looks_closely(name):
    """So that it begins at once: the long way begins with the import of what goes it."""
    for component in run.load(DIAGRAMS / name).components.values():
        declaration = component.declaration
        for function in declaration.functions if declaration.compiled else ():
            assert isinstance(block_functions._of(declaration, function)[0], Glance), (
                f"{component.name}.{function.name}"
            )
