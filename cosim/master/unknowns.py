"""The unknowns of an algebraic loop in memory: where they lie, and the work space in which they are solved for.

`u`, at an address, says how many blocks of equations there are that do not depend on each other, how many equations
each has, in how many pieces of memory the unknowns lie, the offset of the work space, the bits of the coarsest real
numbers that are computed, and whether some foreign block gives directional derivatives; then come the pieces. Unknowns
are numbered block by block. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import reals_at, words_at

UNKNOWNS_WORDS = 6
BLOCKS, EQUATIONS, PIECES, WORK, BITS, DERIVED = range(UNKNOWNS_WORDS)

# A piece: its offset, bytes from one block to the next, numbers in a block, by which clock they are computed (from
# 1; 0: always), or that no row of the loop does so; and, a real number, how large they usually are.
PIECE_WORDS = 5
PIECE_OFFSET, PIECE_STRIDE, PIECE_NUMBERS, PIECE_CLOCK, PIECE_NOMINAL = range(PIECE_WORDS)
NO_ROW = -1

# The work space: vectors over all unknowns, and behind them a matrix for each block. The guess z, f(z), f(z) - z, a
# step; z before it, f at a trial; sizes; what f adds up; its rounding errors as differences say, and as those of the
# other side said; the residual that is allowed; 1 where nothing computes the unknown now, else 0; what rows and columns
# of a matrix are divided by, and which rows change places; how large unknowns usually are; what of f is noise, and what
# may be at most.
UNKNOWNS_VECTORS = 19
Z, F, R, MOVE, KEPT, TRIAL, SIZE, WEIGHT, ROUNDING, OTHER, ALLOWED, HELD = range(12)
DIVISORS, ROW_DIVISORS, LARGEST, PIVOTS, NOMINAL, FUZZ, MOST = range(12, UNKNOWNS_VECTORS)


def unknowns(at: int) -> Any:
    """What an address says of the unknowns."""
    return words_at(at, UNKNOWNS_WORDS)


def piece(at: int, p: int) -> Any:
    """A piece of memory in which some of the unknowns lie."""
    return words_at(at + (UNKNOWNS_WORDS + p * PIECE_WORDS) * 8, PIECE_WORDS)


def usual_size(at: int, p: int) -> float:
    """How large the numbers of a piece usually are."""
    size: float = reals_at(at + (UNKNOWNS_WORDS + p * PIECE_WORDS) * 8, PIECE_WORDS)[PIECE_NOMINAL]
    return size


def unit(u: Any) -> float:
    """The rounding unit: what comes after 1, of float32 where that is among what a loop computes."""
    return 2.0**-52 if u[BITS] > 23 else 2.0**-23


def vector(base: int, u: Any, number: int) -> Any:
    """One of the vectors over all unknowns."""
    size = u[BLOCKS] * u[EQUATIONS]
    return reals_at(base + u[WORK] + number * size * 8, size)


def is_quiet(base: int, u: Any) -> bool:
    """Whether no noise is known of, which has slopes too, so that only coarse differences tell what determines z."""
    fuzz, quiet = vector(base, u, FUZZ), True
    for j in range(fuzz.size):
        quiet = quiet and fuzz[j] == 0.0
    return quiet


def block_at(base: int, u: Any, number: int, b: int) -> int:
    """The address of the part of a vector that is block b's."""
    at: int = base + u[WORK] + (number * u[BLOCKS] + b) * u[EQUATIONS] * 8
    return at


def matrix_at(base: int, u: Any, b: int) -> int:
    """The address of the matrix of block b, row by row."""
    n = u[EQUATIONS]
    at: int = base + u[WORK] + (UNKNOWNS_VECTORS * u[BLOCKS] + b * n) * n * 8
    return at


def matrices(base: int, u: Any) -> Any:
    """The matrices of all blocks."""
    size, n = u[BLOCKS] * u[EQUATIONS], u[EQUATIONS]
    return reals_at(matrix_at(base, u, 0), size * n)


def exchange(base: int, at: int, values: Any, publish: bool) -> None:
    """The unknowns, block by block: to their places, or from there."""
    u = unknowns(at)
    j = 0
    for b in range(u[BLOCKS]):
        for p in range(u[PIECES]):
            own = piece(at, p)
            numbers = reals_at(base + own[PIECE_OFFSET] + b * own[PIECE_STRIDE], own[PIECE_NUMBERS])
            for i in range(numbers.size):
                if publish:
                    numbers[i] = values[j]
                else:
                    values[j] = numbers[i]
                j += 1
