"""The tables that the loop walks, in words of 64 bits, and its simplest rows: calls and copies.

`base` is the arena's address, offsets in the tables are bytes from it. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import call, reals_at, words_at
from cosim.master.histories import forget, push, trace

# Status of a call and of a run: FMI's, and five more.
OK, WARNING, DISCARD, ERROR, FATAL, NON_FINITE, UNSOLVED, RESTLESS, STALLED, INDIVISIBLE = range(10)

# The phases of a program, as `program.py` explains them; of each, the first row and the one after the last.
PHASES = (
    *("CALCULATE", "START", "PUBLISH", "EVENTS", "EVALUATE", "SETTLE", "UPDATE", "ADVANCE"),
    *("SAVE", "REJECT", "REPEAT", "KEEP", "INDICATORS", "EVENT", "TIMES", "RETAIN", "REVIVE"),
)
CALCULATE, START, PUBLISH, EVENTS, EVALUATE, SETTLE, UPDATE, ADVANCE = range(8)
SAVE, REJECT, REPEAT, KEEP, INDICATORS, EVENT, TIMES, RETAIN, REVIVE = range(8, 17)
PHASE_WORDS = 2

# A row: kind, three operands, the number of the clock by which it is done (from 1; 0: at every communication point),
# at the step's begin (0) or end (1).
ROW_WORDS = 6
ROW_BYTES = 8 * ROW_WORDS
KIND, A, B, C, CLOCK, AT_END = range(ROW_WORDS)
CALL, COPY, INTEGRATE, SOLVE, PUSH, TRACE, FORGET = range(7)
# Operands: function, frame | to, from, words | bank | offset of the unknowns, see `unknowns`, how many rows that follow
# evaluate them, and what of them is due | offset of a history, which takes a sample, or gives the input its value, or
# begins anew: see `histories`.
AS_CLOCKS_SAY, ALL_FIRST, NO_SAMPLED = range(3)  # what of a loop is due; first: its solution has to be the only one

# A bank of states that are integrated together: its part of the state vector, whether stages are written in place,
# inner steps, the rows that give the derivatives: from published values (first), from the stage's; and the integrator:
# how many stages it has, and the offset of its tableau, see `cosim.integrators`.
BANK_WORDS = 16
BEGIN, END, IN_PLACE, INNER_STEPS, FIRST_BEGIN, FIRST_END, INNER_BEGIN, INNER_END, STAGES, TABLEAU = range(10)
(
    CONTROLLED,  # whether inner steps are as long as the tolerance allows
    TOLERANCES,  # the offset of the relative and the absolute one
    ESTIMATED,  # with which power of an inner step its estimated error goes
    HANDS_ON,  # whether the last slope of an inner step is the first of the next
    MEMORY,  # the offset of what an error-controlled bank keeps from one communication step to the next
    IMPLICIT,  # the offset of the equations of an implicit integrator; else 0
) = range(10, BANK_WORDS)
MEMORY_WORDS = 4
NEXT_STEP, REACHED, TAKEN, REJECTED = range(MEMORY_WORDS)  # (s) and the time (s), float64; counts of inner steps

# What an implicit integrator solves: systems of equations that do not depend on each other, how many states each has,
# the offset of work space, whether derivatives depend on the time by itself; then, system by system, which states of
# the bank. The work space has some vectors over all states, and of each system its Jacobian, and its factors.
SYSTEMS_WORDS = 4
SYSTEM_VECTORS = 4
SYSTEMS, SYSTEM_SIZE, SYSTEM_WORK, TIMED = range(SYSTEMS_WORDS)

# A clock, in ticks, and whether it is due at the communication point. One of events has a tick that no run reaches.
CLOCK_WORDS = 3
PERIOD, OFFSET, DUE = range(CLOCK_WORDS)
NEVER = 1 << 62

# Indicators of a component: the first and the one after the last among all, and the number of the clock that is due
# where one has crossed zero.
WATCHED_WORDS = 3
FIRST_INDICATOR, END_INDICATOR, CROSSED = range(WATCHED_WORDS)

# A group of probes that are copied to a buffer every so many ticks: a column of times, and one of each probe's words,
# each with room for CAPACITY rows and for one more.
GROUP_WORDS = 6
GROUP_EVERY, PROBES_BEGIN, PROBES_END, FILLED, BUFFER, CAPACITY = range(6)
PROBE_WORDS = 2  # offset, words

# The control block: what a caller hands over, and what it gets back.
CONTROL_WORDS = 74
(
    ROWS,
    BANKS,
    FUNCTIONS,
    GROUPS,
    PROBES,
    N_GROUPS,
    STATES,  # size of the state vector
    X,  # the published states
    W,  # the states of the stage that is being evaluated
    BEGUN,  # the states at the begin of an inner step
    SUM,  # a weighted sum of slopes
    D,  # derivatives
    SLOPES,  # those of every stage so far, one vector after the other
    PHASE,  # the address of the phases
    FIRST_ROW,  # what `execute` does
    END_ROW,
    TICK,  # the communication point, in ticks; the caller sets the first
    LAST,  # the tick before which to stop
    FINAL,  # whether to evaluate and probe at LAST too; 0 once that is done
    STEPS,  # how many communication steps are done
    GRID,  # the communication step, in ticks
    CLOCKS,  # the offset of those of blocks
    N_CLOCKS,
    AT,  # the row that is being done
    ELEMENT,  # the offset of the value that is not finite
    WARNINGS,  # how many calls returned a warning
    ORIGIN_TICK,  # the tick at which the time is ORIGIN
    ORIGIN,  # a float64 (s)
    TICK_SIZE,  # a float64 (s)
    STEP_SIZE,  # how long the step is that is being done, a float64 (s)
    ENDING,  # not 0 if no step is to be done after the next communication point or event; then BETWEEN, ENDED
    PUBLISHED,  # float64 numbers that have to be finite at every communication point, besides the states
    N_PUBLISHED,
    PUBLISHED32,  # and float32 numbers
    N_PUBLISHED32,
    STOP,  # whether somebody wants the loop to return before its next step
    AGAIN,  # not 0 if a foreign block has had an event at this communication point, which may change what it publishes
    LOOPS,  # how many algebraic loops there are
    ATTEMPTS,  # whether steps are attempts, which may be repeated or shortened
    TOLERANCE,  # of what is exchanged, relative, a float64; 0: steps are not shortened
    REPEATS,  # how often every step is repeated
    ROLLBACK,  # whether a step can be done anew
    STARTS,  # whether a step is repeated once where there is nothing to extrapolate from
    HISTORIES,  # the offset of a table of the offsets of histories
    N_HISTORIES,  # of what is not read late, which come first
    N_JUDGED,  # and with them of what is read late, by which steps are chosen too
    PROPOSED,  # how many ticks the next step may be long
    UNDONE,  # how many steps were shortened
    COARSE,  # how many steps were too long, and yet the smallest
    SHORTEST,  # the shortest step so far, in ticks
    LONGEST,
    N_INDICATORS,
    Z,  # the indicators
    WAS,  # what they were when they were looked at last
    HIGH,  # what they are beyond a crossing
    DIRECTION,  # how they have crossed
    HAPPENED,  # whether there has been an event since which none was looked at a moment later
    WANTED,  # which crossings are events: 1 upwards, -1 downwards, 0 both, float64 numbers
    WATCHED,  # whose indicators they are
    N_WATCHED,
    LOOKED,  # whether they have been looked at
    ALIVE,  # counts on within a communication step: with inner steps, and where large equations are solved
    EVENTFUL,  # whether there may be events between two communication points
    NEXT_EVENT,  # when foreign blocks have their next time event, a float64 (s)
    EARLY,  # when the first of them stopped within the step that is being done, a float64 (s); else infinite
    LEFT,  # whether what is evaluated lies before the events and jumps of its time, in a step that is not yet accepted
    DIVISIBLE,  # whether a step can end where an event is
    TERMINAL,  # of which indicators a crossing ends the run, float64 numbers that are not 0
    ENDED_BY,  # the indicator that did, from 1
    ENDED_AT,  # the time of the event that did, a float64 (s), between two communication points
    KEPT_ENDING,  # ENDING as it was when all was saved
    SOLVER,  # the address of what integrates all states in place of an integrator of ours; 0: nothing does
    ARRIVED,  # whether TICK has been evaluated and probed already, and nothing has changed since; then 0
    TANGENT,  # how foreign blocks that know their directional derivatives are evaluated
) = range(CONTROL_WORDS)

ENDED, BETWEEN = 2, 3  # what ENDING becomes: at a communication point, or at an event that lies between two
# As ever; and where and to what is noted; not at all, but what they would give follows from that by derivatives.
AS_EVER, NOTED, ALONG = range(3)
ADDRESSES = (ROWS, BANKS, FUNCTIONS, GROUPS, PROBES, PHASE, SOLVER)  # which are others in another process


def evaluate(c: Any, base: int, begin: int, end: int, time: float, later: float) -> int:
    """Do calls and copies in order, as of a time (s); later: that of rows that are done at the step's end."""
    rows, functions, clocks = c[ROWS], c[FUNCTIONS], base + c[CLOCKS] - CLOCK_WORDS * 8
    for o in range(begin, end):
        row = words_at(rows + o * ROW_BYTES, ROW_WORDS)
        clock = row[CLOCK]
        if clock != 0 and words_at(clocks + clock * CLOCK_WORDS * 8, CLOCK_WORDS)[DUE] == 0:
            continue
        c[AT] = o
        now = later if row[AT_END] != 0 else time
        if row[KIND] == CALL:
            status = call(words_at(functions + row[A] * 8, 1)[0], now, base, base + row[B])
            if status != OK:
                if status > WARNING:
                    return status
                c[WARNINGS] += 1
        elif row[KIND] == COPY:
            copy(base + row[A], base + row[B], row[C])
        elif row[KIND] == TRACE:
            trace(base, row[A], now, base + words_at(base + row[A], 1)[0], c[LEFT])
        elif row[KIND] == PUSH:
            push(base, row[A], now)
        else:
            forget(base, row[A])
    return OK


def part(c: Any, base: int, b: Any, vector: int) -> Any:
    """A bank's part of one of the vectors X, W, BEGUN, SUM, D."""
    return reals_at(base + c[vector] + b[BEGIN] * 8, b[END] - b[BEGIN])


def stage_of(c: Any, base: int, b: Any) -> Any:
    """The states of a bank's stage that is being evaluated."""
    return part(c, base, b, X if b[IN_PLACE] != 0 else W)


def slope_of(c: Any, base: int, b: Any, stage: int) -> Any:
    """A bank's part of the slope of a stage, from 0."""
    return reals_at(base + c[SLOPES] + stage * c[STATES] * 8 + b[BEGIN] * 8, b[END] - b[BEGIN])


def copy(to: int, source: int, n: int) -> None:
    """Copy n words, most often one, from an address to another."""
    if n == 1:
        words_at(to, 1)[0] = words_at(source, 1)[0]
        return
    there, here = words_at(to, n), words_at(source, n)
    for j in range(n):
        there[j] = here[j]
