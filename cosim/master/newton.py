"""Algebraic loops: find z = f(z), where f is what the rows of a loop give. Newton's method, with differences.

    begin at what is published
    repeat until the residual r = f(z) - z is small against each unknown
        J = 1 - df/dz, column by column, by differences, of FMUs by their directional derivatives
        z + z' with J z' = r; where that leads astray, a part of z', and at last f(z)

What is found is told from what nothing determines: where other values would do as well, J is singular. The first time,
J is looked at where the loop is solved. Later, a guess that is right already is disturbed, and every unknown has to
answer; else J is looked at again. What a sampled block holds is no unknown between two samples.

Derivatives that FMUs give say where to go, and no more. Whether z is a solution, and the only one near by, f says: J is
made by differences alone for that, unless derivatives, later than the first time, have just led to where they said. So
a wrong one costs evaluations, but no figure. Where steps by derivatives have missed several times, differences go on.
Of an f that is rounded, as what an FMU iterates inside may be, derivatives know better what nothing determines. As they
may cost more than f, steps go on by the same ones as long as that is cheaper.

An unknown may be far smaller than what f adds up inside, as in cos(y/2 + 1.5708). Where steps no longer help, what f
gives near by tells what of it is noise, and as much is allowed.

Equations of different members of a fleet that do not depend on each other are solved side by side. Two engines.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import words_at
from cosim.master.convergence import (
    AS_TOLD,
    MOST_ITERATIONS,
    MOST_MISSES,
    TOLERANCE,
    all_answer,
    allow_rounding,
    are_numbers,
    is_near,
    is_small,
    measure,
    missed,
    pays,
    progress,
    take,
    worst_of,
)
from cosim.master.jacobian import (
    COARSE,
    DOUBT,
    FAR,
    NOISE,
    NONE,
    begin_sums,
    difference_at,
    fill_column,
    find_again,
    find_steps,
    zero_of,
)
from cosim.master.linear import HUGE
from cosim.master.listening import HEARINGS, differ, move_on, settle
from cosim.master.tables import (
    ALIVE,
    ALL_FIRST,
    ALONG,
    AS_EVER,
    AT,
    CLOCK_WORDS,
    CLOCKS,
    DUE,
    NO_SAMPLED,
    NOTED,
    OK,
    ROW_BYTES,
    ROW_WORDS,
    ROWS,
    TANGENT,
    UNSOLVED,
    WARNING,
    A,
    B,
    C,
    evaluate,
)
from cosim.master.unknowns import (
    BLOCKS,
    DERIVED,
    EQUATIONS,
    FUZZ,
    HELD,
    KEPT,
    MOVE,
    NO_ROW,
    NOMINAL,
    OTHER,
    PIECE_CLOCK,
    PIECE_NUMBERS,
    PIECES,
    ROUNDING,
    SIZE,
    TRIAL,
    F,
    R,
    Z,
    exchange,
    is_quiet,
    piece,
    unit,
    unknowns,
    usual_size,
    vector,
)

PATIENCE = 8  # so many steps are taken before f is listened to
REST = 2.0**-16  # of an unknown that a step takes away: what differences make of a zero
SMALLEST_PART = 2.0**-10  # of a step, that is tried where the whole leads astray
UNDETERMINED = -1.0  # in place of an error: other values would do as well
GO_ON = -1  # in place of a status: the last step was not the last


def solve(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Solve the loop of row o, as of a time (s); later: of rows that are done at the step's end. Returns the status."""
    c[TANGENT] = NOTED if unknowns(place(c, base, o))[DERIVED] != 0 else AS_EVER
    begin(c, base, o)
    status = iterate(c, base, o, time, later)
    c[TANGENT] = AS_EVER
    return status


def iterate(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Go from a guess to the solution. Returns the status."""
    u = unknowns(place(c, base, o))
    status = residual(c, base, o, time, later, F, R)
    first, difference, singular = row_of(c, o)[C] == ALL_FIRST, math.sqrt(unit(u)), DOUBT
    regular, heard, again, misses = False, False, False, 0 if u[DERIVED] != 0 else MOST_MISSES
    for iteration in range(MOST_ITERATIONS):
        status, small = look(c, base, o, time, later, status, iteration)
        if small and iteration == 0 and not first:
            status = disturb(c, base, o, time, later)
            regular = all_answer(base, u)
        if small and regular and is_quiet(base, u):
            return publish(c, base, o, status)
        if status <= WARNING and not are_numbers(base, u):
            status, again = fall_back(c, base, o, time, later), False
            continue
        along, side = misses < MOST_MISSES and not small, difference if iteration % 2 == 0 else -difference
        again = again and along and iteration < PATIENCE
        if again:
            singular = find_again(base, u, singular)
        elif status <= WARNING:
            status, singular = aim(c, base, o, time, later, side, along)
        if status > WARNING:
            return status
        regular = singular == NONE and u[DERIVED] == 0
        if not along and is_small(base, u, 1.0):
            status = conclude(c, base, o, time, later, singular, heard)
            if status != GO_ON:
                return status
            status = OK
            continue
        before = progress(base, u) if along else 0.0
        status = step_on(c, base, o, time, later)
        if along:
            left = progress(base, u)
            misses += missed(before, left, unit(u))
            heard = heard if again else singular == NONE and left <= AS_TOLD * before
            regular, again = heard and not first, pays(u[EQUATIONS], before, left, unit(u))
    return give_up(c, base, o, *worst_of(base, u))


def look(c: Any, base: int, o: int, time: float, later: float, status: int, iteration: int) -> tuple[int, bool]:
    """Whether residuals are small; where steps no longer help, beside the noise of f. Returns the status first."""
    u = unknowns(place(c, base, o))
    measure(base, u)
    if status <= WARNING and iteration >= PATIENCE and is_near(base, u) and not is_small(base, u, 1.0):
        status = listen(c, base, o, time, later, 8.0 ** (iteration - PATIENCE))
        measure(base, u)
    return status, status <= WARNING and is_small(base, u, 1.0)


def begin(c: Any, base: int, o: int) -> None:
    """Guess what is published, or 0 where that is no number; of rounding errors nothing is known yet."""
    u = unknowns(place(c, base, o))
    z, held = vector(base, u, Z), vector(base, u, HELD)
    rounding, other, fuzz = vector(base, u, ROUNDING), vector(base, u, OTHER), vector(base, u, FUZZ)
    exchange(base, place(c, base, o), z, False)
    note_held(c, base, o)
    for j in range(z.size):
        rounding[j] = other[j] = fuzz[j] = 0.0
        if held[j] == 0.0 and not abs(z[j]) < HUGE:
            z[j] = 0.0


def note_held(c: Any, base: int, o: int) -> None:
    """Note which unknowns nothing computes now, as what sampled blocks gave holds between two samples; usual sizes."""
    at, due = place(c, base, o), row_of(c, o)[C]
    u = unknowns(at)
    held, nominal, clocks = vector(base, u, HELD), vector(base, u, NOMINAL), base + c[CLOCKS] - CLOCK_WORDS * 8
    j = 0
    for _ in range(u[BLOCKS]):
        for p in range(u[PIECES]):
            own = piece(at, p)
            clock = own[PIECE_CLOCK]
            holds = clock == NO_ROW
            if clock > 0 and due != ALL_FIRST:
                holds = due == NO_SAMPLED or words_at(clocks + clock * CLOCK_WORDS * 8, CLOCK_WORDS)[DUE] == 0
            for _ in range(own[PIECE_NUMBERS]):
                held[j] = 1.0 if holds else 0.0
                nominal[j] = usual_size(at, p)
                j += 1


def conclude(c: Any, base: int, o: int, time: float, later: float, singular: int, heard: bool) -> int:
    """Take a last step, and publish z, of which a steep f makes more than it is. Returns the status, or GO_ON.

    singular: the first block that leaves its unknowns undetermined; -1 if none is known to. heard: whether derivatives
    have said already that they know of none.
    """
    u = unknowns(place(c, base, o))
    z, step = vector(base, u, Z), vector(base, u, MOVE)
    if singular == DOUBT:
        status, singular = aim(c, base, o, time, later, COARSE, False)
        if status > WARNING:
            return status
        for j in range(z.size):
            step[j] = 0.0
    if singular >= 0:
        return give_up(c, base, o, UNDETERMINED, singular)
    for j in range(z.size):
        z[j] += step[j]
    status = take(base, u, residual(c, base, o, time, later, TRIAL, R))
    if status <= WARNING and not is_small(base, u, 4.0):
        return GO_ON
    if status <= WARNING and u[DERIVED] != 0 and not heard:
        status = consult(c, base, o, time, later)
    return publish(c, base, o, status) if status <= WARNING else status


def publish(c: Any, base: int, o: int, status: int) -> int:
    """What has been found is what there is. Returns the status."""
    exchange(base, place(c, base, o), vector(base, unknowns(place(c, base, o)), Z), True)
    return status


def consult(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Give up where derivatives say that other values would do as well, and f does not deny it from afar.

    Near by, an f that is rounded says nothing. Else f is evaluated at z again. Returns the status.
    """
    u = unknowns(place(c, base, o))
    status, found = aim(c, base, o, time, later, math.sqrt(unit(u)), True)
    if status <= WARNING and found != NONE:
        status, found = aim(c, base, o, time, later, COARSE, True)
    if status <= WARNING and found >= 0:
        status = linearize(c, base, o, time, later, COARSE, False)
        found = find_steps(c[ALIVE : ALIVE + 1], base, u, FAR) if status <= WARNING else NONE
        if found >= 0:
            return give_up(c, base, o, UNDETERMINED, found)
    return residual(c, base, o, time, later, F, R) if status <= WARNING else status


def give_up(c: Any, base: int, o: int, error: float, b: int) -> int:
    """Leave the error, and of which block, for whoever asks why, and nothing that might pass for a figure."""
    u = unknowns(place(c, base, o))
    z, f, r, held = vector(base, u, Z), vector(base, u, F), vector(base, u, R), vector(base, u, HELD)
    for j in range(z.size):
        if held[j] == 0.0:
            z[j] = f[j] if math.isnan(f[j]) else math.nan  # which may tell that it has not been written
    exchange(base, place(c, base, o), z, True)
    f[0], r[0] = error, float(b)
    c[AT] = o
    return UNSOLVED


# ---- steps ----


def aim(c: Any, base: int, o: int, time: float, later: float, difference: float, along: bool) -> tuple[int, int]:
    """Solve for the step of each block, with matrices as of `linearize`. Returns the status; and as of `find_steps`."""
    u = unknowns(place(c, base, o))
    status = linearize(c, base, o, time, later, difference, along)
    if status > WARNING:
        return status, NONE
    return status, find_steps(c[ALIVE : ALIVE + 1], base, u, zero_of(base, u))


def linearize(c: Any, base: int, o: int, time: float, later: float, difference: float, along: bool) -> int:
    """The matrix of each block, relative to sizes, and what f adds up, with its rounding errors if it is evaluated.

    along: tangents, where foreign blocks know them. Returns the status.
    """
    u = unknowns(place(c, base, o))
    n, z, size = u[EQUATIONS], vector(base, u, Z), vector(base, u, SIZE)
    kept, held = vector(base, u, KEPT), vector(base, u, HELD)
    begin_sums(base, u, along)
    for column in range(n):
        for j in range(column, z.size, n) if held[column] == 0.0 else range(0):
            z[j] += difference_at(z[j], size[j], difference)
        usual, status = c[TANGENT], OK
        if held[column] == 0.0:
            c[TANGENT] = ALONG if along else usual
            status = residual(c, base, o, time, later, TRIAL, MOVE)
            c[TANGENT] = usual
        if status > WARNING:
            return status
        fill_column(base, u, column, NOISE * unit(u) / abs(difference), along)
        for j in range(column, z.size, n):
            z[j] = kept[j]
    if not along:
        allow_rounding(base, u)
    return OK


def step_on(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Take the step, or so much of it as makes the residual smaller, else go to f(z). Returns the status."""
    u = unknowns(place(c, base, o))
    z, step, kept = vector(base, u, Z), vector(base, u, MOVE), vector(base, u, KEPT)
    worst, part = progress(base, u), 1.0
    while part >= SMALLEST_PART:
        for j in range(z.size):
            z[j] = kept[j] + part * step[j]
            if part == 1.0 and abs(z[j]) < REST * abs(kept[j]):
                z[j] = 0.0
        status = residual(c, base, o, time, later, TRIAL, R)
        error = progress(base, u)
        if status > WARNING or error < worst or error <= max(TOLERANCE, unit(u)):
            return take(base, u, status)
        part *= 0.5
    for j in range(z.size):
        z[j] = kept[j]
    return fall_back(c, base, o, time, later)


def fall_back(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Go to f(z), where that is a number. Returns the status."""
    u = unknowns(place(c, base, o))
    z, f = vector(base, u, Z), vector(base, u, F)
    for j in range(z.size):
        if abs(f[j]) < HUGE:
            z[j] = f[j]
    return take(base, u, residual(c, base, o, time, later, TRIAL, R))


# ---- f ----


def row_of(c: Any, o: int) -> Any:
    """The row that solves a loop."""
    return words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)


def place(c: Any, base: int, o: int) -> int:
    """The address of what row o says of the unknowns."""
    at: int = base + row_of(c, o)[A]
    return at


def residual(c: Any, base: int, o: int, time: float, later: float, to: int, over: int) -> int:
    """f(z) and f(z) - z, to two vectors; the unknowns are then f(z). Returns the status."""
    u = unknowns(place(c, base, o))
    z, f, r, held = vector(base, u, Z), vector(base, u, to), vector(base, u, over), vector(base, u, HELD)
    c[ALIVE] += 1
    exchange(base, place(c, base, o), z, True)
    status = evaluate(c, base, o + 1, o + 1 + row_of(c, o)[B], time, later)
    exchange(base, place(c, base, o), f, False)
    for j in range(z.size):
        r[j] = f[j] - z[j] if held[j] == 0.0 else 0.0
    return status


def disturb(c: Any, base: int, o: int, time: float, later: float) -> int:
    """f near z, in TRIAL, each unknown moved by its own part, in MOVE; then f at z again. Returns the status."""
    u = unknowns(place(c, base, o))
    z, kept, step = vector(base, u, Z), vector(base, u, KEPT), vector(base, u, MOVE)
    size, held = vector(base, u, SIZE), vector(base, u, HELD)
    for j in range(z.size):
        kept[j] = z[j]
        if held[j] == 0.0:
            z[j] += math.sqrt(unit(u)) * (1.0 + 0.125 * (j % 7)) * size[j]
        step[j] = z[j] - kept[j]
    status = residual(c, base, o, time, later, TRIAL, R)
    for j in range(z.size):
        z[j] = kept[j]
    return residual(c, base, o, time, later, F, R) if status <= WARNING else status


def listen(c: Any, base: int, o: int, time: float, later: float, wider: float) -> int:
    """How much of f is noise, in FUZZ, see `listening`; then f at z again. Returns the status."""
    u = unknowns(place(c, base, o))
    z, kept = vector(base, u, Z), vector(base, u, KEPT)
    for j in range(z.size):
        kept[j] = z[j]
    for point in range(HEARINGS):
        move_on(base, u, point, wider)
        status = residual(c, base, o, time, later, TRIAL, MOVE)
        if status > WARNING:
            return status
        differ(base, u, point)
    settle(base, u)
    return residual(c, base, o, time, later, F, R)
