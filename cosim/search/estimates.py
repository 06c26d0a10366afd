"""What a fit's residuals tell of each free value: its deviation and interval, or that the data do not tell it.

    C = s^2 (J^T J)^-1,    s^2 = |r|^2 / (m - n)  where no deviation of the noise is known, else 1

of m residuals r, independent and of one variance, by n values within their bounds: Seber and Wild, Nonlinear Regression
(1989), sections 2.1 and 5.1. What has a singular value of nearly nothing is not told: Bates and Watts, Nonlinear
Regression Analysis and Its Applications (1988), section 3.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

CONFIDENCE = 0.95
RANK = 1e-6
"""Of the largest singular value: those below are zero but for the error of the differences."""
SHARE = 0.1
"""Of a direction that changes nothing: what has a larger part in it is not told."""
NEAR = 1e-4
"""Of the distance of its bounds: what is as near to one is at it."""


@dataclass(frozen=True)
class Estimate:
    """One free value. low, high: its interval at CONFIDENCE; None where there is none, for the reason `why`."""

    value: float
    low: float | None
    high: float | None
    why: str = ""


@dataclass(frozen=True)
class Estimates:
    """Of each free value, in order; covariance: (n, n), NaN where the data do not tell; freedom: m - n.

    together: of each direction that changes nothing, which values make it up.
    """

    values: tuple[Estimate, ...]
    covariance: np.ndarray
    freedom: int
    together: tuple[tuple[int, ...], ...]


def estimates(
    point: np.ndarray, lower: np.ndarray, width: np.ndarray, residuals: np.ndarray, jacobian: np.ndarray, known: bool
) -> Estimates:
    """From a point (n,) of the unit cube with residuals (m,) and jacobian (m, n) there. known: as of `Measurements`."""
    from scipy.stats import norm, t

    downhill = -(jacobian.T @ residuals)
    at_bound = ((point <= NEAR) & (downhill < 0.0)) | ((point >= 1.0 - NEAR) & (downhill > 0.0))
    free = np.flatnonzero(~at_bound)
    _, sizes, rows = np.linalg.svd(jacobian[:, free], full_matrices=False)
    told = sizes > RANK * max(sizes.max(initial=0.0), 1e-300)
    silent = np.abs(rows[~told]) > SHARE
    together = tuple(tuple(int(free[k]) for k in np.flatnonzero(row)) for row in silent)
    freedom = len(residuals) - len(free)
    variance = 1.0 if known else float(residuals @ residuals) / freedom if freedom > 0 else math.nan
    scaled = rows[told] / sizes[told, None]
    covariance = np.full((len(point), len(point)), math.nan)
    covariance[np.ix_(free, free)] = variance * (scaled.T @ scaled) * np.outer(width[free], width[free])
    untold = sorted({k for group in together for k in group})
    covariance[untold, :] = covariance[:, untold] = math.nan
    reach = float(norm.ppf(0.5 + CONFIDENCE / 2) if known else t.ppf(0.5 + CONFIDENCE / 2, max(freedom, 1)))
    found = []
    for k, value in enumerate(lower + width * point):
        deviation = math.sqrt(covariance[k, k]) if covariance[k, k] >= 0.0 else math.nan
        why = "at its bound" if at_bound[k] else "the data do not tell it" if k in untold else ""
        none = math.isnan(deviation)
        low, high = (None, None) if none else (value - reach * deviation, value + reach * deviation)
        found.append(Estimate(float(value), low, high, why))
    return Estimates(tuple(found), covariance, freedom, together)
