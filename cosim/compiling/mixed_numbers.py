"""Numbers that are integers on one path of a function and real numbers on another.

A kernel has one type for a name, so that such a number is real on either path; for Python it stays the integer. Which
integers these may be is followed through the function: constants of which both make the same bits (`total = 0` before a
loop that adds real numbers) are fine, anything else is refused with the author's line.
"""

from __future__ import annotations

import inspect
import itertools
import math
import operator
from collections.abc import Callable, Iterable, Iterator
from functools import reduce
from typing import Any

import numpy as np
from numba.core import errors, types
from numba.core import ir as statements
from numba.core.ir_utils import get_definition, guard

from cosim.compiling.arithmetic import widened

#: The integers that a number may be for Python; empty where it is certainly real, None where nothing is known.
Integers = frozenset[int] | None
REAL: Integers = frozenset()
NUMBERS = "integers or real numbers"
"""Under which a compiled function's metadata have its `Numbers`."""
_MANY = 8
_EXACT = 1 << 53
_ARITHMETIC = (operator.add, operator.sub, operator.mul, operator.pow, operator.neg, operator.pos)
_COMPARISONS = (operator.lt, operator.le, operator.eq, operator.ne, operator.gt, operator.ge, operator.not_)
_FOLLOWED = {*_ARITHMETIC, abs, min, max}
_ELEMENTS = ("getitem", "static_getitem", "exhaust_iter", "cast")


class Numbers:
    """A function as compiled for some types.

    function: in numba's intermediate representation; typeof: of a variable; calls: the signature of each call.
    """

    def __init__(self, function: Any, typeof: Callable[[str], Any], calls: dict[Any, Any]) -> None:
        self._function, self._typeof, self._calls = function, typeof, calls
        self._found: dict[str, Integers] = {}
        self._arguments: tuple[Integers, ...] = ()
        self._returns: dict[tuple[Integers, ...], Integers] = {}

    def returned(self, arguments: tuple[Integers, ...] = ()) -> Integers:
        """The integers that it may return for Python where it is compiled to return a real number.

        arguments: those that it may be given, where compiled for real numbers. Raises: UnsupportedError at the line
        where the two would compute something else.
        """
        if arguments not in self._returns:
            self._found, self._arguments = {}, arguments
            self._returns[arguments] = self._follow()
        return self._returns[arguments]

    def _follow(self) -> Integers:
        body = [inst for block in self._function.blocks.values() for inst in block.body]
        assignments = [inst for inst in body if isinstance(inst, statements.Assign)]
        changed = True
        while changed:
            changed = False
            for inst in assignments:
                before = self._found.get(inst.target.name, REAL)
                found = self._of(inst)
                after = None if found is None or before is None else before | found
                if after is not None and len(after) > _MANY:
                    after = None
                self._found[inst.target.name] = after
                changed |= after != before
        returned = [self._found.get(inst.value.name, REAL) for inst in body if isinstance(inst, statements.Return)]
        return _union(returned)

    def _of(self, inst: Any) -> Integers:
        """What is assigned, if the kernel has a real number, or a tuple, in its place."""
        value = inst.value
        if isinstance(value, statements.Var):
            return self._converted(value, inst)
        if isinstance(value, statements.Arg):
            return self._arguments[value.index] if value.index < len(self._arguments) else REAL
        if not isinstance(value, statements.Expr):
            return REAL
        if value.op == "cast":
            return self._converted(value.value, inst)
        if value.op in _ELEMENTS:
            return self._operand(value.value)
        if value.op == "build_tuple":
            return self._union_of(value.items)
        if value.op == "unary":
            return self._computed(value.fn, [value.value], inst)
        if value.op in ("binop", "static_binop", "inplace_binop"):
            function = value.immutable_fn if value.op == "inplace_binop" else value.fn
            return self._computed(function, [value.lhs, value.rhs], inst)
        if value.op == "call":
            return self._called(value, inst)
        self._refuse_any(value.list_vars(), inst)
        return REAL

    def _converted(self, source: Any, inst: Any) -> Integers:
        """Of a variable that becomes one of another type, or another name."""
        found = self._operand(source)
        given, kind = self._typeof(source.name), self._typeof(inst.target.name)
        if isinstance(kind, types.BaseTuple):
            if _becomes_real(given, kind):
                self._refuse(source, inst)
            return found
        if isinstance(kind, types.Float) and found is None:
            self._refuse(source, inst)
        return found if isinstance(kind, types.Float) else REAL

    def _operand(self, operand: Any) -> Integers:
        if not isinstance(operand, statements.Var):
            return frozenset([int(operand)]) if isinstance(operand, int) else REAL
        if not self._is_whole(operand):
            return self._found.get(operand.name, REAL)
        kind = self._typeof(operand.name)
        constant = guard(get_definition, self._function, operand)
        is_constant = isinstance(constant, (statements.Const, statements.Global, statements.FreeVar))
        value = getattr(kind, "literal_value", constant.value if is_constant else None)
        if isinstance(value, (int, np.integer, np.bool_)) and abs(int(value)) < _EXACT:
            return frozenset([int(value)])
        return None

    def _is_whole(self, operand: Any) -> bool:
        if not isinstance(operand, statements.Var):
            return isinstance(operand, int)
        return isinstance(self._typeof(operand.name), (types.Integer, types.Boolean))

    def _is_tuple(self, operand: Any) -> bool:
        return isinstance(operand, statements.Var) and isinstance(self._typeof(operand.name), types.BaseTuple)

    def _called(self, call: Any, inst: Any) -> Integers:
        kind = self._typeof(call.func.name)
        function = getattr(kind, "typing_key", None)
        if isinstance(kind, types.NumberClass):
            return REAL
        if isinstance(kind, types.Dispatcher):
            return self._returned(call, inst)
        if function is widened:
            return self._operand(call.args[0])
        if function in (min, max) and len(call.args) > 1:
            return self._computed(function, call.args, inst)
        if function is abs or isinstance(function, np.ufunc):
            return self._computed(function, call.args, inst)
        if not _is_real_anyway(function):
            self._refuse_any(call.args, inst)
        return REAL

    def _returned(self, call: Any, inst: Any) -> Integers:
        """What a helper returns for these arguments."""
        if call.vararg is not None:
            self._refuse_any([call.vararg], inst)
        dispatcher = self._typeof(call.func.name).dispatcher
        compiled = dispatcher.overloads.get(tuple(self._calls[call].args))
        if compiled is None or NUMBERS not in compiled.metadata:
            self._refuse_any([*call.args, *dict(call.kws).values()], inst)
            return REAL
        mixed = tuple(map(self._union_of, _given(call, inspect.signature(dispatcher.py_func))))
        found: Integers = compiled.metadata[NUMBERS].returned(mixed if any(i != REAL for i in mixed) else ())
        return found

    def _union_of(self, operands: Iterable[Any]) -> Integers:
        """What one variable may be that takes these, where it is compiled for real numbers or as a tuple."""
        return _union(self._operand(v) for v in operands if not self._is_whole(v))

    def _computed(self, function: Any, operands: Any, inst: Any) -> Integers:
        """Of an operation that is one of integers for Python if all operands are."""
        if function in _COMPARISONS or _is_always_real(function):
            return REAL
        integers = [self._operand(v) for v in operands]
        mixed = [v for v in operands if not self._is_whole(v)]
        if any(map(self._is_tuple, mixed)):
            return _union(integers)
        if function is operator.pow and operands[1] in mixed and integers[1] != REAL:
            self._refuse(operands[1], inst)
        if not mixed or REAL in integers:
            return REAL
        known = [i for i in integers if i is not None]
        followed = function in _FOLLOWED or isinstance(function, np.ufunc)
        if len(known) < len(integers) or not followed or math.prod(map(len, known)) > _MANY**2:
            self._refuse(mixed[0], inst)
        found = {_exactly(function, numbers) for numbers in itertools.product(*map(sorted, known))}
        if None in found:
            self._refuse(mixed[0], inst)
        return frozenset(n for n in found if n is not None)

    def _refuse_any(self, operands: Any, inst: Any) -> None:
        for operand in operands:
            if isinstance(operand, statements.Var) and not self._is_whole(operand) and self._operand(operand) != REAL:
                self._refuse(operand, inst)

    def _refuse(self, operand: Any, inst: Any) -> None:
        name = "" if operand.name.startswith("$") else operand.name.partition(".")[0]
        raise errors.UnsupportedError(f"an integer or a real number: `{name}`", inst.loc)


def _given(call: Any, signature: inspect.Signature) -> Iterator[list[Any]]:
    """For each parameter of a helper, what a call gives it: nothing where it has a default, several for `*names`."""
    named = dict(call.kws)
    for k, (name, parameter) in enumerate(signature.parameters.items()):
        if parameter.kind is parameter.VAR_POSITIONAL:
            yield list(call.args[k:])
        elif k < len(call.args):
            yield [call.args[k]]
        else:
            yield [named[name]] if name in named else []


def _exactly(function: Any, numbers: tuple[int, ...]) -> int | None:
    """The integer that an operation makes of integers, if it makes the same bits of them as real numbers."""
    if function is operator.pow and not 0 <= numbers[1] < _EXACT.bit_length():
        return None
    exact, real = function(*numbers), function(*map(float, numbers))
    same = np.float64(exact).tobytes() == np.float64(real).tobytes()
    return int(exact) if same and abs(int(exact)) < _EXACT else None


def _is_always_real(function: Any) -> bool:
    """Whether an operation makes a real number of integers too."""
    if function is operator.truediv:
        return True
    return isinstance(function, np.ufunc) and "l" * function.nin + "->l" not in function.types


def _is_real_anyway(function: Any) -> bool:
    """Whether a function does the same with an integer and with that real number."""
    module = getattr(function, "__module__", None)
    return function in (float, int, bool, round, len, range) or module == "math"


def _becomes_real(given: Any, kind: Any) -> bool:
    """Whether a number, or one inside a tuple, is real only after a conversion."""
    if isinstance(given, types.BaseTuple) and isinstance(kind, types.BaseTuple):
        return any(map(_becomes_real, _members(given), _members(kind)))
    return isinstance(kind, types.Float) and not isinstance(given, types.Float)


def _members(kind: Any) -> tuple[Any, ...]:
    return tuple(getattr(kind, "types", ()))


def _union(sets: Any) -> Integers:
    return reduce(lambda a, b: None if a is None or b is None else a | b, sets, REAL)
