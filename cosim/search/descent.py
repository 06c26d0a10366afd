"""CMA-ES from the package `cma`, imported when it is needed."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from cosim.errors import MissingPackage

POPULATION = 16


def strategy(begin: Any, spread: float, seed: int, generations: int, onto_bounds: bool = False) -> Any:
    """A strategy of `cma` in the unit cube, from a point (size,).

    onto_bounds: what lies beyond the cube is moved onto its bounds, at a price, so that many points have coordinates at
    their least or most, where much breaks; without, coordinates are folded smoothly and come near bounds only.

    Raises: MissingPackage.
    """
    package = library()
    options = {"bounds": [0.0, 1.0], "popsize": POPULATION, "maxiter": generations, "seed": seed, "verbose": -9}
    if onto_bounds and len(begin) > 1:  # the package fails in one dimension, when it limits the spread
        options["BoundaryHandler"] = package.BoundPenalty
    return package.CMAEvolutionStrategy(list(np.asarray(begin, float)), spread, options)


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
