"""Arrays get names: memory of their own, or a view where that is what it is for Python too."""

from __future__ import annotations

import ast
from typing import Any

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.lowered_values import Array, Scalar, Several, Value, stored
from cosim.authoring.lowering.names import Names
from cosim.authoring.lowering.work import Refusal, Work


class ArrayNames:
    """What local names of arrays are.

    For Python two names may be one array. An argument is never replaced by another array, so that a name of a part of
    it is a view here too. Memory of the function's own is written anew wherever its name is given another value: a
    second name for it is a copy, which is the same as long as neither is written in place.
    """

    def __init__(self, work: Work, names: Names) -> None:
        self._work = work
        self._names = names
        self._views: set[str] = set()
        self._copies: list[tuple[str, str, Any]] = []
        self._moves: list[tuple[str, str, Any]] = []
        self._parts: dict[tuple[str, int], str] = {}

    def owns(self, name: str) -> bool:
        """Whether a name has memory of its own."""
        return name not in self._views

    def judge(self) -> None:
        """Refuse copies that Python would have as views, where that makes a difference."""
        changed = self._work.in_place
        for name, root, node in self._copies:
            if written := min((self._moved(name) | self._moved(root)) & changed, default=""):
                what = f"makes `{name}` another name for memory of `{root}`, and writes `{written}` in place"
                fix = f"write `{name} = ….copy()` for an array of its own, or write into `{root}` by its own name"
                self._work.refusals.append(Refusal(node, what, fix))

    def _moved(self, name: str) -> set[str]:
        """The names between which an array goes to and fro."""
        found = {name}
        while more := {n for a, b, _ in self._moves if {a, b} & found for n in (a, b)} - found:
            found |= more
        return found

    def number(self, target: Any, value: Scalar) -> None:
        """A name stands for a number. Raises: Refusal where it was an array."""
        if isinstance(self._names.values.get(target.id), (Array, Several)):
            self._told_elsewhere(target)
            what = f"gives the name `{target.id}` to an array and to a number"
            self._work.refuse(target, what, "use a name for each")
        self._names.give(target.id, value)

    def _told_elsewhere(self, target: Any) -> None:
        if target.id in self._names.arguments and not self._names.is_helper:
            raise Refusal(target, "", "")

    def view(self, name: str, value: Value) -> None:
        """A name stands for a part of something else, as a loop gives it."""
        self._views.add(name)
        self._names.give(name, value)

    def bind(self, target: Any, value: Value, s: Any) -> None:
        """A name stands for an array, or a tuple of some. Raises: Refusal."""
        name = target.id
        known = self._names.values.get(name)
        if name in self._names.arguments:
            self._told_elsewhere(target)
            what = f"gives the name `{name}`, an argument, to another array"
            self._work.refuse(target, what, "use another name for the new array")
        if isinstance(value, Several):
            self._several(target, value, s)
            return
        assert isinstance(value, Array)
        if known is None:
            self._first(target, value, s)
            return
        if not isinstance(known, Array) or known.axes != value.axes:
            what = f"gives the name `{name}` to values of two kinds"
            self._work.refuse(target, what, "use a name for each")
        if name in self._views:
            if value.view is None or not self._is_lasting(value):
                what = f"gives the name `{name}` to a part of an array and to an array of its own"
                self._work.refuse(target, what, "use a name for each, or write `.copy()` behind the part")
            self._work.emit(syntax.assign(name, value.view))
        else:
            self.note(target, value)
            self._work.store(known, value, s)
        self._names.give(name, known)

    def _first(self, target: Any, value: Array, s: Any) -> None:
        name = target.id
        if value.storage == name:
            self._names.give(name, value)
            return
        if value.view is not None and self._is_lasting(value):
            self._work.emit(syntax.assign(name, value.view))
            self.view(name, stored(name, value.root, value.kind))
            return
        self.note(target, value)
        room = self._work.room(value.kind, s, name, value.size_at)
        self._work.each(room, value)
        self._names.give(name, room)

    def note(self, target: Any, value: Value, goes: bool = False) -> None:
        """Remember that a name gets a copy of what it would be another name for.

        goes: and the other name gets something else at once.
        """
        if not isinstance(target, ast.Name) or not isinstance(value, Array):
            return
        if value.view is not None and value.root in self._names.local and value.root != target.id:
            (self._moves if goes else self._copies).append((target.id, value.root, target))

    def _is_lasting(self, value: Array) -> bool:
        """Whether the memory of a view is not given another content by a name that is bound anew."""
        names, root = self._names, value.root
        if root in names.arguments or root not in {t.name for t in self._work.temporaries}:
            return True
        return root in names.local and names.is_made_once(root)

    def _several(self, target: Any, value: Several, s: Any) -> None:
        items: list[Value] = []
        for k, item in enumerate(value.items):
            name = self._parts.setdefault((target.id, k), self._work.fresh(f"{target.id}_"))
            part = ast.copy_location(ast.Name(name, ast.Store()), target)
            self._names.local.add(name)
            if isinstance(item, Scalar):
                self._work.emit(syntax.assign(name, item.node))
                items.append(Scalar(syntax.name(name), item.element))
                continue
            self.bind(part, item, s)
            items.append(self._names.values[name])
        self._names.give(target.id, Several(tuple(items)))

    def apart(self, value: Value, s: Any) -> Value:
        """A value of which no part changes while others are stored."""
        if isinstance(value, Several):
            return Several(tuple(self.apart(item, s) for item in value.items))
        if isinstance(value, Scalar):
            return self._work.named(value)
        fresh = value.storage and value.root not in self._names.local
        return value if fresh or self._is_unchanging(value) else self._work.copied(value, s)

    def _is_unchanging(self, value: Array) -> bool:
        """Whether a view of an argument may stay one."""
        return value.view is not None and value.root in self._names.arguments
