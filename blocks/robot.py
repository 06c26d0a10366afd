"""The plant: a three-wheel omnidirectional robot."""

from cosim.authoring.block import Block
from cosim.authoring.rules import rule
from cosim.authoring.variables import Input, Parameter, State
from cosim.blocks.control_gain import wheel_directions
from cosim.blocks.reference import POSITION


class OmnidirectionalRobot(Block):
    """Three-wheel omnidirectional robot, (42).

    ::

        u ──►┌───────┐            dx/dt = v
             │ robot │──► x
        w ──►└───────┘            dv/dt = M T(theta) u + w        (M and T: see OmnidirectionalGain)

    The velocity v is local: nobody can be wired to it. A robot starts at rest.
    """

    u = Input(3, unit="N", description="forces of the three wheels")
    w = Input(3, unit=("m/s2", "m/s2", "rad/s2"), description="uncertainty")
    x = State(3, unit=POSITION, output=True, description="position and heading")
    v = State(3, unit=("m/s", "m/s", "rad/s"), description="velocity")
    mass = Parameter(unit="kg", description="mass")
    inertia = Parameter(unit="kg.m2", description="moment of inertia")
    radius = Parameter(unit="m", description="distance of the wheels from the centre")

    positive = rule("mass, inertia, radius > 0", "eq. 42")(
        lambda mass, inertia, radius: min(mass, inertia, radius) > 0.0
    )

    def derivatives(x, v, u, w, mass, inertia, radius, d_x, d_v):
        across_1, along_1, across_2, along_2, across_3, along_3 = wheel_directions(x[2])
        for q in range(3):
            d_x[q] = v[q]
        d_v[0] = (across_1 * u[0] + across_2 * u[1] + across_3 * u[2]) / mass + w[0]
        d_v[1] = (along_1 * u[0] + along_2 * u[1] + along_3 * u[2]) / mass + w[1]
        d_v[2] = radius * (u[0] + u[1] + u[2]) / inertia + w[2]
