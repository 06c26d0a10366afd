"""The gaps of chosen pairs of robots, Fig. 6."""

import numpy as np
from numpy.typing import NDArray

from cosim import Input, Measure, Output, Parameter, rule
from cosim.blocks.distance import planar_distance


def pairs_are_robots(pairs: NDArray, robots: int) -> tuple[bool, str]:
    """Whether each pair names two different robots."""
    wrong = [pair for pair in pairs.tolist() if pair[0] == pair[1] or not all(1 <= i <= robots for i in pair)]
    return not wrong, f"wrong: {wrong}"


class PairGaps(Measure):
    """The gap ||z_ij|| - R_i - R_j of each listed pair of robots, Section IV and Fig. 6; 0 is a collision.

    With radii of 0 it is the distance of the centres.
    """

    x = Input("robots", "n", description="positions; the first two channels are planar")
    radii = Parameter("robots", unit="m", description="radius R_i of each robot")
    pairs = Parameter("listed", 2, dtype=np.int32, unit="1", description="pairs of robots' numbers, from 1")
    gaps = Output("listed", unit="m", description="gap of each pair")

    positive = rule("radii >= 0")(lambda radii: min(radii) >= 0.0)
    numbers = rule("pairs of two different robots")(pairs_are_robots)

    def outputs(x, radii, pairs, gaps):
        for k in range(gaps.size):
            i, j = pairs[k, 0] - 1, pairs[k, 1] - 1
            gaps[k] = planar_distance(x, i, j) - radii[i] - radii[j]
