"""What a robot's model does not know."""

import math

from cosim.authoring.block import Block
from cosim.authoring.variables import Input, Output, Parameter
from cosim.blocks.reference import POSITION


class Uncertainty(Block):
    """The uncertain acceleration w_i of robot i at x = [p_x, p_y, theta], Section IV.

    ::

        x ─► w       w_1 = 0.5 sin(p_x) + tanh(p_x) + 0.6 sin(0.6 t + i pi/5)
                     w_2 = 0.3 sin(p_y) - 1.4 exp(-|p_y| - 1) + 0.8 sin(0.4 t + i pi/5)
                     w_3 = 0.2 cos(theta) + sin(0.5 t + i pi/5)

    times `amplitude`, which is 1 in the paper.
    """

    x = Input(3, unit=POSITION, description="position and heading")
    number = Parameter(unit="1", default="i", description="the robot's number i")
    amplitude = Parameter(unit="1", default=1.0, description="how many times the paper's uncertainty")
    w = Output(3, unit=("m/s2", "m/s2", "rad/s2"), description="uncertainty")

    def outputs(time, x, number, amplitude, w):
        phase = number * math.pi / 5.0
        w[0] = amplitude * (0.5 * math.sin(x[0]) + math.tanh(x[0]) + 0.6 * math.sin(0.6 * time + phase))
        nearby = 1.4 * math.exp(-abs(x[1]) - 1.0)
        w[1] = amplitude * (0.3 * math.sin(x[1]) - nearby + 0.8 * math.sin(0.4 * time + phase))
        w[2] = amplitude * (0.2 * math.cos(x[2]) + math.sin(0.5 * time + phase))
