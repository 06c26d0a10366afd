"""Look-up tables in one and two dimensions, by lines between their points."""

from numpy.typing import NDArray

from cosim import Block, Indicator, Input, Output, Parameter, rule
from cosim.blocks.sources import ascend


def interval(points: NDArray, value: float) -> int:
    """The number (from 0) of the interval of ascending points in which a value is; an outer one for what is outside."""
    below, above = 0, points.size - 1
    while above - below > 1:
        middle = (below + above) // 2
        if points[middle] <= value:
            below = middle
        else:
            above = middle
    return below


def part_of(points: NDArray, k: int, value: float, beyond: bool) -> float:
    """Which part of an interval a value is beyond its begin; from 0 to 1, unless it may be beyond."""
    part = (value - points[k]) / (points[k + 1] - points[k])
    if beyond:
        return part
    return 0.0 if part < 0.0 else (min(part, 1.0))


def side(points: NDArray, value: float, beyond: bool) -> float:
    """How far a value is from the next corner of a table, as an indicator: its sign changes at each point.

    beyond: whether the outer lines go on, so that the outer points are no corners.
    """
    last = points.size - 1
    k = interval(points, value)
    below, above = value - points[k], points[k + 1] - value
    if k == 0 and (beyond or below < 0.0):
        distance = 1.0 if beyond and last == 1 else (above if beyond else below)
    elif k == last - 1 and (beyond or above < 0.0):
        distance = below if beyond else above
    else:
        distance = min(below, above)
    return distance if k % 2 == 0 else -distance


class LookUp1D(Block):
    """A function of one variable from a table, by lines between its points.

    ::

        y = values[k] + (values[k+1] - values[k]) (u - points[k]) / (points[k+1] - points[k])

    Outside the table its end values, or with `extrapolate` the outer lines. Corners are events.
    """

    u = Input("n?", description="argument")
    points = Parameter("k", default=(0.0, 1.0), description="arguments of the table, ascending")
    values = Parameter("k", default=(0.0, 1.0), description="values at the points")
    extrapolate = Parameter(dtype=bool, unit="1", default=False, description="go on along the outer lines")
    corner = Indicator("n?", description="distance from the next point of the table")
    y = Output("n?", description="value")

    ascending = rule("points ascending, two at least")(lambda points: len(points) > 1 and ascend(points))

    def outputs(u, points, values, extrapolate, y):
        for q in range(y.size):
            k = interval(points, u[q])
            part = part_of(points, k, u[q], extrapolate)
            y[q] = values[k + 1] if part == 1.0 else values[k] + (values[k + 1] - values[k]) * part

    def indicators(u, points, extrapolate, corner):
        for q in range(u.size):
            corner[q] = side(points, u[q], extrapolate)


class LookUp2D(Block):
    """A function of two variables from a table, bilinear between its points.

    ::

        y = (1-a)(1-b) values[i,j] + a (1-b) values[i+1,j] + (1-a) b values[i,j+1] + a b values[i+1,j+1]

    with the parts a of the interval of u_1 and b of that of u_2; outside the table, its edges. Corners are events.
    """

    u_1 = Input("n?", description="first argument")
    u_2 = Input("n?", description="second argument")
    points_1 = Parameter("rows", description="first arguments of the table, ascending")
    points_2 = Parameter("columns", description="second arguments of the table, ascending")
    values = Parameter("rows", "columns", description="values: a row for each first argument")
    corner_1 = Indicator("n?", description="distance of u_1 from the next of its points")
    corner_2 = Indicator("n?", description="distance of u_2 from the next of its points")
    y = Output("n?", description="value")

    ascending = rule("points_1 and points_2 ascending, two each at least")(
        lambda points_1, points_2: all(len(p) > 1 and ascend(p) for p in (points_1, points_2))
    )

    def outputs(u_1, u_2, points_1, points_2, values, y):
        for q in range(y.size):
            i, j = interval(points_1, u_1[q]), interval(points_2, u_2[q])
            a, b = part_of(points_1, i, u_1[q], False), part_of(points_2, j, u_2[q], False)
            low = (1.0 - a) * values[i, j] + a * values[i + 1, j]
            high = (1.0 - a) * values[i, j + 1] + a * values[i + 1, j + 1]
            y[q] = (1.0 - b) * low + b * high

    def indicators(u_1, u_2, points_1, points_2, corner_1, corner_2):
        for q in range(u_1.size):
            corner_1[q] = side(points_1, u_1[q], False)
            corner_2[q] = side(points_2, u_2[q], False)
