"""Model predictive control of a linear system whose inputs are limited."""

import math

import numpy as np
from numpy.typing import NDArray

from cosim import Block, CalculatedParameter, Dimension, Input, Local, Output, Parameter, State, condition, rule
from cosim.blocks.estimation_control import is_covariance
from cosim.blocks.nonlinear import clamp

POWER_STEPS = 100


def slope(
    A: NDArray,
    B: NDArray,
    Q: NDArray,
    R: NDArray,
    x: NDArray,
    x_ref: NDArray,
    plan: NDArray,
    work: NDArray,
    result: NDArray,
) -> None:
    """The gradient of the cost after the inputs of a plan (horizon, m). work: (2, horizon, n)."""
    horizon, states, inputs = plan.shape[0], work.shape[2], plan.shape[1]
    for k in range(horizon):
        for i in range(states):
            total = 0.0
            for j in range(states):
                total += A[i, j] * (work[0, k - 1, j] if k > 0 else x[j])
            for j in range(inputs):
                total += B[i, j] * plan[k, j]
            work[0, k, i] = total
    for back in range(horizon):
        k = horizon - 1 - back
        for i in range(states):  # the costate
            total = 0.0
            for j in range(states):
                total += 2.0 * Q[i, j] * (work[0, k, j] - x_ref[j])
                if k < horizon - 1:
                    total += A[j, i] * work[1, k + 1, j]
            work[1, k, i] = total
        for j in range(inputs):
            result[k, j] = 0.0
            for i in range(states):
                result[k, j] += B[i, j] * work[1, k, i]
            for i in range(inputs):
                result[k, j] += 2.0 * R[j, i] * plan[k, i]


def clamp_all(plan: NDArray, lower: NDArray, upper: NDArray, result: NDArray) -> None:
    """A plan (horizon, m) with its inputs within their limits (m)."""
    for k in range(plan.shape[0]):
        for j in range(plan.shape[1]):
            result[k, j] = clamp(plan[k, j], lower[j], upper[j])


def mapped(plan: NDArray, gradient: NDArray, steepest: float, lower: NDArray, upper: NDArray) -> float:
    """How far a plan (horizon, m) goes in a step down the cost's gradient: the length of the gradient mapping."""
    total = 0.0
    for k in range(plan.shape[0]):
        for j in range(plan.shape[1]):
            moved = clamp(plan[k, j] - gradient[k, j] / steepest, lower[j], upper[j]) - plan[k, j]
            total += moved * moved
    return math.sqrt(total)


class LinearMPC(Block):
    """Model predictive control of a sampled linear system with limited inputs, by a fast gradient method; sampled.

    ::

        u[k] = first of the plan u_0 … u_N-1 with the least sum of
               (x_j+1 - x_ref)^T Q (x_j+1 - x_ref) + u_j^T R u_j,   lower <= u_j <= upper
        x_j+1 = A x_j + B u_j,   x_0 = x[k],   N the horizon

    Nesterov's method from the last plan, a fixed number of iterations: Richter, Jones and Morari, IEEE Transactions on
    Automatic Control 57 (2012) 1391–1403. `residual` is how far the last iteration still moved the plan, and `error`
    how far the plan may be from the best one: twice the length of the gradient mapping over the least curvature of the
    cost, which is R's at least (Nesterov, Introductory Lectures on Convex Optimization, 2004, theorem 2.2.7).
    """

    horizon = Dimension(default=10, description="how many samples it looks ahead")

    x = Input("n", description="states")
    x_ref = Input("n", start=0.0, description="where they are to be")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    Q = Parameter("n", "n", description="weights of the states")
    R = Parameter("m", "m", default=1.0, description="weights of the inputs")
    lower = Parameter("m", default=-math.inf, description="lower limits of the inputs")
    upper = Parameter("m", default=math.inf, description="upper limits of the inputs")
    iterations = Parameter(dtype=np.int32, unit="1", default=100, description="how many there are at each sample")
    zero = CalculatedParameter("n", description="no state")
    first = CalculatedParameter(2, "horizon", "m", description="work space")
    path = CalculatedParameter(2, "horizon", "n", description="work space")
    steepest = CalculatedParameter(description="largest eigenvalue of the cost's second derivative")
    weakest = CalculatedParameter(description="no more than R's smallest eigenvalue, by Gershgorin's circles")
    plan = State("horizon", "m", description="plan, shifted by a sample")
    ahead = Local("horizon", "m", description="work space: where the gradient is taken")
    gradient = Local("horizon", "m", description="work space")
    work = Local(2, "horizon", "n", description="work space")
    found = Output("horizon", "m", description="plan")
    residual = Output(description="largest change of the plan in the last iteration")
    error = Output(
        finite=False, description="bound of the distance from the best plan; infinite where R bounds nothing"
    )
    u = Output("m?", description="inputs of the system")

    ordered = rule("lower < upper")(lambda lower, upper: bool(np.all(np.less(lower, upper))))
    weights = rule("Q is symmetric, with no negative eigenvalue")(is_covariance)
    costs = rule("R is symmetric, with no negative eigenvalue")(lambda R: bool(is_covariance(R)))
    positive = rule("iterations >= 1")(lambda iterations: iterations >= 1)

    @condition("the plan is within a hundredth of its largest input")
    def settled(error, found):
        largest = max(-found.smallest, found.largest)
        if error.largest == math.inf:
            return None, "R has no eigenvalue that is known to be above zero"
        return error.largest <= 0.01 * largest, f"{error.largest:.3g} of {largest:.3g}; take more iterations"

    def calculate(A, B, Q, R, zero, first, path, steepest, weakest):
        for i in range(zero.size):
            zero[i] = 0.0
        weakest[0] = max(0.0, np.min(2.0 * np.diag(R) - np.sum(np.abs(R), axis=1)))
        for k in range(first.shape[1]):
            for j in range(first.shape[2]):
                first[0, k, j] = 1.0 + 0.1 * k + 0.37 * j
        steepest[0] = 0.0
        for _ in range(POWER_STEPS):
            slope(A, B, Q, R, zero, zero, first[0], path, first[1])
            largest = 0.0
            for k in range(first.shape[1]):
                for j in range(first.shape[2]):
                    largest += first[1, k, j] * first[1, k, j]
            steepest[0] = 1.02 * math.sqrt(largest)
            for k in range(first.shape[1]):
                for j in range(first.shape[2]):
                    first[0, k, j] = first[1, k, j] / math.sqrt(largest)

    def outputs(
        x,
        x_ref,
        A,
        B,
        Q,
        R,
        lower,
        upper,
        iterations,
        steepest,
        weakest,
        plan,
        ahead,
        gradient,
        work,
        found,
        residual,
        error,
        u,
    ):
        momentum = 1.0
        clamp_all(plan, lower, upper, found)
        clamp_all(plan, lower, upper, ahead)
        for _ in range(iterations):
            slope(A, B, Q, R, x, x_ref, ahead, work, gradient)
            grown = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * momentum * momentum))
            residual[0] = 0.0
            for k in range(plan.shape[0]):
                for j in range(plan.shape[1]):
                    new = clamp(ahead[k, j] - gradient[k, j] / steepest, lower[j], upper[j])
                    change = new - found[k, j]
                    residual[0] = max(residual[0], abs(change))
                    ahead[k, j] = new + (momentum - 1.0) / grown * change
                    found[k, j] = new
            momentum = grown
        slope(A, B, Q, R, x, x_ref, found, work, gradient)
        moved = mapped(found, gradient, steepest, lower, upper)
        error[0] = steepest * moved / weakest if weakest > 0.0 else math.inf
        u[:] = found[0]

    def update(found, next_plan):
        last = found.shape[0] - 1
        for k in range(found.shape[0]):
            for j in range(found.shape[1]):
                next_plan[k, j] = found[min(k + 1, last), j]
