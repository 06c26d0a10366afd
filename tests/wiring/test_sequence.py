"""The order of turns under Gauss-Seidel, against its definition, looked up in the transitive closure of wires."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cosim.wiring.sequence import sequence


def ring_of(name: str, reads: dict[str, set[str]]) -> tuple[set[str], bool]:
    """The blocks that read a block and that it reads, at once or by way of others, and whether they read any else."""

    def reached(begin: str, steps: dict[str, set[str]]) -> set[str]:
        found, waiting = {begin}, [begin]
        while waiting:
            new = steps[waiting.pop()] - found
            found |= new
            waiting += new
        return found

    back = {name: {other for other in reads if name in reads[other]} for name in reads}
    sources = reached(name, reads)
    ring = sources & reached(name, back)
    return ring, sources == ring


@pytest.mark.parametrize("seed", range(60))
def test_every_turn_is_that_of_the_definition(seed):
    """Of a ring that reads nothing else that has had no turn: what hands on, else what has no feedthrough, else any."""
    rng = np.random.default_rng(seed)
    names = [f"b{k}" for k in range(rng.integers(1, 12))]
    wires = rng.random((len(names), len(names))) < rng.choice([0.1, 0.2, 0.4])
    reads = {a: {b for j, b in enumerate(names) if wires[i, j] and a != b} for i, a in enumerate(names)}
    passing = {name for name in names if rng.random() < 0.5}
    order = sequence(reads, passing)
    assert sorted(order) == sorted(names)
    for k, name in enumerate(order):
        left = {n: reads[n] - {*order[:k]} for n in order[k:]}
        ring, reads_nothing_else = ring_of(name, left)
        assert reads_nothing_else
        known = {n: ((0 if left[n] < reads[n] else 2) if n in passing else 1, names.index(n)) for n in ring}
        assert name == min(ring, key=known.__getitem__)


def test_what_comes_behind_a_ring_waits_for_all_of_it():
    reads = {"behind": {"a"}, "a": {"c", "source"}, "b": {"a"}, "c": {"b"}, "source": set()}
    assert sequence(reads, {"a", "b", "c"}) == ["source", "a", "b", "c", "behind"]


@pytest.mark.parametrize("given", [*itertools.permutations("abc", 2)])
def test_what_is_given_goes_first_and_the_others_follow(given):
    reads = {"a": set(), "b": {"a"}, "c": {"b"}}
    (last,) = {*"abc"} - {*given}
    assert sequence(reads, set(), given) == [*given, last]
