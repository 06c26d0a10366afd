"""How numba finds the types of calls, remembering what it has found: it asks the same of `+` hundreds of times."""

from __future__ import annotations

from copy import copy
from typing import Any

from numba.core import types
from numba.core.typing.context import Context

#: Types that say all of their values that matters for a call.
_WHOLE = (
    *(types.Number, types.Boolean, types.Array, types.BaseTuple, types.CPointer),
    *(types.RangeType, types.RangeIteratorType),
)

_FUNCTION: Any = types.Function


class KnownCalls(Context):
    """numba's context of types, and what calls of its own functions with some types have turned out to be.

    Only such as numba has one implementation of are remembered: of what is written in Python (`overload`), it takes the
    one that was looked up last, which may have been compiled with other options.
    """

    _known: dict[tuple[Any, ...], Any]

    @classmethod
    def beside(cls, context: Any) -> Any:
        """A context that shares with one of numba's all that is registered."""
        beside: Any = copy(context)
        beside.__class__ = cls
        beside._known = {}
        return beside

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """As of numba."""
        function: Any = self._lookup_global(func) or func
        if kws or not isinstance(function, _FUNCTION) or not all(isinstance(a, _WHOLE) for a in args):
            return super().resolve_function_type(func, args, kws)
        call = function, *args
        found = self._known.get(call)
        if found is None:
            found = super().resolve_function_type(func, args, kws)
            if found is not None and function._impl_keys.get(found.args) is function.typing_key:
                self._known[call] = found
        return found
