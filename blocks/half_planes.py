"""The nearest point of the plane that some half-planes admit, or the one that violates them least.

The half-planes are normals_k · p >= offsets_k - slack, with normals of length 1, in a disc of some radius about 0. They
are added one after the other: where the point so far lies outside, the new one lies on the border (de Berg and others,
Computational Geometry, 2008, section 4.4; the objective, a distance, is strictly convex, so nothing is degenerate).
"""

import math

from numpy.typing import NDArray

HALVINGS = 60


def on_border(
    k: int, along: float, normals: NDArray, offsets: NDArray, slack: float, radius: float
) -> tuple[float, bool]:
    """Where on the border of half-plane k, nearest to `along`, the disc and all half-planes before k admit a point.

    Measured from the foot of the normal, to the left of it. normals: (capacity, 2); offsets: (capacity).
    """
    c = offsets[k] - slack
    if abs(c) > radius:
        return 0.0, False
    high = math.sqrt(radius * radius - c * c)
    low = -high
    for j in range(k):
        across = normals[j, 1] * normals[k, 0] - normals[j, 0] * normals[k, 1]
        needed = offsets[j] - slack - c * (normals[j, 0] * normals[k, 0] + normals[j, 1] * normals[k, 1])
        if across > 1e-12:
            low = max(low, needed / across)
        elif across < -1e-12:
            high = min(high, needed / across)
        elif needed > 0.0:
            return 0.0, False
    return min(max(along, low), high), low <= high


def nearest_admitted(
    x: float, y: float, normals: NDArray, offsets: NDArray, count: int, slack: float, radius: float
) -> tuple[float, float, bool]:
    """The point nearest to (x, y) that the first `count` half-planes admit, and whether there is one."""
    size = math.sqrt(x * x + y * y)
    p, q = (x, y) if size <= radius else (x / size * radius, y / size * radius)
    for k in range(count):
        if normals[k, 0] * p + normals[k, 1] * q >= offsets[k] - slack:
            continue
        along, found = on_border(k, normals[k, 0] * y - normals[k, 1] * x, normals, offsets, slack, radius)
        if not found:
            return p, q, False
        p = (offsets[k] - slack) * normals[k, 0] - along * normals[k, 1]
        q = (offsets[k] - slack) * normals[k, 1] + along * normals[k, 0]
    return p, q, True


def least_violating(
    x: float, y: float, normals: NDArray, offsets: NDArray, count: int, radius: float
) -> tuple[float, float, float]:
    """The point nearest to (x, y) of those that no half-plane misses by more than need be, and by how much that is.

    0 where all of them can be kept; else by bisection.
    """
    p, q, found = nearest_admitted(x, y, normals, offsets, count, 0.0, radius)
    if found:
        return p, q, 0.0
    low, high = 0.0, 0.0
    for k in range(count):
        high = max(high, offsets[k] - normals[k, 0] * p - normals[k, 1] * q)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        new_p, new_q, found = nearest_admitted(x, y, normals, offsets, count, middle, radius)
        if found:
            p, q, high = new_p, new_q, middle
        else:
            low = middle
    return p, q, high
