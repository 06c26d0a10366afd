"""Vectors: their norms and products, the parts of them, and joins of several."""

import math

import numpy as np

from cosim import Block, Input, Output, Parameter, rule


class Norm(Block):
    """The Euclidean norm.

    ::

        y = sqrt(u_1^2 + u_2^2 + …)
    """

    u = Input("n?", description="vector")
    y = Output(description="its norm")

    def outputs(u, y):
        total = 0.0
        for q in range(u.size):
            total += u[q] * u[q]
        y[0] = math.sqrt(total)


class Dot(Block):
    """The scalar product.

    ::

        y = u_1^T u_2
    """

    u_1 = Input("n?", description="first vector")
    u_2 = Input("n?", description="second vector")
    y = Output(description="scalar product")

    def outputs(u_1, u_2, y):
        y[0] = 0.0
        for q in range(u_1.size):
            y[0] += u_1[q] * u_2[q]


class Total(Block):
    """The sum of a vector's elements.

    ::

        y = u_1 + u_2 + …
    """

    u = Input("n?", description="vector")
    y = Output(description="sum of its elements")

    def outputs(u, y):
        y[0] = 0.0
        for q in range(u.size):
            y[0] += u[q]


class Mean(Block):
    """The mean of a vector's elements.

    ::

        y = (u_1 + … + u_n) / n
    """

    u = Input("n?", description="vector")
    y = Output(description="mean of its elements")

    def outputs(u, y):
        total = 0.0
        for q in range(u.size):
            total += u[q]
        y[0] = total / u.size


class Select(Block):
    """Some elements of a vector, in any order.

    ::

        y = [u[i] for i in elements],   counted from 1
    """

    u = Input("n", description="vector")
    elements = Parameter("p?", dtype=np.int32, unit="1", default=1, description="numbers of elements, from 1")
    y = Output("p?", description="the elements; a scalar where there is one")

    inside = rule("elements from 1 to the size of u")(
        lambda elements, n: bool(np.min(elements) >= 1 and np.max(elements) <= n)
    )

    def outputs(u, elements, y):
        for q in range(y.size):
            y[q] = u[elements[q] - 1]


class Join(Block):
    """Several signals one after the other, as one vector: `u: [a.y, b.y, c.y]`.

    ::

        y = [u_1, u_2, …]
    """

    u = Input("n", description="list of sources")
    y = Output("n", description="their elements, one after the other")

    def outputs(u, y):
        for q in range(y.size):
            y[q] = u[q]


class Cross(Block):
    """The vector product of two vectors in space.

    ::

        y = u_1 × u_2
    """

    u_1 = Input(3, description="first vector")
    u_2 = Input(3, description="second vector")
    y = Output(3, description="vector product")

    def outputs(u_1, u_2, y):
        y[0] = u_1[1] * u_2[2] - u_1[2] * u_2[1]
        y[1] = u_1[2] * u_2[0] - u_1[0] * u_2[2]
        y[2] = u_1[0] * u_2[1] - u_1[1] * u_2[0]


class Rotation(Block):
    """A vector in the plane turned by an angle.

    ::

        y_1 = cos(theta) u_1 - sin(theta) u_2
        y_2 = sin(theta) u_1 + cos(theta) u_2
    """

    u = Input(2, description="vector")
    theta = Input(unit="rad", description="angle")
    y = Output(2, description="the turned vector")

    def outputs(u, theta, y):
        y[0] = math.cos(theta) * u[0] - math.sin(theta) * u[1]
        y[1] = math.sin(theta) * u[0] + math.cos(theta) * u[1]
