"""Artificial potential field: the force that keeps robots from touching, (9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cosim import Block, Input, Output, Parameter, rule
from cosim.blocks.agreement import radii_agree
from cosim.blocks.distance import planar_distance

if TYPE_CHECKING:
    from cosim.wiring.conditions import Source


def repulsion(distance: float, lower: float, outer: float, alpha: float) -> float:
    """The size of f_ij, (9): minus the derivative of Phi (8) in (lower, outer], 0 elsewhere. Distances in m."""
    if not lower < distance <= outer:
        return 0.0
    clearance = distance - lower
    return alpha * (outer - distance) / (clearance * clearance)


def outer_boundary_in_range(epsilon_2: float, radii: NDArray, neighbours: Source | None) -> tuple[bool, str]:
    """Whether every pair talks before its potential begins, Definition 2, where the topology has a range."""
    if neighbours is None or "R_c" not in neighbours.parameters:
        return True, "the topology has no range"
    largest = np.sort(radii)[-2:].sum()
    outer, reach = float(epsilon_2 * largest), float(neighbours.parameters["R_c"])
    return outer <= reach, f"the largest outer radius is {outer:.4g} m, R_c = {reach:.4g} m"


class PotentialField(Block):
    """Artificial potential field over the neighbours of the graph, (8) and (9).

    ::

        x          ──►┌───────┐──► F            F_i = [sum over neighbours j of f_ij, 0]
        neighbours ──►└───────┘──► unsafe

        f_ij = alpha (outer - ||z_ij||) / (||z_ij|| - lower)^2  z_ij / ||z_ij||     for ||z_ij|| in (lower, outer]

    where lower = epsilon_1 (R_i + R_j) is the minimal safe distance, and outer = epsilon_2 (R_i + R_j). At the minimal
    safe distance the potential is infinite; below it the formula gives no force at all, which is reported as `unsafe`.
    """

    x = Input("robots", "n", description="positions; the first two channels are planar")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    radii = Parameter("robots", unit="m", description="radius R_i of each robot")
    alpha = Parameter(unit="m2/s2", default=2.0, description="strength of the potential; 0: none")
    epsilon_1 = Parameter(unit="1", default=1.1, description="minimal safe distance over R_i + R_j")
    epsilon_2 = Parameter(unit="1", default=2.0, description="outer boundary over R_i + R_j")
    F = Output("robots", "n", description="repulsive force on each robot (an acceleration); none on its heading")
    unsafe = Output(
        "robots",
        dtype=bool,
        unit="1",
        description="whether a neighbour is not farther than the minimal safe distance",
        event="a neighbour is nearer than the minimal safe distance, where (9) gives no force",
    )

    positive = rule("radii > 0 and alpha >= 0", "eq. 8")(lambda radii, alpha: min(radii) > 0.0 and alpha >= 0.0)
    same = rule("radii as the plant has them, if x is a plant's", "Definition 2")(radii_agree)
    margin = rule("epsilon_1 > 1", "Definition 2")(lambda epsilon_1: epsilon_1 > 1.0)
    order = rule("epsilon_2 > epsilon_1", "Definition 2")(lambda epsilon_2, epsilon_1: epsilon_2 > epsilon_1)
    outer = rule("an outer boundary epsilon_2 (R_i + R_j) of at most R_c", "Definition 2")(outer_boundary_in_range)

    def outputs(x, neighbours, radii, alpha, epsilon_1, epsilon_2, F, unsafe):
        for i in range(x.shape[0]):
            unsafe[i] = False
            for q in range(x.shape[1]):
                F[i, q] = 0.0
            for k in range(neighbours.shape[1]):
                j = neighbours[i, k]
                if j < 0:
                    break
                both = radii[i] + radii[j]
                distance = planar_distance(x, i, j)
                if distance <= epsilon_1 * both:
                    unsafe[i] = True
                    continue
                force = repulsion(distance, epsilon_1 * both, epsilon_2 * both, alpha)
                F[i, 0] += force * (x[i, 0] - x[j, 0]) / distance
                F[i, 1] += force * (x[i, 1] - x[j, 1]) / distance
