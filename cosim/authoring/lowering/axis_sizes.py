"""Sizes of axes as they are known before dimensions are: sums of names with a number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Size:
    """A size: the sum of a number and of multiples of named dimensions.

    exact: otherwise it may be less, as slices are cut to the array that they are taken from.
    """

    number: int = 0
    terms: tuple[tuple[str, int], ...] = ()
    exact: bool = True

    @property
    def constant(self) -> int | None:
        """The size, where it depends on no dimension."""
        return self.number if self.exact and not self.terms else None

    def plus(self, other: Size, times: int = 1) -> Size:
        """The size and a multiple of another."""
        terms = dict(self.terms)
        for dimension, factor in other.terms:
            terms[dimension] = terms.get(dimension, 0) + times * factor
        kept = tuple(sorted((d, f) for d, f in terms.items() if f))
        return Size(self.number + times * other.number, kept, self.exact and other.exact)

    def times(self, factor: int) -> Size:
        """A multiple of the size."""
        return Size(exact=self.exact).plus(self, factor)

    def at_most(self) -> Size:
        """The same as a bound."""
        return Size(self.number, self.terms, False)

    def of(self, sizes: Mapping[str, int]) -> int:
        """The size, or the bound, for sizes of dimensions."""
        return self.number + sum(factor * sizes[dimension] for dimension, factor in self.terms)

    def dimensions(self) -> frozenset[str]:
        """The dimensions that it depends on."""
        return frozenset(dimension for dimension, _ in self.terms)

    def __str__(self) -> str:
        parts = [d if f == 1 else f"{f} {d}" for d, f in self.terms]
        parts += [str(self.number)] if self.number or not parts else []
        return ("" if self.exact else "≤ ") + " + ".join(parts).replace("+ -", "- ")


ONE = Size(1)


def of_axis(size: int | str) -> Size:
    """The size of an axis as a variable declares it."""
    return Size(size) if isinstance(size, int) else Size(0, ((size, 1),))


def agree(a: Size, b: Size) -> bool | None:
    """Whether two axes are equally long; None where only a run can tell."""
    if not (a.exact and b.exact):
        return None
    apart = a.plus(b, -1)
    return None if apart.terms else apart.number == 0
