"""Gains of homogeneous sliding-mode differentiators and observers of any order."""

import math

from numpy.typing import NDArray

RECURSIVE = (1.1, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 12.0)
"""lambda_0 … lambda_7, valid up to order 7: Levant and Livne, Automatica 98 (2018) 1–7, "Robust exact filtering …"."""


def write_gains(lipschitz: float, gains: NDArray) -> None:
    """Gains k_0 … k_n of the form that is not recursive, dz_i/dt = -k_i |e|^((n-i)/(n+1)) sgn(e) + z_(i+1).

    gains: (n + 1); lipschitz: of the n-th derivative. With m_n = lambda_n and m_i = lambda_i m_(i+1)^(i/(i+1)), k_i is
    m_(n-i) lipschitz^((i+1)/(n+1)).
    """
    n = gains.size - 1
    scaled = 0.0
    for i in range(n + 1):
        j = n - i
        scaled = RECURSIVE[j] * (1.0 if i == 0 else math.pow(scaled, j / (j + 1.0)))
        gains[i] = scaled * math.pow(lipschitz, (i + 1.0) / (n + 1.0))
