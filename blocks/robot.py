"""The plant: a three-wheel omnidirectional robot, (42)."""

from cosim import Block, Input, Parameter, State, rule
from cosim.blocks.channels import ACCELERATION, CHANNELS, POSITION, VELOCITY
from cosim.blocks.control_gain import wheel_directions


class OmnidirectionalRobot(Block):
    """Three-wheel omnidirectional robot, (42).

    ::

        u ──►┌───────┐            dx/dt = v
             │ robot │──► x
        w ──►└───────┘            dv/dt = M T(theta) u + w        (M and T: see OmnidirectionalGain)

    The velocity v is local: nobody can be wired to it. A robot starts at rest.
    """

    u = Input(3, unit="N", description="forces of the three wheels")
    w = Input(3, unit=ACCELERATION, components=CHANNELS, description="uncertainty")
    x = State(3, unit=POSITION, components=CHANNELS, output=True, description="position and heading")
    v = State(3, unit=VELOCITY, components=CHANNELS, description="velocity")
    mass = Parameter(unit="kg", description="mass")
    inertia = Parameter(unit="kg.m2", description="moment of inertia")
    radius = Parameter(unit="m", description="distance of the wheels from the centre")

    positive = rule("mass, inertia, radius > 0", "eq. 42")(
        lambda mass, inertia, radius: min(mass, inertia, radius) > 0.0
    )

    def derivatives(x, v, u, w, mass, inertia, radius, d_x, d_v):
        across, along = wheel_directions(x[2])
        for q in range(3):
            d_x[q] = v[q]  # (42)
        d_v[0] = (across[0] * u[0] + across[1] * u[1] + across[2] * u[2]) / mass + w[0]
        d_v[1] = (along[0] * u[0] + along[1] * u[1] + along[2] * u[2]) / mass + w[1]
        d_v[2] = radius * (u[0] + u[1] + u[2]) / inertia + w[2]
