"""The order in which blocks take turns: a block after those that it reads, blocks that read each other after theirs.

Blocks that read each other, at once or by way of others, are a ring, which is entered somewhere: at a block with
feedthrough if something that it reads has had its turn, so that it hands that on; else at one without; else at any; the
first of the diagram each. What is then left of the ring is put in order in the same way.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Mapping

from cosim.wiring import loops


def sequence(reads: Mapping[str, Collection[str]], passing: Collection[str], given: Iterable[str] = ()) -> list[str]:
    """The order of all that `reads` names. passing: blocks with feedthrough; given: whose turns come first."""
    turns = _Turns(reads, passing)
    for name in given:
        turns.take(name)
    waiting = turns.rings(reads)
    while waiting:
        ring = waiting.pop()
        turns.enter(ring)
        waiting += turns.rings(ring)
    return [*turns.taken]


class _Turns:
    """Which turns have been taken, and of each block, in the order of the diagram, what it reads that has had none."""

    def __init__(self, reads: Mapping[str, Collection[str]], passing: Collection[str]) -> None:
        self._reads = reads
        self._passing = passing
        self._place = {name: k for k, name in enumerate(reads)}
        self._unread = {name: {*sources} for name, sources in reads.items()}
        self._readers: dict[str, set[str]] = {name: set() for name in reads}
        for name, sources in reads.items():
            for source in sources:
                self._readers[source].add(name)
        self.taken: dict[str, None] = {}

    def take(self, name: str) -> None:
        """A block takes its turn."""
        self.taken[name] = None
        for reader in self._readers[name]:
            self._unread[reader].discard(name)

    def rings(self, names: Iterable[str]) -> list[list[str]]:
        """Rings, and blocks in none, of those that have had no turn; what is read by others comes last."""
        left = [name for name in names if name not in self.taken]
        return loops.groups({name: sorted(self._unread[name], key=self._place.__getitem__) for name in left})[::-1]

    def enter(self, ring: Collection[str]) -> None:
        """Take turns in a ring, whose blocks read nothing else that has had none, as long as what is left is one."""
        inside = {*ring}
        queue = sorted(map(self._preference, ring))
        while queue:
            name = heapq.heappop(queue)[-1]
            if name in self.taken:
                continue
            self.take(name)
            inside.remove(name)
            readers = self._readers[name] & inside
            if not self._are_joined(readers, self._unread[name], inside):
                return
            for reader in readers:
                heapq.heappush(queue, self._preference(reader))

    def _preference(self, name: str) -> tuple[int, int, str]:
        hands_on = len(self._unread[name]) < len(self._reads[name])
        return (0 if hands_on else 2) if name in self._passing else 1, self._place[name], name

    def _are_joined(self, readers: set[str], sources: set[str], inside: set[str]) -> bool:
        """Whether all that read a block still read, by way of others, all that it reads, so that a ring is left.

        This takes the time of a short way in most rings, where to look for all rings in what is left takes that of all.
        """
        via = next(iter(sources), "")
        return all(self._reaches(reader, via, inside) for reader in readers) and all(
            self._reaches(via, source, inside) for source in sources
        )

    def _reaches(self, reader: str, source: str, inside: set[str]) -> bool:
        """Whether a block reads another, by way of others: looked for from both ends."""
        ahead, behind = {reader}, {source}
        front, back = ahead, behind
        while front and back and ahead.isdisjoint(behind):
            if len(front) <= len(back):
                front = set[str]().union(*(self._unread[name] for name in front)) - ahead
                ahead = ahead | front
            else:
                back = (set[str]().union(*(self._readers[name] for name in back)) & inside) - behind
                behind = behind | back
        return not ahead.isdisjoint(behind)
