"""Outputs along tangents, which follow from an FMU's directional derivatives: no input is set, and no output got.

Where the loop solves an algebraic loop, it has the adapter note the inputs u0 and the outputs y0 of an evaluation. As
it looks for the slopes of its equations, it moves inputs a little, and is given

    y = y0 + D (u - u0)

The FMU is asked for D along u - u0, over its largest element, and keeps the inputs that it has. Where no input has
moved, nothing is asked. An FMU that refuses once (`fmi*Discard`, `fmi*Error`, what is no number) is evaluated from then
on.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.fmu.fields import (
    ASKED,
    DIRECTIONAL_DERIVATIVE,
    FATAL,
    HANDLE,
    KNOWN_NUMBERS,
    KNOWN_PARTS,
    KNOWN_REFERENCES,
    N_KNOWN_PARTS,
    N_KNOWN_REFERENCES,
    N_UNKNOWN_PARTS,
    N_UNKNOWN_REFERENCES,
    NUMBER_COUNT,
    NUMBER_SINGLE,
    NUMBER_SLOT,
    NUMBER_WORDS,
    OK,
    POINTS,
    SEED,
    SENSITIVITY,
    STATUS,
    TANGENT_WORDS,
    UNDERIVED,
    UNKNOWN_NUMBERS,
    UNKNOWN_PARTS,
    UNKNOWN_REFERENCES,
    VERSION,
)
from cosim.fmu.transfer import bad
from cosim.machine.memory import reals_at, singles_at, words_at

FOLLOWED, REFUSED, LOST = range(3)


def note(base: int, table: int, f: Any, k: int) -> None:
    """Note inputs and outputs of instance k."""
    t = words_at(table, TANGENT_WORDS)
    known, unknown = point(t, k)
    take(base, t[KNOWN_PARTS], t[N_KNOWN_PARTS], f, k, known)
    take(base, t[UNKNOWN_PARTS], t[N_UNKNOWN_PARTS], f, k, unknown)


def follow(base: int, link: Any, table: int, f: Any, r: Any, k: int) -> int:
    """Give the outputs of instance k that follow from what was noted. Returns whether that was done, or refused.

    LOST: the FMU failed, and nothing may be called any more; the link then says where.
    """
    t = words_at(table, TANGENT_WORDS)
    known, unknown = point(t, k)
    seed, sensitivity = reals_at(t[SEED], t[KNOWN_NUMBERS]), reals_at(t[SENSITIVITY], t[UNKNOWN_NUMBERS])
    take(base, t[KNOWN_PARTS], t[N_KNOWN_PARTS], f, k, seed)
    moved, finite = 0.0, True
    for j in range(seed.size):
        seed[j] -= known[j]
        finite = finite and math.isfinite(seed[j])
        moved = max(moved, abs(seed[j]))
    if finite and moved > 0.0:
        for j in range(seed.size):
            seed[j] /= moved
        outcome = ask(link, t, r)
        if outcome != FOLLOWED:
            return outcome
    for j in range(sensitivity.size):
        change = moved * sensitivity[j] if moved > 0.0 and j < t[ASKED] else 0.0
        sensitivity[j] = unknown[j] + change if finite else math.nan
    give(base, t[UNKNOWN_PARTS], t[N_UNKNOWN_PARTS], f, k, sensitivity)
    return FOLLOWED


def ask(link: Any, t: Any, r: Any) -> int:
    """Have the FMU give its directional derivative along the seed."""
    unknowns = (r[HANDLE], t[UNKNOWN_REFERENCES], t[N_UNKNOWN_REFERENCES])
    references = (*unknowns, t[KNOWN_REFERENCES], t[N_KNOWN_REFERENCES])
    if link[VERSION] == 2:
        lost = bad(link, link[DIRECTIONAL_DERIVATIVE], (*references, t[SEED], t[SENSITIVITY]))
    else:
        numbers = (t[SEED], t[KNOWN_NUMBERS], t[SENSITIVITY], t[ASKED])
        lost = bad(link, link[DIRECTIONAL_DERIVATIVE], (*references, *numbers))
    if lost and link[STATUS] >= FATAL:
        return LOST
    sensitivity, finite = reals_at(t[SENSITIVITY], t[ASKED]), True
    for j in range(sensitivity.size):
        finite = finite and math.isfinite(sensitivity[j])
    if not lost and finite:
        return FOLLOWED
    link[STATUS] = OK
    link[UNDERIVED] = 1
    return REFUSED


def point(t: Any, k: int) -> tuple[Any, Any]:
    """What was noted of instance k: inputs and outputs."""
    size = t[KNOWN_NUMBERS] + t[UNKNOWN_NUMBERS]
    at = t[POINTS] + 8 * k * size
    return reals_at(at, t[KNOWN_NUMBERS]), reals_at(at + 8 * t[KNOWN_NUMBERS], t[UNKNOWN_NUMBERS])


def take(base: int, parts: int, n: int, f: Any, k: int, to: Any) -> None:
    """The numbers of n variables of instance k, from the arena."""
    at = 0
    for i in range(n):
        part = words_at(parts + i * NUMBER_WORDS * 8, NUMBER_WORDS)
        where = base + f[part[NUMBER_SLOT]] + k * f[part[NUMBER_SLOT] + 1]
        if part[NUMBER_SINGLE] != 0:
            short = singles_at(where, part[NUMBER_COUNT])
            for j in range(short.size):
                to[at + j] = short[j]
        else:
            numbers = reals_at(where, part[NUMBER_COUNT])
            for j in range(numbers.size):
                to[at + j] = numbers[j]
        at += part[NUMBER_COUNT]


def give(base: int, parts: int, n: int, f: Any, k: int, values: Any) -> None:
    """The other way round."""
    at = 0
    for i in range(n):
        part = words_at(parts + i * NUMBER_WORDS * 8, NUMBER_WORDS)
        where = base + f[part[NUMBER_SLOT]] + k * f[part[NUMBER_SLOT] + 1]
        if part[NUMBER_SINGLE] != 0:
            short = singles_at(where, part[NUMBER_COUNT])
            for j in range(short.size):
                short[j] = values[at + j]
        else:
            numbers = reals_at(where, part[NUMBER_COUNT])
            for j in range(numbers.size):
                numbers[j] = values[at + j]
        at += part[NUMBER_COUNT]
