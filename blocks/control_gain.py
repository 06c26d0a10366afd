"""The control gain of an omnidirectional robot, (42): how wheel forces accelerate it."""

import math

from cosim import Block, Input, Output, Parameter, rule
from cosim.blocks.channels import POSITION

HALF_ROOT_3 = 0.5 * math.sqrt(3.0)


Row = tuple[float, float, float]


def wheel_directions(theta: float) -> tuple[Row, Row]:
    """The first two rows of T(theta), (42), at a heading theta (rad).

    Their columns are the unit vectors d_1, d_2, d_3 in which the wheels push. These are 120 degrees apart, so that
    d_1 + d_2 + d_3 = 0 and the sum of d_k d_k^T is 1.5 I.
    """
    s, c = math.sin(theta), math.cos(theta)
    across = -s, 0.5 * s - HALF_ROOT_3 * c, 0.5 * s + HALF_ROOT_3 * c
    along = c, -0.5 * c - HALF_ROOT_3 * s, HALF_ROOT_3 * s - 0.5 * c
    return across, along


class OmnidirectionalGain(Block):
    """The control gain g_i = M_i T_i(theta_i) of a three-wheel robot, (42), as observer and controller know it.

    ::

        x ─► g           d v/dt = g u + w
          ─► g_inverse   u = g^-1 a

        M = diag(1/mass, 1/mass, 1/inertia)

            | -sin(theta)  -sin(pi/3 - theta)   sin(pi/3 + theta) |   | d_1     d_2     d_3    |
        T = |  cos(theta)  -cos(pi/3 - theta)  -cos(pi/3 + theta) | = |                        |
            |  radius       radius              radius            |   | radius  radius  radius |

    As the directions d_k sum to zero, row k of the inverse is [2/3 mass d_k^T, inertia / (3 radius)].
    """

    x = Input(3, unit=POSITION, description="position and heading")
    mass = Parameter(unit="kg", description="mass")
    inertia = Parameter(unit="kg.m2", description="moment of inertia")
    radius = Parameter(unit="m", description="distance of the wheels from the centre")
    g = Output(3, 3, unit=("1/kg", "1/kg", "1/(kg.m)"), description="control gain; a column for each wheel")
    g_inverse = Output(3, 3, description="inverse of the control gain; a row for each wheel")

    positive = rule("mass, inertia, radius > 0", "eq. 42")(
        lambda mass, inertia, radius: min(mass, inertia, radius) > 0.0
    )

    def outputs(x, mass, inertia, radius, g, g_inverse):
        across, along = wheel_directions(x[2])
        for k in range(3):
            g[0, k] = across[k] / mass
            g[1, k] = along[k] / mass
            g[2, k] = radius / inertia
            g_inverse[k, 0] = 2.0 / 3.0 * mass * across[k]
            g_inverse[k, 1] = 2.0 / 3.0 * mass * along[k]
            g_inverse[k, 2] = inertia / (3.0 * radius)
