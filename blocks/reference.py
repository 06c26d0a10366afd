"""Where each robot of a formation should be, (43)."""

import math

from cosim import Block, CalculatedParameter, Input, Local, Output, Parameter
from cosim.blocks.channels import ACCELERATION, CHANNELS, POSITION, VELOCITY


class SineWavePath(Block):
    """The path of a formation's centre along a sine wave, (43).

    ::

        x_c = [speed t,  amplitude sin(frequency t),  0]

    Its derivatives are locals, of which only locals and measures may know.
    """

    speed = Parameter(unit="m/s", default=0.2, description="speed of the centre along the first axis")
    amplitude = Parameter(unit="m", default=1.0, description="amplitude of the centre along the second axis")
    frequency = Parameter(unit="rad/s", default=0.3, description="angular frequency of the centre's sine wave")
    x_c = Output(3, unit=POSITION, components=CHANNELS, description="position of the centre")
    dx_c = Local(3, unit=VELOCITY, components=CHANNELS, description="first derivative of x_c")
    ddx_c = Local(3, unit=ACCELERATION, components=CHANNELS, description="second derivative of x_c")

    def outputs(time, speed, amplitude, frequency, x_c, dx_c, ddx_c):
        phase = frequency * time
        sine, cosine = math.sin(phase), math.cos(phase)
        x_c[0] = speed * time
        x_c[1] = amplitude * sine
        x_c[2] = 0.0
        dx_c[0] = speed
        dx_c[1] = amplitude * frequency * cosine
        dx_c[2] = 0.0
        ddx_c[0] = 0.0
        ddx_c[1] = -amplitude * frequency * frequency * sine
        ddx_c[2] = 0.0


class CircularFormationReference(Block):
    """A robot's place on a circle around a moving centre, (43).

    ::

        x_c ─► x_d = x_c + [radius cos(angle),  radius sin(angle),  0]

    Only `x_d` is given to robots. Its true derivatives are locals: a robot has to estimate them.
    """

    x_c = Input(3, unit=POSITION, components=CHANNELS, description="position of the centre")
    dx_c = Input(3, unit=VELOCITY, components=CHANNELS, description="first derivative of x_c")
    ddx_c = Input(3, unit=ACCELERATION, components=CHANNELS, description="second derivative of x_c")
    angle = Parameter(unit="rad", default="2*pi*i/N", description="the robot's place on the circle")
    radius = Parameter(unit="m", default=1.8, description="radius of the circle")
    place = CalculatedParameter(2, unit="m", description="the robot's place relative to the centre")
    x_d = Output(3, unit=POSITION, components=CHANNELS, description="position reference")
    dx_d = Local(3, unit=VELOCITY, components=CHANNELS, description="true first derivative of x_d")
    ddx_d = Local(3, unit=ACCELERATION, components=CHANNELS, description="true second derivative of x_d")

    def calculate(angle, radius, place):
        place[0] = radius * math.cos(angle)
        place[1] = radius * math.sin(angle)

    def outputs(x_c, place, x_d):
        x_d[0] = place[0] + x_c[0]
        x_d[1] = place[1] + x_c[1]
        x_d[2] = x_c[2]

    def outputs_derivatives(dx_c, ddx_c, dx_d, ddx_d):
        for q in range(3):
            dx_d[q] = dx_c[q]
            ddx_d[q] = ddx_c[q]
