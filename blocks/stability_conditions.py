"""The conditions of Theorems 1, 2 and 3, Definition 2 and Remark 5, on a diagram's own matrices and along its run.

Each returns (holds, numbers); None for "holds" means that nobody can say.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeGuard

import numpy as np
from numpy.typing import NDArray

from cosim import Course
from cosim.blocks.network_spectrum import NotJudged, lower_ends

if TYPE_CHECKING:
    from cosim.wiring.conditions import Source

Judged = tuple[bool | None, str]

#: The relative speed (m/s) of two robots that is assumed before a run, for a bound of dL_2/dt.
CLOSING_SPEED = 1.0

#: A neuron whose centre is one width away is active by this much, (7).
WITHIN_WIDTH = math.exp(-1.0)


# ---- Theorem 3: the network ------------------------------------------------------------------------------------


def formation_reached(neighbours: Source | None, b: NDArray, c: float) -> Judged:
    """c sigma(Q_1)/2 - sigma_max(P_1) L_M/sigma(L_1 + B) > 0 of Theorem 3, with an assumed L_M."""
    rate, how = assumed_rate(neighbours)
    if neighbours is None or rate is None:
        return None, how
    return _reached(neighbours, b, c, rate, how)


def topology_slow(neighbours: Source | None, b: NDArray, lambda_: NDArray) -> Judged:
    """sigma(Lambda) - L_M/sigma(L_1 + B) > 0 of Theorem 3, with an assumed L_M."""
    rate, how = assumed_rate(neighbours)
    if neighbours is None or rate is None:
        return None, how
    return _slow(neighbours, b, lambda_, rate, how)


def formation_reached_along(dL_2: Course, weights: Source | None, s_hat: Source | None) -> Judged:
    """The same of Theorem 3 along a run, with the largest ||dL_2/dt||, for the controller whose s_hat it is."""
    if not (_has_static_graph(weights) and _has_gains(s_hat)):
        return None, UNKNOWN_NETWORK
    return _reached(weights, s_hat.parameters["b"], float(s_hat.parameters["c"]), *_measured_rate(dL_2))


def topology_slow_along(dL_2: Course, weights: Source | None, s_hat: Source | None) -> Judged:
    """The same of Theorem 3 along a run, with the largest ||dL_2/dt||, for the controller whose s_hat it is."""
    if not (_has_static_graph(weights) and _has_gains(s_hat)):
        return None, UNKNOWN_NETWORK
    return _slow(weights, s_hat.parameters["b"], s_hat.parameters["lambda_"], *_measured_rate(dL_2))


UNKNOWN_NETWORK = "the static graph of the topology or the gains of the controller are not known"


def _reached(topology: Source, b: NDArray, c: float, rate: float, how: str) -> Judged:
    try:
        (p_least, p_most), q_1, sigma = lower_ends(topology.parameters["hears"], b)
    except NotJudged as reason:
        return reason.holds, str(reason)
    margin = c * q_1 / 2.0 - p_most * rate / sigma
    numbers = f"sigma(Q_1) = {q_1:.4g}, P_1 from {p_least:.4g} to {p_most:.4g}, sigma(L_1 + B) = {sigma:.4g}"
    admitted = c * q_1 / 2.0 * sigma / p_most
    return bool(margin > 0.0), f"{how}; admitted < {admitted:.4g} 1/s; left side {margin:.4g} 1/s; {numbers}"


def _slow(topology: Source, b: NDArray, lambda_: NDArray, rate: float, how: str) -> Judged:
    try:
        sigma = lower_ends(topology.parameters["hears"], b).sigma
    except NotJudged as reason:
        return reason.holds, str(reason)
    smallest = float(min(lambda_))
    margin = smallest - rate / sigma
    numbers = f"sigma(Lambda) = {smallest:.4g}, sigma(L_1 + B) = {sigma:.4g}"
    return bool(margin > 0.0), f"{how}; admitted < {smallest * sigma:.4g} 1/s; left side {margin:.4g} 1/s; {numbers}"


def _measured_rate(dL_2: Course) -> tuple[float, str]:
    return dL_2.largest, f"L_M = {dL_2.largest:.4g} 1/s, largest ||dL_2/dt||, at t = {dL_2.largest_at:.4g} s"


def assumed_rate(neighbours: Source | None) -> tuple[float | None, str]:
    """(L_M, how it was found): a bound of ||dL_2/dt||_F (1/s); None where nothing is known of the topology.

    |f'| is at most eta_1 eta_2 / 4. A pair whose distance changes at a rate r changes two elements of A_2 and two of
    D_2 by at most |f'| r each. Assumption 3 demands no more than that a bound exists; how fast and how many robots
    come near each other is the run's own affair. So the bound is that of one pair at CLOSING_SPEED, and what the
    conditions admit at most is told beside it: while a run exceeds that, the theorem does not speak of it.
    """
    if not _has_static_graph(neighbours):
        return None, "the static graph of the topology is not known"
    if neighbours.block == "StaticTopology":
        return 0.0, "L_M = 0 1/s, as the topology is static"
    if not {"eta_1", "eta_2"} <= set(neighbours.parameters):
        return None, "how the topology changes with distance is not known"
    slope = float(neighbours.parameters["eta_1"] * neighbours.parameters["eta_2"]) / 4.0
    bound = 2.0 * slope * CLOSING_SPEED
    pair = f"one pair closing at {CLOSING_SPEED:.4g} m/s, max |f'| = {slope:.4g} 1/m"
    return bound, f"L_M = {bound:.4g} 1/s is assumed ({pair}), TopologyRate measures it"


def _has_static_graph(neighbours: Source | None) -> TypeGuard[Source]:
    return neighbours is not None and "hears" in neighbours.parameters


def _has_gains(s_hat: Source | None) -> TypeGuard[Source]:
    return s_hat is not None and {"b", "c", "lambda_"} <= set(s_hat.parameters)


# ---- Definition 2: the potential and the references ------------------------------------------------------------


def references_apart(x_d: Source | None, F: Source | None) -> Judged:
    """outer < ||x_d_i - x_d_j|| of Definition 2 for every pair, for references on one circle."""
    if not (_is_on_circle(x_d) and _has_outer_boundary(F)):
        return None, "the references or the field are of another kind: nothing is known of their distances"
    centre = x_d.inputs.get("x_c")
    if centre is not None and centre.members > 1:
        return None, "every reference has a centre of its own"
    outer = float(F.parameters["epsilon_2"]) * F.parameters["radii"]
    if len(outer) < 2:
        return True, "a single robot"
    i, j, distance = _tightest_pair(_places(x_d, len(outer)), outer)
    boundary = outer[i] + outer[j]
    numbers = f"robots {i + 1} and {j + 1}: references {distance:.4g} m apart, outer boundary {boundary:.4g} m"
    return bool(distance > boundary), numbers


def _is_on_circle(x_d: Source | None) -> TypeGuard[Source]:
    return x_d is not None and {"angle", "radius"} <= set(x_d.parameters)


def _has_outer_boundary(F: Source | None) -> TypeGuard[Source]:
    return F is not None and {"radii", "epsilon_2"} <= set(F.parameters)


def _places(x_d: Source, robots: int) -> NDArray:
    """Where the references stand around their centre (m), (robots, 2)."""
    angle, radius = (np.resize(x_d.parameters[name], robots) for name in ("angle", "radius"))
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))


def _tightest_pair(places: NDArray, outer: NDArray) -> tuple[int, int, float]:
    """The pair i < j with the least ||places_i - places_j|| - outer_i - outer_j, and that distance (m)."""
    least, found = math.inf, (0, 0, math.inf)
    for i in range(len(places) - 1):
        distances = np.hypot(*(places[i + 1 :] - places[i]).T)
        slack = distances - outer[i + 1 :]
        j = int(np.argmin(slack))
        if slack[j] - outer[i] < least:
            least, found = slack[j] - outer[i], (i, i + 1 + j, float(distances[j]))
    return found


# ---- Remark 5: where the network feels -------------------------------------------------------------------------


def network_covers_reference(x_d: Source | None, v_hat: Source | None, stop: float) -> Judged:
    """Whether y = [x_d; dx_d/dt] stays within one width of a centre until the run's end, for references (43)."""
    if v_hat is None or not {"centres", "width"} <= set(v_hat.parameters):
        return None, "the observer has no neural network whose width is known"
    if not _is_on_circle(x_d):
        return None, "where the references go is not known"
    centre = x_d.inputs.get("x_c")
    if centre is None or not {"speed", "amplitude", "frequency"} <= set(centre.parameters):
        return None, "where the references' centre goes is not known"
    names = ("speed", "amplitude", "frequency")
    robots = max(x_d.members, centre.members)
    path = np.array([np.resize(centre.parameters[name], robots) for name in names]).T
    width = np.resize(v_hat.parameters["width"], robots)
    centres = np.resize(v_hat.parameters["centres"], (robots, v_hat.parameters["centres"].shape[-1]))
    times = np.linspace(0.0, stop, _samples(path[:, 2].max(), stop))
    worst, numbers = 0.0, ""
    for i, place in enumerate(_places(x_d, robots)):
        away = _away_from_centres(_visited(place, path[i], times), centres[i])
        at = int(np.argmax(away))
        if away[at] / width[i] > worst:
            worst = away[at] / width[i]
            numbers = (
                f"robot {i + 1}: y is {away[at]:.4g} from every centre at t = {times[at]:.4g} s, width {width[i]:.4g}"
            )
            if worst > 1.0:
                numbers += f", and beyond it from t = {times[np.argmax(away > width[i])]:.4g} s; enlarge `width`"
    return bool(worst <= 1.0), numbers


def network_covers_run(coverage: Course) -> Judged:
    """Whether y = [x; v_hat] stayed within one width of a centre, Remark 5: some neuron was active by 1/e or more."""
    numbers = f"the most active neuron fell to {coverage.smallest:.3g} at t = {coverage.smallest_at:.4g} s"
    holds = coverage.smallest >= WITHIN_WIDTH
    return holds, numbers if holds else f"{numbers}, below 1/e: enlarge `width`"


def _samples(frequency: float, stop: float) -> int:
    """How many times are looked at: twenty a period of the path (rad/s), within bounds."""
    return int(min(max(20.0 * abs(frequency) * stop / (2.0 * math.pi), 1000.0), 100_000.0)) + 1


def _visited(place: NDArray, path: NDArray, times: NDArray) -> NDArray:
    """y = [x_d; dx_d/dt] of (43) at these times, (6, times), along a path of (speed, amplitude, frequency)."""
    speed, amplitude, frequency = path
    y, phase = np.zeros((6, times.size)), frequency * times
    y[0], y[1] = place[0] + speed * times, place[1] + amplitude * np.sin(phase)
    y[3], y[4] = speed, amplitude * frequency * np.cos(phase)
    return y


def _away_from_centres(y: NDArray, centres: NDArray) -> NDArray:
    """How far y (2n, times) is from the nearest d_j = centre_j [1, …, 1]."""
    nearest = np.min(np.abs(y.mean(axis=0) - centres[:, np.newaxis]), axis=0)
    return np.sqrt(((y - y.mean(axis=0)) ** 2).sum(axis=0) + len(y) * nearest**2)


# ---- Theorems 1 and 2: the observer ----------------------------------------------------------------------------


def observer_stable(alpha_1: float, alpha_2: float, beta_1: float) -> Judged:
    """A is Hurwitz, and so has a P_2 > 0, Lemma 4."""
    p, _ = lyapunov_matrix(alpha_1, alpha_2, beta_1)
    poles = np.roots([1.0, alpha_1 * beta_1, alpha_2 * beta_1])
    smallest = float(np.linalg.eigvalsh(p)[0])
    numbers = f"beta_1 = {beta_1:.4g}, beta_2 = {2 * beta_1 - 1:.4g}, eigenvalues of A: {_listed(poles)}, {_p_2(p)}"
    return bool(poles.real.max() < 0.0 and smallest > 0.0), f"{numbers}, sigma(P_2) = {smallest:.4g}"


def observer_region(
    alpha_1: float,
    alpha_2: float,
    beta_1: float,
    gamma_1: NDArray,
    gamma_2: NDArray,
    c_v: float,
    centres: NDArray,
    width: float,
    n: int,
) -> Judged:
    """K < 10^(c_v - j) for every band j but the last, and K < 10^(c_v - n_v + 1) for that, (23).

    K is the root that follows from (16) and stands in the proof of Theorem 2. It contains bounds that nobody knows: of
    the optimal weights, W_M, and of the network's bias, epsilon_M. With both assumed 0 it is a lower bound of K: a band
    that fails fails for certain; where none does, nobody can say. The theorem is sufficient only; its K comes from
    worst cases and is far above the errors that a run shows.
    """
    p, smallest_q = lyapunov_matrix(alpha_1, alpha_2, beta_1)
    bands = len(gamma_1)
    phi_max = largest_activation(centres, width, n)
    texts, holds = [], True
    for j in range(1, bands + 1):
        rate, forgetting = float(gamma_1[j - 1]), float(gamma_2[j - 1])
        k_2 = phi_max * math.hypot(p[0, 1] + rate, p[1, 1])
        ultimate = power(k_2 * k_2 / (2.0 * forgetting * smallest_q), 1.0 / (2.0 - 1.0 / beta_1))
        limit = power(10.0, c_v - j if j < bands else c_v - bands + 1)
        below = ultimate < limit or math.isinf(limit)
        holds = holds and below
        texts.append(f"{ultimate:.3g} {'<' if below else '>='} {limit:.3g}")
    numbers = f"{_p_2(p)}, phi_M = {phi_max:.4g}, W_M = 0 and epsilon_M = 0 are assumed"
    return None if holds else False, f"{numbers}; K, at least, band by band: {'; '.join(texts)}"


def power(base: float, exponent: float) -> float:
    """base ** exponent, infinite where that is too large for a number."""
    try:
        return float(base) ** float(exponent)
    except OverflowError:
        return math.inf


def lyapunov_matrix(alpha_1: float, alpha_2: float, beta_1: float) -> tuple[NDArray, float]:
    """(P_2, smallest eigenvalue of Q_2) of Lemma 4 for one channel, with Q_2 = I: A^T P_2 + P_2 A = -Q_2."""
    off = -1.0 / (2.0 * beta_1)
    first = (0.5 - alpha_2 * off) / (alpha_1 * beta_1)
    last = beta_1 * (first - alpha_1 * off) / alpha_2
    return np.array([[first, off], [off, last]]), 1.0


def largest_activation(centres: NDArray, width: float, n: int) -> float:
    """phi_M of (16), the largest ||phi(y)||: it is reached where all 2n elements of y are equal."""
    middle = np.linspace(centres.min(), centres.max(), 1001)[:, np.newaxis]
    phi = np.exp(-2 * n * (middle - centres) ** 2 / width**2)
    return float(np.sqrt((phi**2).sum(axis=1).max()))


def _p_2(p: NDArray) -> str:
    return f"P_2 = [{p[0, 0]:.4g} {p[0, 1]:.4g}; {p[1, 0]:.4g} {p[1, 1]:.4g}] ⊗ I for Q_2 = I"


def _listed(values: NDArray) -> str:
    return ", ".join(f"{value:.4g}" for value in np.real_if_close(values))
