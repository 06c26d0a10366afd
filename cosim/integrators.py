"""Explicit Runge-Kutta methods, as data: a new integrator is one entry of `INTEGRATORS`, and nothing else.

A step of size h from x: the slope k_1 is the derivative at x; k_i that at the time t + c_i h and the states
x + h (a_i1 k_1 + … + a_i,i-1 k_i-1); the step ends at x + h (b_1 k_1 + … + b_s k_s). All coefficients of a row are
whole numbers over one denominator, so that they are exact, and a step adds up before it divides.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of a tableau: at the node, the numerators over the denominator weigh the slopes so far."""

    node: float
    denominator: int
    numerators: tuple[int, ...]


@dataclass(frozen=True)
class Tableau:
    """A Butcher tableau. stages: the rows from the second stage on. weights: the row that ends the step, at node 1.

    order: the error of a run goes with h^order. embedded: weights of a method of a lower order over the same slopes,
    whose distance estimates the error; None where there is none.
    """

    order: int
    stages: tuple[Row, ...]
    weights: Row
    embedded: Row | None = None
    source: str = ""

    @property
    def count(self) -> int:
        """How often a step asks for derivatives."""
        return len(self.stages) + 1

    def words(self) -> list[float]:
        """What `cosim.master.loop` reads: node, denominator and `count` numerators of each row, of the last one too."""
        words: list[float] = []
        for row in (*self.stages, self.weights):
            rest = [0] * (self.count - len(row.numerators))
            words += map(float, (row.node, row.denominator, *row.numerators, *rest))
        return words


INTEGRATORS = {
    "euler": Tableau(1, (), Row(1, 1, (1,)), source="Euler 1768"),
    "heun": Tableau(2, (Row(1, 1, (1,)),), Row(1, 2, (1, 1)), Row(1, 1, (1, 0)), "Heun 1900"),
    "ralston": Tableau(2, (Row(2 / 3, 3, (2,)),), Row(1, 4, (1, 3)), source="Ralston 1962"),
    "bogacki-shampine": Tableau(
        3,
        (Row(1 / 2, 2, (1,)), Row(3 / 4, 4, (0, 3)), Row(1, 9, (2, 3, 4))),
        Row(1, 9, (2, 3, 4, 0)),
        Row(1, 24, (7, 6, 8, 3)),
        "Bogacki and Shampine 1989",
    ),
    "rk4": Tableau(
        4,
        (Row(1 / 2, 2, (1,)), Row(1 / 2, 2, (0, 1)), Row(1, 1, (0, 0, 1))),
        Row(1, 6, (1, 2, 2, 1)),
        source="Kutta 1901",
    ),
    "dormand-prince": Tableau(
        5,
        (
            Row(1 / 5, 5, (1,)),
            Row(3 / 10, 40, (3, 9)),
            Row(4 / 5, 45, (44, -168, 160)),
            Row(8 / 9, 6561, (19372, -76080, 64448, -1908)),
            Row(1, 167904, (477901, -1806240, 1495424, 46746, -45927)),
            Row(1, 142464, (12985, 0, 64000, 92750, -45927, 18656)),
        ),
        Row(1, 142464, (12985, 0, 64000, 92750, -45927, 18656, 0)),
        Row(1, 21369600, (1921409, 0, 9690880, 13122270, -5802111, 1902912, 534240)),
        "Dormand and Prince 1980",
    ),
}

HEAD = 2  # words of a row before its numerators
NODE, DENOMINATOR = range(HEAD)
