"""What a robot's model does not know: w_i of (2) and (42)."""

import math

from cosim import Block, Input, Output, Parameter
from cosim.blocks.channels import ACCELERATION, CHANNELS, POSITION


class Uncertainty(Block):
    """The uncertain acceleration w_i of robot i at x = [p_x, p_y, theta], Section IV.

    ::

        x ─► w       w_1 = 0.5 sin(p_x) + tanh(p_x) + 0.6 sin(0.6 t + i pi/5)
                     w_2 = 0.3 sin(p_y) - 1.4 exp(-|p_y| - 1) + 0.8 sin(0.4 t + i pi/5)
                     w_3 = 0.2 cos(theta) + sin(0.5 t + i pi/5)

    times `amplitude`, which is 1 in the paper.
    """

    x = Input(3, unit=POSITION, components=CHANNELS, description="position and heading")
    number = Parameter(unit="1", default="i", description="the robot's number i")
    amplitude = Parameter(unit="1", default=1.0, description="how many times the paper's uncertainty")
    w = Output(3, unit=ACCELERATION, components=CHANNELS, description="uncertainty")

    def outputs(time, x, number, amplitude, w):
        p_x, p_y, theta = x[0], x[1], x[2]
        phase = number * math.pi / 5.0
        w_1 = 0.5 * math.sin(p_x) + math.tanh(p_x) + 0.6 * math.sin(0.6 * time + phase)
        w_2 = 0.3 * math.sin(p_y) - 1.4 * math.exp(-abs(p_y) - 1.0) + 0.8 * math.sin(0.4 * time + phase)
        w_3 = 0.2 * math.cos(theta) + math.sin(0.5 * time + phase)
        w[0], w[1], w[2] = amplitude * w_1, amplitude * w_2, amplitude * w_3
