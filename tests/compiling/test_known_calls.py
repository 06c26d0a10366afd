"""What a call's type has turned out to be is looked up once, and is what numba says."""

import math
import operator

import pytest
from numba import types
from numba.core.errors import TypingError
from numba.core.registry import cpu_target

from cosim.compiling.known_calls import KnownCalls

VECTOR = types.Array(types.float64, 1, "A")
CALLS = [
    (operator.add, (types.int64, types.float64)),
    (operator.add, (types.IntegerLiteral(1), types.IntegerLiteral(2))),
    (operator.lt, (types.float64, types.int64)),
    (operator.getitem, (VECTOR, types.int64)),
    (operator.setitem, (VECTOR, types.int64, types.int64)),
    (math.sqrt, (types.int64,)),
    (max, (types.float64, types.float64)),
    (range, (types.int64,)),
]


@pytest.fixture
def known(monkeypatch):
    """A context, and how often numba is asked."""
    cpu_target.target_context.refresh()
    context, asked = KnownCalls.beside(cpu_target.typing_context), []
    ask = types.Function.get_call_type
    noted = lambda self, *given: asked.append(self) or ask(self, *given)  # noqa: E731
    monkeypatch.setattr(types.Function, "get_call_type", noted)
    return context, asked


@pytest.mark.parametrize(("function", "kinds"), CALLS)
def test_the_type_of_a_call_is_what_numba_says(known, function, kinds):
    context, asked = known
    expected = cpu_target.typing_context.resolve_function_type(function, kinds, {})
    asked.clear()
    for _ in range(3):
        found = context.resolve_function_type(function, kinds, {})
        assert (found.return_type, found.args, found.recvr) == (expected.return_type, expected.args, expected.recvr)
    assert len(asked) == 1 or function is max  # which numba has in Python


def test_a_call_that_has_no_type_has_none_again(known):
    context, _ = known
    for _ in range(2):
        with pytest.raises(TypingError):
            context.resolve_function_type(operator.lt, (types.complex128, types.float64), {})
    assert context.resolve_function_type(operator.lt, (types.int64, types.float64), {}).return_type == types.boolean
