"""How much there is to compile."""

from __future__ import annotations

import types
from collections.abc import Container
from typing import Any


def bytes_reached(function: Any, absent: Container[Any] = ()) -> int:
    """The bytecode of a function and of those that it calls by name, in bytes.

    absent: functions that are not compiled.
    """
    reached = [function]
    for each in reached:  # which grows meanwhile
        named = (each.__globals__.get(name) for name in each.__code__.co_names)
        called = {found for value in named if _is_function(found := getattr(value, "py_func", value))}
        reached.extend(found for found in called if found not in reached and found not in absent)
    return sum(len(each.__code__.co_code) for each in reached)


def _is_function(value: Any) -> bool:
    return isinstance(value, types.FunctionType)
