"""Jacobians by central differences, for filters whose derivatives nobody wants to write."""

from collections.abc import Callable

from numpy.typing import NDArray

#: The cube root of float64's precision, at which truncation and rounding cost alike.
STEP = 2.0**-17


def jacobian(function: Callable[[NDArray, NDArray], NDArray]) -> Callable[[NDArray, NDArray, NDArray], None]:
    """What fills the Jacobian of a function by its first argument.

    function: takes states x (n) and whatever else it depends on as one array, and returns an array (m). The result is
    called with both and with an array (m, n) to be filled; its relative error is about 1e-10, that of differences over
    `STEP` times x, or times 1 where |x| is less.
    """

    def slopes(x: NDArray, other: NDArray, result: NDArray) -> None:
        moved = x.copy()
        for j in range(x.size):
            step = STEP * max(1.0, abs(x[j]))
            moved[j] = x[j] + step
            above = function(moved, other)
            moved[j] = x[j] - step
            result[:, j] = (above - function(moved, other)) / (2.0 * step)
            moved[j] = x[j]

    return slopes
