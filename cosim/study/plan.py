"""The members of a study: variants × grid × draws, in that order."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from cosim.errors import UnknownSetting
from cosim.study.definition import Study
from cosim.study.draws import Draws


@dataclass(frozen=True)
class Member:
    """One run of a study. settings: (dotted path, plain value), as --set takes them.

    until: of a search, how far it looks (s), inf for to the end; it is told what the requirements' margins may be, and
    nothing else.
    """

    variant: str
    grid: tuple[int, ...] = ()
    draw: int | None = None
    settings: tuple[tuple[str, Any], ...] = ()
    until: float | None = None

    @property
    def name(self) -> str:
        """What to call it in messages, on the command line and in names of files: `NBOVP-2-17`, counting from 0."""
        return "-".join(map(str, (self.variant, *self.grid, *(() if self.draw is None else (self.draw,)))))


def size(study: Study) -> int:
    """How many members there are."""
    count = len(study.variants) * (study.random.count if study.random else 1)
    for axis in study.grid:
        count *= len(axis.values)
    return count


def names(study: Study) -> Iterator[str]:
    """The names of all members; nothing is drawn for them."""
    draws = range(study.random.count) if study.random else (None,)
    for variant, point in _points(study):
        for draw in draws:
            yield Member(variant, point, draw).name


def _points(study: Study) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Every variant with every point of the grid, made one by one."""
    axes = [range(len(axis.values)) for axis in study.grid]
    return ((variant, point) for variant in study.variants for point in itertools.product(*axes))


def variant_of(study: Study, name: str) -> str:
    """The variant of the member of that name."""
    return name.rsplit("-", len(study.dimensions) - 1)[0] if len(study.dimensions) > 1 else name


def members(study: Study, draws: Draws | None, first: int = 0) -> Iterator[Member]:
    """All members, made one by one, of draws from `first`; `draws` are those of the study, None if it has none."""
    for variant, point in _points(study):
        chosen = grid_settings(study, point)
        if draws is None:
            yield Member(variant, point, None, chosen)
            continue
        for number in range(first, draws.count):
            yield Member(variant, point, number, (*chosen, *draws.settings(number)))


def find(study: Study, draws: Draws | None, name: str) -> Member:
    """The member of that name. Raises: UnknownSetting."""
    for member in members(study, draws):
        if member.name == name:
            return member
    first = next(members(study, draws)).name
    fix = f"variant, then the numbers of the grid's values and of the draw, from 0, such as {first}"
    raise UnknownSetting(f"the study has no member `{name}`", fix=fix)


def crossings(study: Study) -> list[tuple[tuple[str, str], ...]]:
    """Every choice among the variants that the study's own are crossed with, as settings; one empty one if none are."""
    axes = [[(axis.paths[0], change.name) for change in axis.changes] for axis in study.grid if axis.changes]
    return list(itertools.product(*axes))


def grid_settings(study: Study, point: tuple[int, ...]) -> tuple[tuple[str, Any], ...]:
    """What a point of the grid sets."""
    return tuple(pair for axis, at in zip(study.grid, point, strict=True) for pair in axis.settings(at))
