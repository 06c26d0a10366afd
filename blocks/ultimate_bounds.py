"""What Theorem 3 promises for the errors that the observers have."""

import math

import numpy as np

from cosim import CalculatedParameter, Input, Measure, Output, Parameter, rule
from cosim.blocks.agreement import agrees
from cosim.blocks.network_spectrum import network_extremes


class UltimateBounds(Measure, compiled=False):
    """The ultimate bounds (40) and (41), with what the observers' errors and the topology are at each instant.

    ::

        (40)  ||S||, ||e_x|| <= K_6 / min(K_2, K_5),   ||delta_x|| <= that / sigma(L_1 + B)
              K_1 = sigma_max(L_1 + B) + ||L_2||,     a bound of sigma_max(L + B)
              K_2 = c sigma(Q_1)/2 - sigma_max(P_1) ||dL_2/dt|| / sigma(L_1 + B)
              K_3 = sigma_max(P_1) ||L_2|| + sigma_max(Q_1)/2
              K_4 = sigma_max(P_1) K_1 (sigma_max(Lambda) + c K_1)
              K_5 = sigma(P_1) (sigma(Lambda) - ||dL_2/dt|| / sigma(L_1 + B))
              K_6 = K_3 (w_error + ||F||) + K_4 v_error,                                          (39)

        (41)  ||S||, ||e_x|| <= sigma_max(Q_1) (w_error + (c sigma_max(L_1 + B) + sigma_max(Lambda)) v_error)
                                / min(c sigma(Q_1), 2 sigma(Q_1) sigma(Lambda))    where L_2 = 0 and F = 0

    Infinite where the theorem gives no bound. The largest value over a window bounds what the errors come down to, if
    all of the window's errors last. (41) is as printed; with sigma(P_1) for the second sigma(Q_1) it would be (40) for
    L_2 = 0. Written for plain Python, as its constants need linear algebra.
    """

    v = Input("robots", "n", description="true velocities")
    v_hat = Input("robots", "n", description="estimated velocities")
    w = Input("robots", "n", description="true uncertainties")
    w_hat = Input("robots", "n", description="estimated uncertainties")
    F = Input("robots", "n", description="repulsive forces")
    L_2 = Input(unit="1", description="||L_2||")
    dL_2 = Input(unit="1/s", description="||dL_2/dt||")
    neighbours = Input("robots", "capacity", only="neighbours", dtype=np.int32, unit="1", description="of the topology")
    s_hat = Input("robots", "n", only="s_hat", description="of the controller with these gains")
    hears = Parameter("robots", "heard", dtype=np.int32, unit="1", description="whom each robot hears in G1; 0: nobody")
    c = Parameter(unit="1/s", default=2.0, description="gain of the sliding variable")
    lambda_ = Parameter("robots", unit="1/s", default=2.0, description="slope of each robot's sliding variable")
    b = Parameter("robots", unit="1", default=2.0, description="weight of each robot's own reference")
    p = CalculatedParameter(2, unit="1", description="smallest and largest eigenvalue of P_1")
    q = CalculatedParameter(2, unit="1", description="smallest and largest eigenvalue of Q_1")
    sigma = CalculatedParameter(2, unit="1", description="smallest and largest singular value of L_1 + B")
    w_error = Output(description="||w_hat - w||")
    v_error = Output(description="||v_hat - v||")
    S_40 = Output(finite=False, description="bound (40) of ||S|| and of ||e_x||")
    delta_x_40 = Output(finite=False, description="bound (40) of ||delta_x||")
    S_41 = Output(finite=False, description="bound (41) of ||S|| and of ||e_x||")
    delta_x_41 = Output(finite=False, description="bound (41) of ||delta_x||")

    graph = rule("hears as the topology has it", "Lemma 2")(lambda neighbours, hears: agrees(neighbours, hears=hears))
    gains = rule("c, lambda_ and b as the controller has them", "Theorem 3")(
        lambda s_hat, c, lambda_, b: agrees(s_hat, c=c, lambda_=lambda_, b=b)
    )

    def calculate(hears, b, p, q, sigma):
        p[:], q[:], sigma[:] = network_extremes(hears, b)

    def outputs(
        v, v_hat, w, w_hat, F, L_2, dL_2, c, lambda_, p, q, sigma, w_error, v_error, S_40, delta_x_40, S_41, delta_x_41
    ):
        slowest, fastest = float(lambda_.min()), float(lambda_.max())
        force = float(np.linalg.norm(F))
        w_error[0] = np.linalg.norm(w_hat - w)
        v_error[0] = np.linalg.norm(v_hat - v)
        k_1 = sigma[1] + L_2
        k_2 = c * q[0] / 2.0 - p[1] * dL_2 / sigma[0]
        k_3 = p[1] * L_2 + q[1] / 2.0
        k_4 = p[1] * k_1 * (fastest + c * k_1)
        k_5 = p[0] * (slowest - dL_2 / sigma[0])
        k_6 = k_3 * (w_error[0] + force) + k_4 * v_error[0]
        slope = min(k_2, k_5)
        S_40[0] = k_6 / slope if slope > 0.0 else math.inf
        alone = L_2 == 0.0 and force == 0.0
        k_7 = q[1] * (w_error[0] + (c * sigma[1] + fastest) * v_error[0])
        S_41[0] = k_7 / min(c * q[0], 2.0 * q[0] * slowest) if alone else math.inf
        delta_x_40[0] = S_40[0] / sigma[0]
        delta_x_41[0] = S_41[0] / sigma[0]
