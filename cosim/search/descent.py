"""CMA-ES from the package `cma`, imported when it is needed."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from cosim.errors import MissingPackage

POPULATION = 16


def strategy(begin: Any, spread: float, seed: int, generations: int) -> Any:
    """A strategy of `cma` in the unit cube, from a point (size,). Raises: MissingPackage."""
    options = {"bounds": [0.0, 1.0], "popsize": POPULATION, "maxiter": generations, "seed": seed, "verbose": -9}
    return library().CMAEvolutionStrategy(list(np.asarray(begin, float)), spread, options)


def library() -> Any:
    """The package. Raises: MissingPackage."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cma
    except ImportError:
        fix = "pip install 'cosim[search]'"
        raise MissingPackage("a search needs the package cma, which is not installed", fix=fix) from None
    return cma
