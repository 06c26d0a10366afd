"""Arithmetic of signals: sums, gains, products, functions of one number, parts and joins."""

import math

import numpy as np
from numpy.typing import NDArray

from cosim import Block, Input, Output, Parameter, rule


def signed(sign: int, value: float) -> float:
    """A term of a sum; nothing for a sign of 0."""
    return value if sign > 0 else (-value if sign < 0 else 0.0)


def terms(*others: object) -> int:
    """How many terms a sum has, whose first is always there; others: what is wired to the further ones, or None."""
    return max([1, *(k for k, source in enumerate(others, start=2) if source is not None)])


def wired(signs: NDArray, u_2: object, u_3: object, u_4: object, u_5: object, u_6: object) -> tuple[bool, str]:
    """Whether all terms with a sign are wired, as the first always is; six of 1 are the default, for any number."""
    further = enumerate((u_2, u_3, u_4, u_5, u_6), start=2)
    missing = [f"u_{k}" for k, source in further if k <= len(signs) and source is None]
    default = len(signs) == 6 and bool(np.all(signs == 1))
    return default or not missing, f"{len(signs)} signs, and no {', '.join(missing)}"


class Sum(Block):
    """The sum of up to six signals, each with its sign.

    ::

        y = signs[0] u_1 + signs[1] u_2 + …

    `signs: [1, -1]` is a difference: each sign has its input. Without signs, all that is wired is added.
    """

    u_1 = Input("n?", description="first term")
    u_2 = Input("n?", start=0.0, description="second term")
    u_3 = Input("n?", start=0.0, description="third term")
    u_4 = Input("n?", start=0.0, description="fourth term")
    u_5 = Input("n?", start=0.0, description="fifth term")
    u_6 = Input("n?", start=0.0, description="sixth term")
    signs = Parameter(
        "terms", dtype=np.int32, unit="1", default=(1, 1, 1, 1, 1, 1), description="1 or -1, term by term"
    )
    y = Output("n?", description="sum")

    ones = rule("signs are 1 or -1, six at most")(lambda signs: bool(np.all(abs(signs) == 1) and len(signs) <= 6))
    enough = rule("a sign for each input that is wired")(
        lambda signs, u_2, u_3, u_4, u_5, u_6: (len(signs) >= terms(u_2, u_3, u_4, u_5, u_6), f"{len(signs)} signs")
    )
    used = rule("a wire or a constant for each sign")(wired)

    def outputs(u_1, u_2, u_3, u_4, u_5, u_6, signs, y):
        count = signs.size
        for q in range(y.size):
            total = signed(signs[0], u_1[q])
            if count > 1:
                total += signed(signs[1], u_2[q])
            if count > 2:
                total += signed(signs[2], u_3[q])
            if count > 3:
                total += signed(signs[3], u_4[q])
            if count > 4:
                total += signed(signs[4], u_5[q])
            if count > 5:
                total += signed(signs[5], u_6[q])
            y[q] = total


class Gain(Block):
    """A gain, one for all elements or one for each.

    ::

        y = k u
    """

    u = Input("n?", description="signal")
    k = Parameter("n?", default=1.0, description="gain")
    y = Output("n?", description="product")

    def outputs(u, k, y):
        for q in range(y.size):
            y[q] = k[q] * u[q]


class MatrixGain(Block):
    """The product of a matrix with a vector.

    ::

        y = K u
    """

    u = Input("m?", description="vector")
    K = Parameter("p", "m", description="matrix, a row for each output")
    y = Output("p?", description="product; a scalar where the matrix has one row")

    def outputs(u, K, y):
        for i in range(y.size):
            y[i] = 0.0
            for j in range(u.size):
                y[i] += K[i, j] * u[j]


class Bias(Block):
    """A constant added.

    ::

        y = u + bias
    """

    u = Input("n?", description="signal")
    bias = Parameter("n?", default=0.0, description="what is added")
    y = Output("n?", description="sum")

    def outputs(u, bias, y):
        for q in range(y.size):
            y[q] = u[q] + bias[q]


class Product(Block):
    """The product of two signals, element by element.

    ::

        y = u_1 u_2
    """

    u_1 = Input("n?", description="first factor")
    u_2 = Input("n?", description="second factor")
    y = Output("n?", description="product")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = u_1[q] * u_2[q]


class Division(Block):
    """The quotient of two signals, element by element. Division by zero ends the run, as its result is not finite.

    ::

        y = u_1 / u_2
    """

    u_1 = Input("n?", description="numerator")
    u_2 = Input("n?", description="denominator")
    y = Output("n?", description="quotient")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = u_1[q] / u_2[q]


class Power(Block):
    """A power with the sign of its base, or the plain one.

    ::

        y = u^exponent,   or with `signed`   sign(u) |u|^exponent
    """

    u = Input("n?", description="base")
    exponent = Parameter("n?", unit="1", default=2.0, description="exponent")
    signed = Parameter(dtype=bool, unit="1", default=False, description="keep the sign of the base")
    y = Output("n?", description="power")

    def outputs(u, exponent, signed, y):
        for q in range(y.size):
            if signed:
                y[q] = math.copysign(math.pow(abs(u[q]), exponent[q]), u[q])
            else:
                y[q] = math.pow(u[q], exponent[q])


class Abs(Block):
    """The absolute value.

    ::

        y = |u|
    """

    u = Input("n?", description="signal")
    y = Output("n?", description="its absolute value")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = abs(u[q])


class Sqrt(Block):
    """The square root; of a negative number it is not finite, which ends the run.

    ::

        y = sqrt(u)
    """

    u = Input("n?", description="signal")
    y = Output("n?", description="its root")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.sqrt(u[q])


class Exp(Block):
    """The exponential function.

    ::

        y = e^u
    """

    u = Input("n?", unit="1", description="exponent")
    y = Output("n?", unit="1", description="power of e")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.exp(u[q])


class Log(Block):
    """The natural logarithm; of what is not above zero it is not finite, which ends the run.

    ::

        y = ln u
    """

    u = Input("n?", unit="1", description="signal")
    y = Output("n?", unit="1", description="its logarithm")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.log(u[q])


class Sin(Block):
    """The sine.

    ::

        y = sin u
    """

    u = Input("n?", unit="rad", description="angle")
    y = Output("n?", unit="1", description="its sine")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.sin(u[q])


class Cos(Block):
    """The cosine.

    ::

        y = cos u
    """

    u = Input("n?", unit="rad", description="angle")
    y = Output("n?", unit="1", description="its cosine")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.cos(u[q])


class Tan(Block):
    """The tangent.

    ::

        y = tan u
    """

    u = Input("n?", unit="rad", description="angle")
    y = Output("n?", unit="1", description="its tangent")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = math.tan(u[q])


class Atan2(Block):
    """The angle of a vector.

    ::

        theta = atan2(y, x),   from -pi to pi
    """

    y = Input("n?", description="ordinate")
    x = Input("n?", description="abscissa")
    theta = Output("n?", unit="rad", description="angle")

    def outputs(y, x, theta):
        for q in range(theta.size):
            theta[q] = math.atan2(y[q], x[q])


class Minimum(Block):
    """The smaller of two signals, element by element.

    ::

        y = min(u_1, u_2)
    """

    u_1 = Input("n?", description="first signal")
    u_2 = Input("n?", description="second signal")
    y = Output("n?", description="the smaller one")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = min(u_1[q], u_2[q])


class Maximum(Block):
    """The larger of two signals, element by element.

    ::

        y = max(u_1, u_2)
    """

    u_1 = Input("n?", description="first signal")
    u_2 = Input("n?", description="second signal")
    y = Output("n?", description="the larger one")

    def outputs(u_1, u_2, y):
        for q in range(y.size):
            y[q] = max(u_1[q], u_2[q])
