"""Integrators as data: a new one is one entry of `INTEGRATORS`, and nothing else.

An explicit Runge-Kutta step of size h from x: the slope k_1 is the derivative at x; k_i that at the time t + c_i h and
the states x + h (a_i1 k_1 + … + a_i,i-1 k_i-1); the step ends at x + h (b_1 k_1 + … + b_s k_s). All coefficients of a
row are whole numbers over one denominator, so that they are exact, and a step adds up before it divides.

A Rosenbrock step, with J and f_t the derivatives of f(t, x) where it begins (Hairer and Wanner II, IV.7):

    (1/(h γ) - J) u_i = f(t + α_i h, x + a_i1 u_1 + … + a_i,i-1 u_i-1) + (c_i1 u_1 + … + c_i,i-1 u_i-1)/h + γ_i h f_t

It ends at the states of its last stage and the last increment u_s, which estimates the error.
"""

from __future__ import annotations

import math
from collections import ChainMap
from dataclasses import dataclass
from typing import ClassVar

HEAD = 2  # words of a row before its numerators
NODE, DENOMINATOR = range(HEAD)


@dataclass(frozen=True)
class Row:
    """One line of a tableau: at the node, the numerators over the denominator weigh the slopes so far."""

    node: float
    denominator: int
    numerators: tuple[int, ...]


@dataclass(frozen=True)
class Tableau:
    """A Butcher tableau. stages: the rows from the second stage on. weights: the row that ends the step, at node 1.

    order: the error of a run goes with h^order. embedded: weights of a method of the next lower order over the same
    slopes, whose distance estimates the error; None where there is none. is_implicit: whether a step solves equations,
    so that it may be longer than the fastest motion lasts.
    """

    order: int
    stages: tuple[Row, ...]
    weights: Row
    embedded: Row | None = None
    source: str = ""
    is_implicit: ClassVar = False

    @property
    def count(self) -> int:
        """How often a step asks for derivatives."""
        return len(self.stages) + 1

    @property
    def estimates(self) -> bool:
        """Whether a step estimates its error."""
        return self.embedded is not None

    @property
    def ends_with_slope(self) -> bool:
        """Whether the last stage is at the step's end, so that its slope is the first of the next step."""
        last = self.stages[-1] if self.stages else None
        end = self.weights
        return last is not None and (last.denominator, (*last.numerators, 0)) == (end.denominator, end.numerators)

    def words(self) -> list[float]:
        """What the loop reads: node, denominator and `count` numerators of each row, of the last one too.

        Where there is an estimate, a row for the error, the difference of both results, follows.
        """
        rows = [*self.stages, self.weights]
        if self.embedded:
            denominator = math.lcm(self.weights.denominator, self.embedded.denominator)
            of_step, of_other = (denominator // row.denominator for row in (self.weights, self.embedded))
            pairs = zip(self.weights.numerators, self.embedded.numerators, strict=True)
            rows.append(Row(1, denominator, tuple(of_step * b - of_other * e for b, e in pairs)))
        return [word for row in rows for word in _words(row.node, row.denominator, row.numerators, self.count)]


@dataclass(frozen=True)
class Stage:
    """A stage of a Rosenbrock method: α_i, γ_i, and by the stages before it a_ij and c_ij."""

    node: float
    gamma: float
    states: tuple[float, ...] = ()
    slopes: tuple[float, ...] = ()


@dataclass(frozen=True)
class Rosenbrock:
    """An L-stable, stiffly accurate Rosenbrock method.

    order: as of a Tableau; that of the method whose distance estimates the error is one lower.
    """

    order: int
    gamma: float
    stages: tuple[Stage, ...]
    source: str = ""
    is_implicit: ClassVar = True
    estimates: ClassVar = True
    ends_with_slope: ClassVar = False

    @property
    def count(self) -> int:
        """How many stages a step has."""
        return len(self.stages)

    def words(self) -> list[float]:
        """What the loop reads: γ, and of each stage two rows as of a Tableau: for its states, and for its slope."""
        words = [self.gamma]
        for s in self.stages:
            words += [*_words(s.node, 1, s.states, self.count), *_words(s.gamma, 1, s.slopes, self.count)]
        return words


@dataclass(frozen=True)
class ScipyMethod:
    """A method of scipy's, which shares no code with ours, and integrates all states of a diagram as one system.

    solver: a class of `scipy.integrate`. order, is_implicit: as of a Tableau; the highest that it takes.
    """

    solver: str
    order: int
    is_implicit: bool
    source: str = ""
    count: ClassVar = 0
    estimates: ClassVar = True
    ends_with_slope: ClassVar = False

    def words(self) -> list[float]:
        """Nothing that the loop reads."""
        return []


Method = Tableau | Rosenbrock | ScipyMethod


def _words(node: float, denominator: int, numerators: tuple[float, ...], count: int) -> list[float]:
    return [*map(float, (node, denominator, *numerators)), *[0.0] * (count - len(numerators))]


@dataclass(frozen=True)
class Integration:
    """How continuous states are integrated: in so many equal steps, or in steps whose error is within a tolerance.

    tolerance: the largest error of a step over the size of the state; None for equal steps. absolute_tolerance: what is
    added to it, in the state's unit; None for a thousandth of it.
    """

    integrator: str = "euler"
    inner_steps: int = 1
    tolerance: float | None = None
    absolute_tolerance: float | None = None

    @property
    def method(self) -> Method:
        """The integrator's coefficients, or what does without."""
        return KNOWN[self.integrator]

    @property
    def tolerances(self) -> tuple[float, float]:
        """The relative and the absolute one; of equal steps, as which an implicit integrator takes differences."""
        relative = 1e-6 if self.tolerance is None else self.tolerance
        return relative, 1e-3 * relative if self.absolute_tolerance is None else self.absolute_tolerance

    @property
    def has_equal_stages(self) -> bool:
        """Whether each communication step asks for derivatives at the same times, whatever the states."""
        return self.tolerance is None and not self.method.is_implicit

    @property
    def is_one_euler_step(self) -> bool:
        """Whether states take the communication step at once, by their derivatives at its begin."""
        return self.has_equal_stages and self.method.count == 1 and self.inner_steps == 1


#: What several of their last stages have in common.
_RODAS4 = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950)
_RODAS5P = (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946)
INTEGRATORS: dict[str, Method] = {
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
    "rodas4": Rosenbrock(
        4,
        0.25,
        (
            Stage(0.0, 0.25),
            Stage(0.386, -0.1043, (1.544,), (-5.6688,)),
            Stage(0.21, 0.1035, (0.9466785280815826, 0.2557011698983284), (-2.430093356833875, -0.2063599157091915)),
            Stage(
                0.63,
                -0.0362,
                (3.314825187068521, 2.896124015972201, 0.9986419139977817),
                (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
            ),
            Stage(1.0, 0.0, _RODAS4, (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160)),
            Stage(
                1.0,
                0.0,
                (*_RODAS4, 1.0),
                (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
            ),
        ),
        "Hairer and Wanner 1996",
    ),
    "rodas5p": Rosenbrock(
        5,
        0.21193756319429014,
        (
            Stage(0.0, 0.21193756319429014),
            Stage(0.6358126895828704, -0.42387512638858027, (3.0,), (-14.155112264123755,)),
            Stage(
                0.4095798393397535,
                -0.3384627126235924,
                (2.849394379747939, 0.45842242204463923),
                (-17.97296035885952, -2.859693295451294),
            ),
            Stage(
                0.9769306725060716,
                1.8046452872882734,
                (-6.954028509809101, 2.489845061869568, -10.358996098473584),
                (147.12150275711716, -1.41221402718213, 71.68940251302358),
            ),
            Stage(
                0.4288403609558664,
                2.325825639765069,
                (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
                (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
            ),
            Stage(
                1.0,
                0.0,
                _RODAS5P,
                (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
            ),
            Stage(
                1.0,
                0.0,
                (*_RODAS5P, 1.0),
                (
                    *(30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783),
                    *(-19.097331116725623, -28.087943162872662),
                ),
            ),
            Stage(
                1.0,
                0.0,
                (*_RODAS5P, 1.0, 1.0),
                (
                    *(37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047),
                    *(-40.06618937091002, -54.66780262877968, -9.48861652309627),
                ),
            ),
        ),
        "Steinebach 2023",
    ),
}
#: scipy's methods, by the names that diagrams have for them.
REFERENCES: dict[str, Method] = {
    "lsoda": ScipyMethod("LSODA", 12, True, "Petzold 1983"),
    "radau": ScipyMethod("Radau", 5, True, "Hairer and Wanner 1996"),
    "bdf": ScipyMethod("BDF", 5, True, "Shampine and Reichelt 1997"),
    "rk45": ScipyMethod("RK45", 5, False, "Dormand and Prince 1980"),
    "dop853": ScipyMethod("DOP853", 8, False, "Hairer, Nørsett and Wanner 1993"),
}
#: What a diagram may name, also what is added to either later.
KNOWN: ChainMap[str, Method] = ChainMap(REFERENCES, INTEGRATORS)
