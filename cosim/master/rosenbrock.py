"""An inner step of a Rosenbrock method, see `cosim.integrators`. One source, two engines, as in `loop.py`.

    J, f_t by differences where the step begins
    the factors of 1/(h γ) - J
    stage by stage: the increment u_i, a solution of linear equations

Systems of states that do not depend on each other, such as the members of a fleet, are differentiated and solved side
by side.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.integrators import HEAD, NODE
from cosim.machine.memory import reals_at, words_at
from cosim.machine.stages import move, weigh
from cosim.master.linear import factor, substitute
from cosim.master.rows import differentiate
from cosim.master.tables import (
    ALIVE,
    BEGIN,
    BEGUN,
    IMPLICIT,
    OK,
    SLOPES,
    STAGES,
    STATES,
    SUM,
    SYSTEM_SIZE,
    SYSTEM_VECTORS,
    SYSTEM_WORK,
    SYSTEMS,
    SYSTEMS_WORDS,
    TABLEAU,
    TIMED,
    TOLERANCES,
    WARNING,
    D,
    part,
    slope_of,
    stage_of,
)

EPSILON = 2.0**-52
DIFFERENCE = 2.0**-26  # over a state's size
INSIGNIFICANT = 2.0**-10  # of what is tolerated of a state: far above rounding errors where it is zero, and no matter
#: Vectors in the work space: f and its derivative to time where the step begins, a right-hand side, exchanged rows.
F, F_T, RIGHT, PIVOTS = range(SYSTEM_VECTORS)


def linearize(c: Any, base: int, b: Any, time: float, h: float) -> int:
    """J and f_t at a time (s) and the states in BEGUN, whose derivatives are in D, for a step h. Returns the status."""
    e = systems_of(base, b)
    d, f = part(c, base, b, D), vector(base, e, F)
    for j in range(f.size):
        f[j] = d[j]
    for column in range(e[SYSTEM_SIZE]):
        status = differentiate_column(c, base, b, time, column)
        if status > WARNING:
            return status
    if e[TIMED] == 0:
        return OK
    later = time + math.sqrt(EPSILON * h * max(abs(time), h))  # between what h resolves and what the time does
    status = differentiate(c, base, b, later)
    f_t = vector(base, e, F_T)
    for j in range(f.size):
        f_t[j] = (d[j] - f[j]) / (later - time)
    return status


def differentiate_column(c: Any, base: int, b: Any, time: float, column: int) -> int:
    """One column of the Jacobian of every system. Returns the status."""
    e = systems_of(base, b)
    n, states = e[SYSTEM_SIZE], states_of(base, b, e)
    x, w, d, f = part(c, base, b, BEGUN), stage_of(c, base, b), part(c, base, b, D), vector(base, e, F)
    tolerances = reals_at(base + b[TOLERANCES], 2)
    for s in range(e[SYSTEMS]):
        j = states[s * n + column]
        tolerated = tolerances[0] * abs(x[j]) + tolerances[1]
        change = max(DIFFERENCE * abs(x[j]), INSIGNIFICANT * tolerated)
        w[j] = x[j] + (change if x[j] >= 0.0 else -change)
    status = differentiate(c, base, b, time)
    for s in range(e[SYSTEMS]):
        jacobian, j = reals_at(matrix_at(base, e, s, 0), n * n), states[s * n + column]
        change = w[j] - x[j]
        for i in range(n):
            jacobian[i * n + column] = (d[states[s * n + i]] - f[states[s * n + i]]) / change
        w[j] = x[j]
    return status


def factorize(c: Any, base: int, b: Any, h: float) -> bool:
    """The factors of 1/(h γ) - J. Returns whether all systems can be solved."""
    e = systems_of(base, b)
    n = e[SYSTEM_SIZE]
    diagonal = 1.0 / (h * reals_at(base + b[TABLEAU], 1)[0])
    for s in range(e[SYSTEMS]):
        jacobian, at = reals_at(matrix_at(base, e, s, 0), n * n), matrix_at(base, e, s, 1)
        matrix = reals_at(at, n * n)
        for i in range(n * n):
            matrix[i] = -jacobian[i]
        for i in range(n):
            matrix[i * n + i] += diagonal
        if factor(c[ALIVE : ALIVE + 1], at, pivots_of(base, e, s), n, 0.0) == 0.0:
            return False
    return True


def rosenbrock_step(c: Any, base: int, b: Any, time: float, h: float) -> int:
    """From the states in BEGUN, where it is linearized, to the states of the stage; SUM has the error.

    Both are no number where the equations cannot be solved. Returns the status.
    """
    e, stages, stride = systems_of(base, b), b[STAGES], c[STATES] * 8
    x, w, d, total = part(c, base, b, BEGUN), stage_of(c, base, b), part(c, base, b, D), part(c, base, b, SUM)
    f, f_t, slopes = vector(base, e, F), vector(base, e, F_T), base + c[SLOPES] + b[BEGIN] * 8
    if not factorize(c, base, b, h):
        for j in range(w.size):
            w[j] = total[j] = math.nan
        return OK
    for stage in range(stages):
        states, chain = row_of(base, b, 2 * stage), row_of(base, b, 2 * stage + 1)
        u = slope_of(c, base, b, stage)
        if stage == 0:
            for j in range(u.size):
                u[j] = f[j]
        else:
            move(w, x, 1.0, states, slopes, stride, total)
            status = differentiate(c, base, b, time + states[NODE] * h)
            if status > WARNING:
                return status
            weigh(total, chain, slopes, stride)
            for j in range(u.size):
                u[j] = d[j] + total[j] / h
        if chain[NODE] != 0.0 and e[TIMED] != 0:
            for j in range(u.size):
                u[j] += chain[NODE] * h * f_t[j]
        solve(base, b, u)
    for j in range(w.size):
        w[j] += u[j]
        total[j] = u[j]
    return OK


def solve(base: int, b: Any, u: Any) -> None:
    """Solve for a right-hand side in the order of the bank, in place."""
    e = systems_of(base, b)
    n, states, right = e[SYSTEM_SIZE], states_of(base, b, e), vector(base, e, RIGHT)
    for s in range(e[SYSTEMS]):
        for i in range(n):
            right[i] = u[states[s * n + i]]
        substitute(matrix_at(base, e, s, 1), pivots_of(base, e, s), right, n)
        for i in range(n):
            u[states[s * n + i]] = right[i]


# ---- memory ----


def slope_at_begin(base: int, b: Any) -> Any:
    """The derivatives where the step begins."""
    return vector(base, systems_of(base, b), F)


def row_of(base: int, b: Any, number: int) -> Any:
    """A row of the bank's tableau, which begins with γ."""
    words = HEAD + b[STAGES]
    return reals_at(base + b[TABLEAU] + 8 + number * words * 8, words)


def systems_of(base: int, b: Any) -> Any:
    """What the bank's equations are."""
    return words_at(base + b[IMPLICIT], SYSTEMS_WORDS)


def states_of(base: int, b: Any, e: Any) -> Any:
    """Which states of the bank they are, system by system."""
    return words_at(base + b[IMPLICIT] + SYSTEMS_WORDS * 8, e[SYSTEMS] * e[SYSTEM_SIZE])


def vector(base: int, e: Any, number: int) -> Any:
    """One of the vectors over all states."""
    size = e[SYSTEMS] * e[SYSTEM_SIZE]
    return reals_at(base + e[SYSTEM_WORK] + number * size * 8, size)


def pivots_of(base: int, e: Any, s: int) -> Any:
    """Which rows of a system changed places."""
    size, n = e[SYSTEMS] * e[SYSTEM_SIZE], e[SYSTEM_SIZE]
    return words_at(base + e[SYSTEM_WORK] + (PIVOTS * size + s * n) * 8, n)


def matrix_at(base: int, e: Any, s: int, which: int) -> int:
    """The address of the Jacobian of a system (0), or of its factors (1)."""
    size, n = e[SYSTEMS] * e[SYSTEM_SIZE], e[SYSTEM_SIZE]
    at: int = base + e[SYSTEM_WORK] + (SYSTEM_VECTORS * size + (which * size + s * n) * n) * 8
    return at
