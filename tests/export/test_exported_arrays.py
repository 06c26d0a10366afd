"""Blocks of matrices and of random numbers: compiled, interpreted and as their own FMUs the same trajectory."""

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu

OWN = """
import numpy as np
from cosim import Block, Input, Output, Parameter, Seed, State, Stream, random


def gain(P, H, R):
    return np.linalg.solve(H @ P @ H.T + R, H @ P).T


class Robot(Block):
    x = State(4, output=True, start=[1.0, 0.0, 0.0, 0.5])
    u = Input(2)

    def derivatives(x, u, d_x):
        d_x[:2] = x[2:]
        d_x[2:] = u - 0.5 * x[2:]


class Centre(Block):
    x = Input("robots", 4)
    u = Output("robots", 2)

    def outputs(x, u):
        apart = x - np.mean(x, axis=0)
        u[:] = -apart[:, :2] - 0.3 * apart[:, 2:]


class Kalman(Block):
    "of x+ = F x + w, y = H x + v, with its own measurements"

    F = Parameter(2, 2, default=[[1.0, 0.1], [-0.1, 0.98]])
    H = Parameter(1, 2, default=[[1.0, 0.0]])
    Q = Parameter(2, 2, default=[[0.01, 0.0], [0.0, 0.02]])
    R = Parameter(1, 1, default=[[0.04]])
    seed = Seed()
    stream = Stream()
    x = State(2, start=[1.0, 0.0])
    x_hat = State(2, output=True)
    P = State(2, 2, output=True, start=[[1.0, 0.0], [0.0, 1.0]])

    def start(seed, stream):
        random.begin(stream, seed)

    def update(F, H, Q, R, x, x_hat, P, next_stream, next_x, next_x_hat, next_P):
        w = np.array([random.normal(next_stream), random.normal(next_stream)]) * np.sqrt(np.diag(Q))
        y = H @ x + np.sqrt(R[0]) * random.normal(next_stream)
        K = gain(P, H, R)
        x_new = x_hat + K @ (y - H @ x_hat)
        P_new = (np.eye(2) - K @ H) @ P
        next_x[:] = F @ x + w
        next_x_hat[:] = F @ x_new
        next_P[:] = F @ P_new @ F.T + Q
"""
DIAGRAM = """
run: {stop: 1, step: 0.01, integrator: rk4}
fleets: {robot: 3}
blocks:
  robot: {python: own.py:Robot, per: robot, inputs: {u: centre.u}, start: {x: ["0.1*i", i, 0, 1]}}
  centre: {python: own.py:Centre, inputs: {x: robot.x}}
  kalman: {python: own.py:Kalman, period: 0.05, parameters: {seed: 5}}
"""
SIGNALS = ("robot.x", "centre.u", "kalman.x_hat", "kalman.P")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arrays")
    (folder / "own.py").write_text(OWN)
    (folder / "d.yaml").write_text(DIAGRAM)
    return folder


@pytest.mark.parametrize(("version", "blocks"), [("2.0", ["kalman"]), ("3.0", ["centre", "kalman"])])
def test_own_fmus_and_both_engines_give_the_same_bits(folder, trajectories, version, blocks):
    network = run.load(folder / "d.yaml")
    compiled, interpreted = (trajectories(network, *SIGNALS, engine=engine) for engine in ("native", "python"))
    swaps = []
    for block in blocks:
        export_fmu(network, [block], folder / f"{block}{version}.fmu", fmi_version=version)
        swaps.append(f"{block}={folder / f'{block}{version}.fmu'}")
    foreign = trajectories(run.load(folder / "d.yaml", swaps=swaps), *SIGNALS)
    for name in SIGNALS:
        assert compiled[name].tobytes() == interpreted[name].tobytes() == foreign[name].tobytes(), name
    assert np.ptp(compiled["kalman.x_hat"]) > 0.5
    P = compiled["kalman.P"][-1].reshape(2, 2)
    F, H, Q, R = np.array([[1.0, 0.1], [-0.1, 0.98]]), np.array([[1.0, 0.0]]), np.diag([0.01, 0.02]), 0.04
    wanted = np.eye(2)
    for _ in range(20):  # the covariance form of the filter, whose steps are others
        wanted = F @ (wanted - wanted @ H.T @ H @ wanted / (H @ wanted @ H.T + R)) @ F.T + Q
    np.testing.assert_allclose(P, wanted, rtol=1e-12)
