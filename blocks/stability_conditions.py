"""The conditions of the paper's theorems, evaluated on a diagram's own matrices; each returns (holds, numbers)."""

import math

import numpy as np

#: Up to so many robots, dense linear algebra is faster than sparse.
DENSE = 300

#: The relative speed (m/s) of two robots for which Theorem 3's bound of dL_2/dt is evaluated.
CLOSING_SPEED = 1.0


# ---- Theorem 3: the network ------------------------------------------------------------------------------------


def formation_reached(neighbours, b, c):
    """c sigma(Q_1)/2 - sigma_max(P_1) L_M/sigma(L_1 + B) > 0 of Theorem 3."""
    if not _has_static_graph(neighbours):
        return True, "the topology has no static graph"
    p, q_1, sigma = network_matrices(neighbours.parameters["hears"], b)
    bound, how = rate_bound(neighbours)
    margin = c * q_1 / 2.0 - p.max() * bound / sigma
    numbers = f"sigma(Q_1) = {q_1:.4g}, P_1 from {p.min():.4g} to {p.max():.4g}, sigma(L_1 + B) = {sigma:.4g}"
    admitted = c * q_1 / 2.0 * sigma / p.max()
    return margin > 0.0, f"{numbers}; {how}; left side {margin:.4g} 1/s; admits L_M < {admitted:.4g} 1/s"


def topology_slow(neighbours, b, lambda_):
    """sigma(Lambda) - L_M/sigma(L_1 + B) > 0 of Theorem 3."""
    if not _has_static_graph(neighbours):
        return True, "the topology has no static graph"
    _, _, sigma = network_matrices(neighbours.parameters["hears"], b)
    bound, how = rate_bound(neighbours)
    margin = float(min(lambda_)) - bound / sigma
    numbers = f"sigma(Lambda) = {min(lambda_):.4g}, sigma(L_1 + B) = {sigma:.4g}"
    return margin > 0.0, f"{numbers}; {how}; left side {margin:.4g} 1/s; admits L_M < {min(lambda_) * sigma:.4g} 1/s"


def network_matrices(hears, b):
    """(diagonal of P_1, smallest eigenvalue of Q_1, smallest singular value of L_1 + B), Lemma 2.

    The proof of Theorem 3 uses sigma(L_1 + B) as the inverse of a bound of ||(L_1 + B)^-1||, hence the singular value.
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import spsolve

    heard = [(i, j - 1) for i, row in enumerate(hears.tolist()) for j in row if j != 0]
    rows, columns = np.array(heard, int).reshape(-1, 2).T
    robots = len(hears)
    adjacency = csc_array((np.ones(len(heard)), (rows, columns)), shape=(robots, robots))
    pinned = csc_array(diags_array(adjacency.sum(axis=1) + b) - adjacency)
    p = 1.0 / np.atleast_1d(spsolve(pinned, np.ones(robots)))
    weighted = csc_array(diags_array(p) @ pinned)
    return p, _smallest_eigenvalue(weighted + weighted.T), math.sqrt(max(0.0, _smallest_eigenvalue(pinned.T @ pinned)))


def rate_bound(neighbours):
    """(L_M, how it was found): a bound of ||dL_2/dt||_F (1/s).

    |f'| is at most eta_1 eta_2 / 4. A pair whose distance changes at a rate r changes two elements of A_2 and two of
    D_2 by at most |f'| r each. Assumption 3 demands no more than that a bound exists; how fast and how many robots
    come near each other is the run's own affair. So the bound is that of one pair at CLOSING_SPEED, and what the
    conditions admit at most is told beside it: while a run exceeds that, the theorem does not speak of it.
    """
    if "eta_1" not in neighbours.parameters:
        return 0.0, "L_M = 0 1/s, as the topology is static"
    slope = float(neighbours.parameters["eta_1"] * neighbours.parameters["eta_2"]) / 4.0
    bound = 2.0 * slope * CLOSING_SPEED
    return bound, f"L_M = {bound:.4g} 1/s for a pair closing at {CLOSING_SPEED:.4g} m/s, max |f'| = {slope:.4g} 1/m"


def _has_static_graph(neighbours):
    return neighbours is not None and "hears" in neighbours.parameters


def _smallest_eigenvalue(symmetric):
    if symmetric.shape[0] <= DENSE:
        return float(np.linalg.eigvalsh(symmetric.toarray())[0])
    from scipy.sparse.linalg import eigsh

    start = np.ones(symmetric.shape[0])
    return float(eigsh(symmetric, k=1, sigma=0.0, tol=1e-6, v0=start, return_eigenvectors=False)[0])


# ---- Definition 2: the potential and the references ------------------------------------------------------------


def references_apart(x_d, F):
    """outer < ||x_d_i - x_d_j|| of Definition 2, for references on one circle."""
    circle = x_d is not None and {"angle", "radius"} <= set(x_d.parameters)
    if not circle or F is None or not {"radii", "epsilon_2"} <= set(F.parameters):
        return True, "not determined by these blocks' parameters"
    radii = F.parameters["radii"]
    angle = np.resize(x_d.parameters["angle"], len(radii))
    places = np.resize(x_d.parameters["radius"], len(radii)) * np.exp(1j * angle)
    from scipy.spatial import KDTree

    points = np.column_stack((places.real, places.imag))
    distances, nearest = KDTree(points).query(points, k=2)
    slack = distances[:, 1] - F.parameters["epsilon_2"] * (radii + radii[nearest[:, 1]])
    i = int(np.argmin(slack))
    j = int(nearest[i, 1])
    outer = float(F.parameters["epsilon_2"] * (radii[i] + radii[j]))
    numbers = f"robots {i + 1} and {j + 1}: references {distances[i, 1]:.4g} m apart, outer boundary {outer:.4g} m"
    return bool(slack[i] > 0.0), numbers


# ---- Theorems 1 and 2: the observer ----------------------------------------------------------------------------


def observer_stable(alpha_1, alpha_2, beta_1):
    """A is Hurwitz, and so has a P_2 > 0, Lemma 4."""
    p, _ = lyapunov_matrix(alpha_1, alpha_2, beta_1)
    poles = np.roots([1.0, alpha_1 * beta_1, alpha_2 * beta_1])
    smallest = float(np.linalg.eigvalsh(p)[0])
    numbers = f"beta_1 = {beta_1:.4g}, beta_2 = {2 * beta_1 - 1:.4g}, eigenvalues of A: {_listed(poles)}, {_p_2(p)}"
    return bool(poles.real.max() < 0.0 and smallest > 0.0), f"{numbers}, sigma(P_2) = {smallest:.4g}"


def observer_region(alpha_1, alpha_2, beta_1, gamma_1, gamma_2, c_v, centres, width, n):
    """K < 10^(c_v - j) for every band j but the last, and K < 10^(c_v - n_v + 1) for that, (23).

    K is the root that follows from (16) and stands in the proof of Theorem 2. It contains bounds that nobody knows: of
    the optimal weights, W_M, and of the network's bias, epsilon_M. With both 0 it is a lower bound of K: a band that
    fails fails for certain, one that holds may still fail. The theorem is sufficient only; its K comes from worst
    cases and is far above the errors that a run shows.
    """
    p, smallest_q = lyapunov_matrix(alpha_1, alpha_2, beta_1)
    bands = len(gamma_1)
    phi_max = largest_activation(centres, width, n)
    texts, holds = [], True
    for j in range(1, bands + 1):
        rate, forgetting = float(gamma_1[j - 1]), float(gamma_2[j - 1])
        k_2 = phi_max * math.hypot(p[0, 1] + rate, p[1, 1])
        ultimate = (k_2 * k_2 / (2.0 * forgetting * smallest_q)) ** (1.0 / (2.0 - 1.0 / beta_1))
        limit = 10.0 ** (c_v - j if j < bands else c_v - bands + 1)
        holds = holds and ultimate < limit
        texts.append(f"{ultimate:.3g} {'<' if ultimate < limit else '>='} {limit:.3g}")
    return holds, f"{_p_2(p)}, phi_M = {phi_max:.4g}; K, at least, band by band: {'; '.join(texts)}"


def lyapunov_matrix(alpha_1, alpha_2, beta_1):
    """(P_2, smallest eigenvalue of Q_2) of Lemma 4 for one channel, with Q_2 = I: A^T P_2 + P_2 A = -Q_2."""
    from scipy.linalg import solve_continuous_lyapunov

    a = np.array([[-alpha_1 * beta_1, beta_1], [-alpha_2, 0.0]])
    return solve_continuous_lyapunov(a.T, -np.eye(2)), 1.0


def largest_activation(centres, width, n):
    """phi_M, the largest ||phi(y)||: it is reached where all 2n elements of y are equal."""
    middle = np.linspace(centres.min(), centres.max(), 1001)[:, np.newaxis]
    phi = np.exp(-2 * n * (middle - centres) ** 2 / width**2)
    return float(np.sqrt((phi**2).sum(axis=1).max()))


def _p_2(p):
    return f"P_2 = [{p[0, 0]:.4g} {p[0, 1]:.4g}; {p[1, 0]:.4g} {p[1, 1]:.4g}] ⊗ I for Q_2 = I"


def _listed(values):
    return ", ".join(f"{value:.4g}" for value in np.real_if_close(values))
