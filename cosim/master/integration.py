"""Takes a bank of states over one communication step: in equal inner steps, or in such as its tolerance allows.

    x, d ← the states and their derivatives at the begin
    until the end is reached:
        h ← the next inner step, or so much of it as is left
        x', error ← an inner step of the integrator from x
        the next inner step ← h (0.9 / error)^(1/p) within limits      (error: the largest over what is tolerated)
        where error ≤ 1: x ← x', d ← its derivatives

After Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.4, which has the first step's size too.
What is kept from one communication step to the next lies in the state segment. One source, two engines: see `loop.py`.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import call, power, reals_at, words_at
from cosim.master.linear import HUGE
from cosim.master.rosenbrock import linearize, rosenbrock_step, slope_at_begin
from cosim.master.rows import differentiate, operate
from cosim.master.runge_kutta import runge_kutta_step
from cosim.master.tables import (
    ALIVE,
    BANK_WORDS,
    BANKS,
    BEGIN,
    BEGUN,
    CONTROL_WORDS,
    CONTROLLED,
    ELEMENT,
    ESTIMATED,
    FIRST_BEGIN,
    FIRST_END,
    HANDS_ON,
    IMPLICIT,
    IN_PLACE,
    INNER_BEGIN,
    INNER_END,
    INNER_STEPS,
    MEMORY,
    MEMORY_WORDS,
    NEXT_STEP,
    OK,
    REACHED,
    REJECTED,
    SOLVER,
    STAGES,
    STALLED,
    SUM,
    TAKEN,
    TOLERANCES,
    WARNING,
    D,
    X,
    part,
    slope_of,
    stage_of,
)

MOST_STEPS = 1_000_000  # in one communication step
SAFETY, LEAST, MOST = 0.9, 0.2, 5.0  # of a step's size over the one before
SMALLEST = 2.0**-48  # of a step over the time, of which 2**-52 can be told apart
STRETCHED = 1.01  # by so much a step may be longer than planned, to be the last one


def integrate(c: Any, base: int, bank: int, begun: float, step: float) -> int:
    """Integrate one bank over one communication step with its own integrator. Returns the status."""
    b = words_at(c[BANKS] + bank * BANK_WORDS * 8, BANK_WORDS)
    if c[SOLVER] != 0:
        reals_at(base + b[MEMORY], MEMORY_WORDS)[NEXT_STEP] = step
        return call(c[SOLVER], begun, base, base + b[MEMORY])
    if b[CONTROLLED] != 0:
        return integrate_within_tolerance(c, base, b, begun, step)
    inner_steps = b[INNER_STEPS]
    x, w, d = part(c, base, b, X), stage_of(c, base, b), part(c, base, b, D)
    h = step / inner_steps
    for s in range(inner_steps):
        time = begun + s * h
        c[ALIVE] += 1
        status = begin(c, base, b, time, h, s == 0)
        if status > WARNING:
            return status
        if b[STAGES] > 1:
            status = attempt(c, base, b, time, h)
            if status > WARNING:
                return status
        elif s > 0 or b[IN_PLACE] != 0:
            for j in range(w.size):  # vectorised where the loop below would find that its arrays overlap
                w[j] += h * d[j]
        else:
            for j in range(w.size):
                w[j] = x[j] + h * d[j]
    return OK


def derive(time: float, base: int, control: int) -> int:
    """The derivatives D of the states X of all blocks, as one system, at a time (s). Returns the status."""
    c = words_at(control, CONTROL_WORDS)
    c[ALIVE] += 1
    return differentiate(c, base, words_at(c[BANKS], BANK_WORDS), time)


def begin(c: Any, base: int, b: Any, time: float, h: float, first: bool) -> int:
    """Begin an inner step from what is published, if it is the first one, else from the stage. Returns the status."""
    rows, last = (b[FIRST_BEGIN], b[FIRST_END]) if first else (b[INNER_BEGIN], b[INNER_END])
    status = operate(c, base, rows, last, time, time)
    if status > WARNING or b[STAGES] == 1:
        return status
    w, begun = stage_of(c, base, b), part(c, base, b, BEGUN)
    origin = part(c, base, b, X) if first else w
    for j in range(w.size):
        begun[j] = origin[j]
    if b[IMPLICIT] != 0:
        if first:
            for j in range(w.size):
                w[j] = begun[j]
        return linearize(c, base, b, time, h)
    d, slope = part(c, base, b, D), slope_of(c, base, b, 0)
    for j in range(w.size):
        slope[j] = d[j]
    return OK


def attempt(c: Any, base: int, b: Any, time: float, h: float) -> int:
    """An inner step of the bank's integrator, from BEGUN to the stage. Returns the status."""
    if b[IMPLICIT] != 0:
        return rosenbrock_step(c, base, b, time, h)
    return runge_kutta_step(c, base, b, time, h)


# ---- within a tolerance ----


def integrate_within_tolerance(c: Any, base: int, b: Any, begun: float, step: float) -> int:
    """Integrate over one communication step in inner steps whose estimated error is tolerated. Returns the status."""
    memory, counts = reals_at(base + b[MEMORY], MEMORY_WORDS), words_at(base + b[MEMORY], MEMORY_WORDS)
    done, rejected = 0.0, False
    status = begin(c, base, b, begun, step, True)
    if status <= WARNING and memory[NEXT_STEP] == 0.0:
        status = plan_first(c, base, b, begun, step)
    for _ in range(MOST_STEPS):
        if status > WARNING:
            return status
        time, planned, left = begun + done, memory[NEXT_STEP], step - done
        memory[REACHED] = time
        c[ALIVE] += 1
        h = fitted(planned, left)
        status = attempt(c, base, b, time, h)
        if status > WARNING:
            return status
        error = error_of(c, base, b)
        memory[NEXT_STEP] = following(b, h, planned, error, rejected)
        rejected = error > 1.0
        counts[REJECTED if rejected else TAKEN] += 1
        if not rejected and h == left:
            return OK
        if memory[NEXT_STEP] < SMALLEST * max(abs(time), SMALLEST * step):
            return STALLED
        if not rejected:
            done += h
            status = go_on(c, base, b, begun + done, memory[NEXT_STEP])
    return STALLED


def go_on(c: Any, base: int, b: Any, time: float, h: float) -> int:
    """Begin the next inner step where one has ended. Returns the status."""
    if b[HANDS_ON] == 0:
        return begin(c, base, b, time, h, False)
    w, begun = stage_of(c, base, b), part(c, base, b, BEGUN)
    first, last = slope_of(c, base, b, 0), slope_of(c, base, b, b[STAGES] - 1)
    for j in range(w.size):
        begun[j] = w[j]
        first[j] = last[j]
    return OK


def plan_first(c: Any, base: int, b: Any, time: float, step: float) -> int:
    """The size of the very first step, of which a little one of Euler's gives an idea. Returns the status."""
    memory = reals_at(base + b[MEMORY], MEMORY_WORDS)
    x, w, d = part(c, base, b, BEGUN), stage_of(c, base, b), part(c, base, b, D)
    f = slope_at_begin(base, b) if b[IMPLICIT] != 0 else slope_of(c, base, b, 0)
    size, speed = norm(base, b, x, x), norm(base, b, f, x)
    h = 0.01 * size / speed if size > 1e-5 and 1e-5 < speed * step < HUGE else 1e-6 * step
    h = min(h, step)
    for j in range(w.size):
        w[j] = x[j] + h * f[j]
    status = differentiate(c, base, b, time + h)
    for j in range(w.size):
        d[j] -= f[j]
    fastest = max(speed, norm(base, b, d, x) / h)
    wanted = power(0.01 / fastest, 1.0 / b[ESTIMATED]) if 1e-15 < fastest * step < HUGE else h
    memory[NEXT_STEP] = min(100.0 * h, wanted, step)
    return status


def fitted(planned: float, left: float) -> float:
    """A step as planned, unless it ends with what is left; two equal ones rather than one that is very short."""
    if left <= STRETCHED * planned:
        return left
    return min(planned, 0.5 * left)


def following(b: Any, h: float, planned: float, error: float, rejected: bool) -> float:
    """The next step (s) after one with an error; rejected: whether the one before was.

    One that was cut at a communication point, and was short enough, says nothing against what was planned.
    """
    if not error < HUGE:
        return LEAST * h
    change = min(MOST, max(LEAST, SAFETY * power(error, -1.0 / b[ESTIMATED]))) if error > 0.0 else MOST
    if rejected:
        change = min(change, 1.0)
    return max(change * h, planned) if change >= 1.0 else change * h


def error_of(c: Any, base: int, b: Any) -> float:
    """The largest error of a step over what is tolerated, HUGE for no number; ELEMENT is the offset of its state."""
    x, w, error = part(c, base, b, BEGUN), stage_of(c, base, b), part(c, base, b, SUM)
    tolerances = reals_at(base + b[TOLERANCES], 2)
    worst = 0.0
    for j in range(w.size):
        over = abs(error[j]) / (tolerances[1] + tolerances[0] * max(abs(x[j]), abs(w[j])))
        if not (over < HUGE and abs(w[j]) < HUGE):
            over = HUGE
        if over > worst:
            worst = over
            c[ELEMENT] = c[X] + (b[BEGIN] + j) * 8
    return worst


def norm(base: int, b: Any, values: Any, x: Any) -> float:
    """The largest of values over what is tolerated of the states x; HUGE for no number."""
    tolerances = reals_at(base + b[TOLERANCES], 2)
    worst = 0.0
    for j in range(x.size):
        over = abs(values[j]) / (tolerances[1] + tolerances[0] * abs(x[j]))
        worst = max(worst, over) if over < HUGE else HUGE
    return worst
