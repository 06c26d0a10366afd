"""Random draws: points of the unit cube, mapped to values, those that are not accepted left out.

With the method `random` each draw has a generator of its own, seeded by the study's seed and the draw's number, so
that a draw does not depend on how many there are. Latin hypercubes and Sobol sequences (scipy.stats.qmc) are filled
up with further points for those that are not accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cosim.errors import NoAcceptedDraw, Position
from cosim.study.definition import Draw, Random
from cosim.study.dotted_paths import short_name
from cosim.wiring import sizes

TRIALS = 10_000
"""Points without an accepted one after which the search is given up."""


class Draws:
    """The draws of a study, found when they are asked for, each kept as one row of numbers.

    count: how many count, at most as many as the study says. shapes: of the value behind each draw. accepts: whether
    the values (path, nested list) may be used.
    """

    def __init__(
        self, random: Random, shapes: list[tuple[int, ...]], accepts: Callable[[tuple[tuple[str, Any], ...]], bool]
    ) -> None:
        self.count = random.count
        self.tried = 0
        self._random = random
        self._shapes = shapes
        self._accepts = accepts
        self._sizes = [int(np.prod(shape)) for shape in shapes]
        place = random.draws[0].node.place if random.draws else None
        needed = 8 * random.count * sum(self._sizes)
        sizes.require(needed, f"{random.count} random draws", place, "a smaller `random.count`")
        self._rows = np.empty((random.count, sum(self._sizes)))
        self._found = 0
        self._sequence: Iterator[np.ndarray] = iter(())

    def settings(self, number: int) -> tuple[tuple[str, Any], ...]:
        """What draw `number`, from 0, sets. Raises: NoAcceptedDraw."""
        while self._found <= number:
            self._rows[self._found] = self._next(self._found)
            self._found += 1
        return self._settings(self._rows[number])

    def typical(self) -> tuple[tuple[str, Any], ...]:
        """What the middle of all ranges sets; nobody asks whether it is accepted."""
        return self._settings(self._mapped(np.full(sum(self._sizes), 0.5)))

    def at(self, point: np.ndarray) -> tuple[tuple[str, Any], ...] | None:
        """What a point of the unit cube (size,) sets; None if that is not accepted."""
        found = self._settings(self._mapped(point))
        return found if self._accepts(found) else None

    def numbers_at(self, point: np.ndarray) -> np.ndarray:
        """The numbers (size,) at a point of the unit cube (size,)."""
        return self._mapped(point)

    def point_of(self, value: Callable[[str], Any]) -> np.ndarray:
        """The point (size,) of the unit cube at given uniform values, by path; at its bounds for those beyond."""
        parts, at = [], 0
        numbers = self.numbers_of(value)
        for draw, shape, size in zip(self._random.draws, self._shapes, self._sizes, strict=True):
            given = numbers[at : at + size].reshape(shape)
            parts.append(np.clip((given - draw.a) / (draw.b - draw.a), 0.0, 1.0).reshape(-1))
            at += size
        return np.concatenate(parts)

    def numbers_of(self, value: Callable[[str], Any]) -> np.ndarray:
        """The given values, by path, as numbers (size,); where one is drawn for what has several, it is their mean."""
        parts = []
        for draw, shape in zip(self._random.draws, self._shapes, strict=True):
            given = np.asarray(value(draw.paths[0]), float)
            parts.append(np.broadcast_to(given if given.shape == shape else np.mean(given), shape).reshape(-1))
        return np.concatenate(parts)

    @property
    def accept_place(self) -> Position | None:
        """Where it is said what is accepted."""
        return self._random.accept[0].node.place if self._random.accept else None

    def names(self) -> list[str]:
        """What each number of a draw is called: by its path, an element with its indices from 1."""
        found = []
        for draw, shape in zip(self._random.draws, self._shapes, strict=True):
            name = short_name(",".join(draw.paths))
            found += [
                f"{name}[{','.join(str(k + 1) for k in index)}]" if index else name for index in np.ndindex(*shape)
            ]
        return found

    @property
    def size(self) -> int:
        """How many numbers there are in a draw."""
        return sum(self._sizes)

    def values(self) -> Iterator[tuple[Draw, np.ndarray]]:
        """Each random value with all its draws (count, *shape)."""
        self.settings(self.count - 1)
        at = 0
        for draw, shape, size in zip(self._random.draws, self._shapes, self._sizes, strict=True):
            yield draw, self._rows[: self.count, at : at + size].reshape(self.count, *shape)
            at += size

    def _next(self, number: int) -> np.ndarray:
        """The next accepted row."""
        if number == 0 or self._random.method == "random":
            self._sequence = self._points(number)
        for _ in range(TRIALS):
            self.tried += 1
            row = self._mapped(next(self._sequence))
            if self._accepts(self._settings(row)):
                return row
        message = f"none of {TRIALS} random points satisfies `random.accept`"
        raise NoAcceptedDraw(message, self.accept_place, "widen the bounds, or draw from a larger range")

    def _points(self, number: int) -> Iterator[np.ndarray]:
        """Endless points of the unit cube (size,)."""
        size = sum(self._sizes)
        if self._random.method == "random":
            generator = np.random.default_rng([self._random.seed, number])
            while True:
                yield generator.random(size)
        from scipy.stats import qmc

        generator = np.random.default_rng(self._random.seed)
        if self._random.method == "sobol":
            sobol = qmc.Sobol(size, rng=generator)
            while True:
                yield from (
                    sobol.random_base2(int(np.ceil(np.log2(self.count))))
                    if not sobol.num_generated
                    else (sobol.random(sobol.num_generated))
                )
        cube = qmc.LatinHypercube(size, rng=generator)
        while True:
            yield from cube.random(self.count)

    def _mapped(self, point: np.ndarray) -> np.ndarray:
        row, at = np.empty_like(point), 0
        for draw, shape, size in zip(self._random.draws, self._shapes, self._sizes, strict=True):
            part = point[at : at + size].reshape(shape)
            row[at : at + size] = _quantile(draw, part).reshape(-1)
            at += size
        return row

    def _settings(self, row: np.ndarray) -> tuple[tuple[str, Any], ...]:
        settings, at = [], 0
        for draw, shape, size in zip(self._random.draws, self._shapes, self._sizes, strict=True):
            value = row[at : at + size].reshape(shape).tolist()
            settings += [(path, value) for path in draw.paths]
            at += size
        return tuple(settings)


def _quantile(draw: Draw, unit: np.ndarray) -> np.ndarray:
    """The values whose distribution function is `unit`."""
    values: np.ndarray
    if draw.normal:
        from scipy.special import ndtri

        values = draw.a + draw.b * ndtri(np.clip(unit, 1e-16, 1 - 1e-16))
    else:
        values = draw.a + unit * (draw.b - draw.a)
    return values
