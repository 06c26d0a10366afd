"""What a walk through a function has met: writes, reads that come too early, arguments with another value."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from cosim.authoring.dataflow.effects import Effects, NamedNode
from cosim.authoring.dataflow.written import Elements, Written


class WalkRecord:
    """Puts down the effects of a function."""

    def __init__(self, arguments: tuple[str, ...], elements: Elements) -> None:
        self.effects = Effects(arguments)
        self._elements = elements
        self._pardoned: list[frozenset[str]] = []

    def write(self, node: Any, roots: Iterable[str]) -> None:
        """Arguments that a node may write."""
        self.effects.maybe.extend(NamedNode(node, root) for root in sorted(roots))

    def rebind(self, node: Any, name: str) -> None:
        """A name that a node gives another value."""
        if name in self.effects.arguments:
            self.effects.rebound.append(NamedNode(node, name))

    def read(self, node: Any, roots: Iterable[str], written: Written) -> None:
        """Arguments that a node reads, where `written` is."""
        for root in sorted(roots):
            if written is None or root in written or any(root in names for names in self._pardoned):
                continue
            if not self._elements.holds(written, root, node):
                self.effects.stale.append(NamedNode(node, root))

    @contextmanager
    def pardoned(self, names: frozenset[str]) -> Iterator[None]:
        """Inside, reads of these come never too early."""
        self._pardoned.append(names)
        yield
        self._pardoned.pop()
