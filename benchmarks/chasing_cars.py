"""Five cars that chase each other, of the falsification benchmarks of ARCH-COMP, as blocks.

Hu, Lygeros, Sastry, Towards a theory of stochastic hybrid systems, HSCC 2000, as the Simulink model `cars.mdl` of
ARCH-COMP has it: positions fall as the cars drive, and a car that keeps its distance rolls back.
"""

from cosim import Block, Indicator, Input, State


class LeadingCar(Block):
    """The first car, which a driver drives: v' = -throttle - brake v."""

    throttle = Input(unit="1")
    brake = Input(unit="1")
    y = State(unit="1", output=True, description="position")
    v = State(unit="1", description="velocity")

    def derivatives(throttle, brake, v, d_y, d_v):
        d_y[0] = v
        d_v[0] = -throttle - brake * v


class ChasingCar(Block):
    """A car that chases the one ahead from a distance of 15 on, or of 20 after it braked at 5, until it is at 10."""

    ahead = Input(unit="1", description="position of the car ahead")
    y = State(unit="1", output=True, description="position")
    v = State(unit="1", description="speed")
    mode = State(unit="1", dtype="int64", start=0, description="keeping (0), chasing (1), braking (2)")
    at_5 = Indicator(unit="1", crossing="falling")
    at_10 = Indicator(unit="1", crossing="falling")
    at_15 = Indicator(unit="1", crossing="rising")
    at_20 = Indicator(unit="1", crossing="rising")

    def derivatives(v, mode, d_y, d_v):
        d_y[0] = v if mode == 0 else -v
        d_v[0] = 0.0 if mode == 0 else 1.0 if mode == 1 else -v

    def indicators(y, ahead, at_5, at_10, at_15, at_20):
        at_5[0] = y - ahead - 5.0
        at_10[0] = y - ahead - 10.0
        at_15[0] = y - ahead - 15.0
        at_20[0] = y - ahead - 20.0

    def event(mode, at_5, at_10, at_15, at_20, next_mode):
        if (mode == 0 and at_15 > 0) or (mode == 2 and at_20 > 0):
            next_mode[0] = 1
        elif mode == 1 and at_10 < 0:
            next_mode[0] = 0
        elif mode == 0 and at_5 < 0:
            next_mode[0] = 2
