"""Numbers as a person writes them: nested lists of numbers and expressions, evaluated for a member of a fleet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.errors import ExpressionError, Position, WrongShape, WrongType, WrongValue, nearest
from cosim.language import expression
from cosim.language.data_files import array_of
from cosim.language.source import Node

EXACT = 2.0**53
"""Whole numbers below it are numbers as they are."""


@dataclass(frozen=True)
class Value:
    """A nested list of leaves, or an array; a leaf is a number, a bool or an expression's text, with its place."""

    content: Any
    shape: tuple[int, ...]
    position: Position

    @classmethod
    def of(cls, content: Any, position: Position) -> Value:
        """A block's own default: a number, text, or nested sequences of them."""
        if isinstance(content, (list, tuple, np.ndarray)):
            parts = [cls.of(item, position) for item in content]
            return cls(parts, (len(parts), *(parts[0].shape if parts else ())), position)
        return cls(content, (), position)

    @classmethod
    def read(cls, node: Node, name: str) -> Value:
        """What a diagram gives. Raises: WrongShape for ragged lists, WrongType for anything but numbers."""
        if isinstance(node.value, list):
            parts = [cls.read(item, name) for item in node.value]
            if any(part.shape != parts[0].shape for part in parts):
                ragged = next(part for part in parts if part.shape != parts[0].shape)
                fix = f"give every row the shape {parts[0].shape}"
                raise WrongShape(f"{name}: the rows of the list differ in length", ragged.position, fix)
            return cls(parts, (len(parts), *(parts[0].shape if parts else ())), node.position)
        if (array := array_of(node)) is not None:
            return cls(array if array.ndim else array.item(), array.shape, node.position)
        if isinstance(node.value, dict) or node.value is None:
            kind = "a mapping" if isinstance(node.value, dict) else "nothing"
            raise WrongType(f"{name}: a number or a list of numbers is needed, not {kind}", node.position, "such as 1")
        if isinstance(node.value, float) and math.isnan(node.value):
            raise WrongValue(f"{name}: `.nan` is no value to calculate with", node.position, "give a number")
        return cls(node.value, (), node.position)

    @property
    def is_arithmetic(self) -> bool:
        """Whether it is no text, or one that is an expression, perhaps in the number of a fleet's member."""
        return not isinstance(self.content, str) or expression.is_arithmetic(self.content)

    def member(self, k: int) -> Value:
        """The k-th row (from 0)."""
        row: Any = self.content[k]
        return row if isinstance(row, Value) else Value(row if row.ndim else row.item(), row.shape, self.position)

    def uses(self, name: str) -> bool:
        """Whether an expression in it names a variable."""
        if isinstance(self.content, list):
            return any(part.uses(name) for part in self.content)
        return isinstance(self.content, str) and name in expression.names(self.content)

    def array(self, shape: tuple[int, ...], dtype: np.dtype, names: Mapping[str, float]) -> np.ndarray:
        """Evaluated; a scalar fills the shape. Raises: ExpressionError, WrongValue."""
        if self.shape == () and shape != ():
            return np.full(shape, self._number(dtype, names), dtype)
        return np.broadcast_to(np.array(self._evaluate(dtype, names), dtype), shape).copy()

    def of_members(self, shape: tuple[int, ...], dtype: np.dtype, count: int) -> np.ndarray | None:
        """Evaluated for all members of a fleet (count, *shape), at once; None where that has to be done one by one.

        Raises: WrongType, WrongValue.
        """
        found = self._of_members(dtype, count) if dtype.kind in "fiu" else None
        if found is None:
            return None
        more = (1,) * (len(shape) + 1 - found.ndim)
        return np.broadcast_to(found.reshape(*found.shape, *more), (count, *shape)).copy()

    def _of_members(self, dtype: np.dtype, count: int) -> np.ndarray | None:
        """The same (count, *self.shape)."""
        if isinstance(self.content, list):
            parts = [part._of_members(dtype, count) for part in self.content]  # noqa: SLF001  # of this class
            return None if any(part is None for part in parts) else np.stack(parts, axis=1)
        if isinstance(self.content, np.ndarray):
            return None
        if not isinstance(self.content, str):
            return np.full(count, self._number(dtype, {}), dtype)
        numbers = expression.of_members(self.content, count)
        if numbers is None or dtype == np.float64:
            return numbers
        bounds: Any = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
        fit = (numbers >= bounds.min) & (numbers <= bounds.max)
        if dtype.kind in "iu":
            fit &= (numbers == np.floor(numbers)) & (abs(numbers) < EXACT)
        return numbers.astype(dtype) if fit.all() else None

    def _evaluate(self, dtype: np.dtype, names: Mapping[str, float]) -> Any:
        if isinstance(self.content, np.ndarray):
            if self.content.dtype.kind == "f" and dtype == np.float64:
                return self.content
            leaves = [replace(self, content=item, shape=()) for item in self.content.reshape(-1).tolist()]
            numbers = [leaf._number(dtype, names) for leaf in leaves]  # noqa: SLF001  # of this class
            return np.array(numbers, dtype).reshape(self.content.shape)
        if isinstance(self.content, list):
            return [part._evaluate(dtype, names) for part in self.content]  # noqa: SLF001  # of this class
        return self._number(dtype, names)

    def _text(self) -> str:
        if not isinstance(self.content, str):  # YAML has read 007 as 7, and nobody knows any more how it was written
            word = str(self.content).lower() if isinstance(self.content, bool) else self.content
            raise WrongType(f"`{word}` is no text", self.position, "put it between quotation marks")
        return self.content

    def with_items(self, items: Mapping[str, int]) -> Value:
        """With the numbers of an enumeration's items in the place of their names. Raises: WrongValue."""
        if isinstance(self.content, list):
            return replace(self, content=[part.with_items(items) for part in self.content])
        if isinstance(self.content, str) and self.content in items:
            return replace(self, content=items[self.content])
        if not self.is_arithmetic:
            message = f"`{self.content}` is none of the items {', '.join(f'`{name}`' for name in items)}"
            raise WrongValue(message, self.position, nearest(self.content, items))
        return self

    def _number(self, dtype: np.dtype, names: Mapping[str, float]) -> Any:
        number = self.content
        if dtype.hasobject:
            return self._text()
        if dtype.kind == "b" and number not in (0, 1):
            raise WrongType(f"`{number}` is neither true nor false", self.position, "write true or false")
        if dtype.kind != "b" and isinstance(number, bool):
            word = str(number).lower()
            raise WrongType(f"`{word}` is no number", self.position, f"write {int(number)}, if that is what is meant")
        if isinstance(number, str):
            try:
                number = expression.evaluate(number, names)
            except ExpressionError as error:
                raise ExpressionError(error.message, self.position, error.fix) from None
        if dtype.kind in "iu" and not float(number).is_integer():
            raise WrongValue(f"{number} is no whole number", self.position, "give an integer")
        if dtype.kind in "iu":
            bounds = np.iinfo(dtype)
            if not bounds.min <= number <= bounds.max:
                raise WrongValue(f"{number} does not fit {dtype}", self.position, f"{bounds.min} … {bounds.max}")
        if dtype.kind == "f" and math.isfinite(number) and abs(number) > float(np.finfo(dtype).max):
            raise WrongValue(f"{number:g} does not fit {dtype}", self.position, f"at most {np.finfo(dtype).max:g}")
        return dtype.type(number)
