"""The system of diagrams/formation.yaml as one hand-written NumPy loop: whole-fleet arrays, no Python loop over robots.

The same equations, measures and metrics as `formation.c`, in matrix form where that is the quicker way to write NumPy
for six robots: dense adjacency, `cbrt`, all exponentials of the network at once.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, field

import numpy as np

N, STEP = 6, 1.0e-3
MASS = np.array([4.8, 5.5, 4.5, 5.8, 5.3, 5.0])
RADIUS = np.array([0.24, 0.30, 0.23, 0.31, 0.28, 0.25])
INERTIA = np.array([0.15, 0.25, 0.12, 0.29, 0.21, 0.15])
STATIC = np.zeros((N, N))
STATIC[np.arange(N), [3, 2, 0, 4, 5, 1]] = 1.0
SUM_OF_RADII = RADIUS[:, None] + RADIUS
PAIRS = np.triu_indices(N, 1)
NUMBERS = np.arange(1, N + 1)
PHASE = NUMBERS * np.pi / 5
PLACE = 1.8 * np.stack([np.cos(2 * np.pi * NUMBERS / N), np.sin(2 * np.pi * NUMBERS / N), np.zeros(N)], axis=1)
WHEELS = np.array([np.pi / 2, np.pi / 2 + 2 * np.pi / 3, np.pi / 2 - 2 * np.pi / 3])
CENTRES = np.arange(-2.0, 6.0)
GAMMA_1 = np.array([1.0, 5, 50, 200, 10000])
GAMMA_2 = np.array([0.05, 0.25, 5, 20, 100])
LOWER = np.array([1.0, 0.1, 0.01, 0.001])  # where the bands begin
K_1 = 6 * 0.03**0.25
K_2 = 8 * 0.03 ** (1 / 3) * K_1 ** (2 / 3)
K_3 = 8 * 0.03**0.5 * K_2**0.5
K_4 = 6 * 0.03


def start() -> np.ndarray:
    """Positions and headings at time zero (N, 3)."""
    p = np.pi
    rows = [[1.8, 0.1, 0], [-0.9, 0.6, p / 3], [-0.7, 2.3, -p / 3], [0.8, -0.5, p / 2], [-0.1, -1.3, p / 4]]
    return np.array([*rows, [1.5, 1.5, -p / 4]])


@dataclass
class Figures:
    """The metrics of the diagram."""

    N_x: float = 0.0
    N_v: float = 0.0
    N_w: float = 0.0
    delta_x: float = 0.0
    e_x: float = 0.0
    S: float = 0.0
    min_gap: float = np.inf
    collided: set[tuple[int, int]] = field(default_factory=set)


def sum_of_norms(error: np.ndarray) -> float:
    """The sum of the rows' Euclidean norms."""
    return np.sqrt((error * error).sum(axis=1)).sum()


def run(steps: int) -> tuple[float, Figures]:
    """Simulate so many steps; returns (seconds of the loop, metrics)."""
    x, v = start(), np.zeros((N, 3))
    x_hat, v_hat, weights = x.copy(), np.zeros((N, 3)), np.zeros((N, 8, 3))
    xi_1, xi_2, xi_3, xi_4 = PLACE.copy(), np.zeros((N, 3)), np.zeros((N, 3)), np.zeros((N, 3))
    g = np.empty((N, 3, 3))
    g[:, 2, :] = (RADIUS / INERTIA)[:, None]
    g_inverse = np.empty((N, 3, 3))
    g_inverse[:, :, 2] = (INERTIA / (3 * RADIUS))[:, None]
    x_d, dx_d, w = PLACE.copy(), np.zeros((N, 3)), np.empty((N, 3))
    dx_d[:, 0] = 0.2
    force = np.zeros((N, 3))
    found = Figures()
    began = clock.perf_counter()
    for k in range(steps + 1):
        t = k * STEP
        # reference, (43)
        x_d[:, 0] = PLACE[:, 0] + 0.2 * t
        x_d[:, 1] = PLACE[:, 1] + np.sin(0.3 * t)
        dx_d[:, 1] = 0.3 * np.cos(0.3 * t)
        # control gain and uncertainty, (42)
        directions = x[:, 2, None] + WHEELS
        across, along = np.cos(directions), np.sin(directions)
        g[:, 0], g[:, 1] = across / MASS[:, None], along / MASS[:, None]
        g_inverse[:, :, 0], g_inverse[:, :, 1] = (2 / 3) * MASS[:, None] * across, (2 / 3) * MASS[:, None] * along
        w[:, 0] = 0.5 * np.sin(x[:, 0]) + np.tanh(x[:, 0]) + 0.6 * np.sin(0.6 * t + PHASE)
        w[:, 1] = 0.3 * np.sin(x[:, 1]) - 1.4 * np.exp(-np.abs(x[:, 1]) - 1) + 0.8 * np.sin(0.4 * t + PHASE)
        w[:, 2] = 0.2 * np.cos(x[:, 2]) + np.sin(0.5 * t + PHASE)
        # topology (5), (44), potential field (9)
        z = x[:, None, :2] - x[:, :2]
        distance = np.sqrt((z * z).sum(axis=2))
        np.fill_diagonal(distance, 1e9)  # nobody is near itself
        fading = np.where(distance <= 1.5, 0.2 / (1 + np.exp(np.minimum(14 * (distance - 1.1), 700))), 0.0)
        adjacency = np.where(STATIC == 1, 1.0, fading)
        clearance = distance - 1.1 * SUM_OF_RADII
        near = (adjacency > 0) & (clearance > 0) & (distance <= 2 * SUM_OF_RADII)
        if near.any():
            size = np.where(near, 2 * (2 * SUM_OF_RADII - distance) / (clearance * clearance) / distance, 0.0)
            force[:, :2] = (size[:, :, None] * z).sum(axis=1)
        else:
            force[:] = 0.0
        # observer, (10)
        e = x - x_hat
        s_2 = np.cbrt(e)
        s_1 = np.sign(e) * s_2 * s_2
        y = np.concatenate([x, v_hat], axis=1)
        phi = np.exp(-((y[:, :, None] - CENTRES) ** 2).sum(axis=1) / 64)
        w_hat = (phi[:, None, :] @ weights)[:, 0]
        # controller, (26), (30), (33)
        laplacian = np.diag(adjacency.sum(axis=1) + 2.0) - adjacency
        delta_x, delta_v = x - x_d, v_hat - xi_2
        e_x = laplacian @ delta_x
        s_hat = laplacian @ delta_v + 2 * e_x
        a = xi_3 - w_hat - 2 * delta_v - delta_x - 2 * s_hat + force
        u = (g_inverse @ a[:, :, None])[:, :, 0]
        # measures
        gaps = (distance - SUM_OF_RADII)[PAIRS]
        smallest = gaps.min()
        found.min_gap = min(found.min_gap, smallest)
        if smallest <= 0:
            found.collided |= {(int(PAIRS[0][p]), int(PAIRS[1][p])) for p in np.flatnonzero(gaps <= 0)}
        N_x, N_v, N_w = sum_of_norms(x - x_hat), sum_of_norms(v - v_hat), sum_of_norms(w - w_hat)
        S = np.linalg.norm(laplacian @ (v - dx_d) + 2 * e_x)
        norm_delta_x, norm_e_x = np.linalg.norm(delta_x), np.linalg.norm(e_x)
        if k >= 10000:
            found.delta_x, found.e_x = max(found.delta_x, norm_delta_x), max(found.e_x, norm_e_x)
            found.S = max(found.S, S)
            if k <= 20000:
                found.N_x, found.N_v, found.N_w = max(found.N_x, N_x), max(found.N_v, N_v), max(found.N_w, N_w)
        # derivatives and one Euler step
        gu = (g @ u[:, :, None])[:, :, 0]
        norm = np.sqrt((s_1 * s_1).sum(axis=1))
        band = (norm[:, None] < LOWER).sum(axis=1)
        d_weights = (GAMMA_1[band, None] * phi)[:, :, None] * s_1[:, None, :]
        d_weights -= (GAMMA_2[band] * norm)[:, None, None] * weights
        d_x_hat, d_v_hat = v_hat + 8 * s_1, w_hat + 8 * s_2 + gu
        e = xi_1 - x_d
        half, sign = np.sqrt(np.abs(e)), np.sign(e)
        quarter = np.sqrt(half)
        d_xi_1, d_xi_2 = xi_2 - K_1 * sign * half * quarter, xi_3 - K_2 * sign * half
        d_xi_3, d_xi_4 = xi_4 - K_3 * sign * quarter, -K_4 * sign
        x += STEP * v
        v += STEP * (gu + w)
        x_hat += STEP * d_x_hat
        v_hat += STEP * d_v_hat
        weights += STEP * d_weights
        xi_1 += STEP * d_xi_1
        xi_2 += STEP * d_xi_2
        xi_3 += STEP * d_xi_3
        xi_4 += STEP * d_xi_4
    return clock.perf_counter() - began, found


if __name__ == "__main__":
    seconds, figures = run(30000)
    print(f"{seconds / 30000 * 1e6:.1f} microseconds a step\n{figures}")
