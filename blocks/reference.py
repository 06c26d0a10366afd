"""Where each robot of a formation should be."""

import math

from cosim.block import Block, CalculatedParameter, Local, Output, Parameter

POSITION = ("m", "m", "rad")


class CircularFormationReference(Block):
    """A robot's place on a circle whose centre moves along a sine wave, (43).

    ::

        x_d = [radius cos(angle) + speed t,  radius sin(angle) + amplitude sin(frequency t),  0]

    Only `x_d` is given to anybody. Its true derivatives are locals: a robot has to estimate them.
    """

    angle = Parameter(unit="rad", default="2*pi*i/N", description="the robot's place on the circle")
    radius = Parameter(unit="m", default=1.8, description="radius of the circle")
    speed = Parameter(unit="m/s", default=0.2, description="speed of the centre along the first axis")
    amplitude = Parameter(unit="m", default=1.0, description="amplitude of the centre along the second axis")
    frequency = Parameter(unit="rad/s", default=0.3, description="angular frequency of the centre's sine wave")
    place = CalculatedParameter(2, unit="m", description="the robot's place relative to the centre")
    x_d = Output(3, unit=POSITION, description="position reference")
    dx_d = Local(3, unit=("m/s", "m/s", "rad/s"), description="true first derivative of x_d")
    ddx_d = Local(3, unit=("m/s2", "m/s2", "rad/s2"), description="true second derivative of x_d")

    def calculate(angle, radius, place):
        place[0] = radius * math.cos(angle)
        place[1] = radius * math.sin(angle)

    def outputs(time, place, speed, amplitude, frequency, x_d, dx_d, ddx_d):
        phase = frequency * time
        sine, cosine = math.sin(phase), math.cos(phase)
        x_d[0] = place[0] + speed * time
        x_d[1] = place[1] + amplitude * sine
        x_d[2] = 0.0
        dx_d[0] = speed
        dx_d[1] = amplitude * frequency * cosine
        dx_d[2] = 0.0
        ddx_d[0] = 0.0
        ddx_d[1] = -amplitude * frequency * frequency * sine
        ddx_d[2] = 0.0
