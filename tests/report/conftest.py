"""A small study and its results, as the tests of studies have them."""

from tests.study.conftest import *  # noqa: F403
