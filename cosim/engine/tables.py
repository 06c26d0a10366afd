"""The tables that the loop walks, in words of 64 bits, and its simplest rows: calls and copies.

`base` is the arena's address, offsets in the tables are bytes from it. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import call, reals_at, words_at

# Status of a call and of a run: FMI's, and three more.
OK, WARNING, DISCARD, ERROR, FATAL, NON_FINITE, UNSOLVED, STALLED = range(8)

# The phases of a program, as `program.py` explains them; of each, the first row and the one after the last.
PHASES = ("CALCULATE", "START", "PUBLISH", "EVENTS", "EVALUATE", "SETTLE", "UPDATE", "ADVANCE")
CALCULATE, START, PUBLISH, EVENTS, EVALUATE, SETTLE, UPDATE, ADVANCE = range(8)
PHASE_WORDS = 2

# A row: kind, three operands, done every so many steps, at the step's begin (0) or end (1).
ROW_WORDS = 6
ROW_BYTES = 8 * ROW_WORDS
KIND, A, B, C, EVERY, AT_END = range(ROW_WORDS)
CALL, COPY, INTEGRATE, SOLVE = range(4)
# Operands: function, frame | to, from, words | bank | offset of the unknowns, how many rows that follow evaluate them.

# The unknowns of an algebraic loop: blocks of equations that do not depend on each other, how many equations each has,
# pieces of memory in which the unknowns lie, and the offset of work space; then the pieces: offset, bytes from one
# block to the next, numbers in a block.
UNKNOWNS_WORDS = 4
UNKNOWNS_VECTORS = 9
BLOCKS, EQUATIONS, PIECES, WORK = range(UNKNOWNS_WORDS)
PIECE_WORDS = 3

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

# A group of probes that are copied to a buffer every so many steps: [time, probed words…] a row, CAPACITY rows at most.
GROUP_WORDS = 7
GROUP_EVERY, PROBES_BEGIN, PROBES_END, SAMPLE_WORDS, FILLED, BUFFER, CAPACITY = range(7)
PROBE_WORDS = 2  # offset, words

# The control block: what a caller hands over, and what it gets back.
CONTROL_WORDS = 34
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
    STEP,  # the step that is being done; the caller sets the first
    LAST,  # the step before which to stop
    FINAL,  # whether to evaluate and probe at LAST too; 0 once that is done
    AT,  # the row that is being done
    ELEMENT,  # the offset of the value that is not finite
    WARNINGS,  # how many calls returned a warning
    ORIGIN_STEP,  # the step at which the time is ORIGIN
    ORIGIN,  # a float64 (s)
    STEP_SIZE,  # the communication step, a float64 (s)
    ENDING,  # not 0 if no step is to be done after the next communication point, a foreign block may say; then ENDED
    PUBLISHED,  # float64 numbers that have to be finite at every communication point, besides the states
    N_PUBLISHED,
    PUBLISHED32,  # and float32 numbers
    N_PUBLISHED32,
    STOP,  # whether somebody wants the loop to return before its next step
    AGAIN,  # not 0 if a foreign block has had an event at this communication point, which may change what it publishes
    LOOPS,  # how many algebraic loops there are
    INNER,  # how many inner steps have been begun: a sign of life within a communication step
) = range(CONTROL_WORDS)

ENDED = 2  # what ENDING becomes


def evaluate(c: Any, base: int, begin: int, end: int, k: int, time: float, later: float) -> int:
    """Do calls and copies in order, as of step k and a time (s); later: the time of rows that are done at its end."""
    rows, functions = c[ROWS], c[FUNCTIONS]
    for o in range(begin, end):
        row = words_at(rows + o * ROW_BYTES, ROW_WORDS)
        every = row[EVERY]
        if every != 1 and k % every != 0:
            continue
        c[AT] = o
        if row[KIND] == CALL:
            now = later if row[AT_END] != 0 else time
            status = call(words_at(functions + row[A] * 8, 1)[0], now, base, base + row[B])
            if status != OK:
                if status > WARNING:
                    return status
                c[WARNINGS] += 1
        else:
            copy(base + row[A], base + row[B], row[C])
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
