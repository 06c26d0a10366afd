"""Numbers that are integers on one path of a function and real numbers on another.

A kernel has one type for a name, so that such a number is real on either path; for Python it stays the integer. Which
integers these may be is followed through the function: constants of which both make the same bits (`total = 0` before a
loop that adds real numbers) are fine, anything else is refused with the author's line.
"""

from __future__ import annotations

import itertools
import operator
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any

import numpy as np
from numba.core import errors, types
from numba.core import ir as statements
from numba.core.ir_utils import get_definition, guard

from cosim.arithmetic import widened

#: The integers that a number may be for Python; empty where it is certainly real, None where nothing is known.
Integers = frozenset[int] | None
REAL: Integers = frozenset()
RETURNED = "returned integers"
"""Under which a compiled function's metadata have what `refuse` gave."""
_MANY = 8
_EXACT = 1 << 53
_ARITHMETIC = (operator.add, operator.sub, operator.mul, operator.truediv, operator.pow, operator.neg, operator.pos)
_FOLLOWED = {*_ARITHMETIC, abs, min, max}
_ELEMENTS = ("getitem", "static_getitem", "exhaust_iter", "cast")


def refuse(function: Any, typeof: Callable[[str], Any], calls: dict[Any, Any]) -> Integers:
    """The integers that a function may return for Python where it is compiled to return a real number.

    function: in numba's intermediate representation; typeof: of a variable; calls: the signature of each call. Raises:
    UnsupportedError at the line where the two would compute something else.
    """
    return _Numbers(function, typeof, calls).follow()


class _Numbers:
    def __init__(self, function: Any, typeof: Callable[[str], Any], calls: dict[Any, Any]) -> None:
        self._function, self._typeof, self._calls = function, typeof, calls
        self._found: dict[str, Integers] = {}

    def follow(self) -> Integers:
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
        value, kind = inst.value, self._typeof(inst.target.name)
        if not isinstance(kind, (types.Float, types.BaseTuple)):
            return REAL
        if isinstance(value, statements.Var):
            return self._converted(value, kind, inst)
        if not isinstance(value, statements.Expr):
            return REAL
        if value.op == "cast":
            return self._converted(value.value, kind, inst)
        if value.op in _ELEMENTS:
            return self._operand(value.value) if isinstance(self._typeof(value.value.name), types.BaseTuple) else REAL
        if value.op == "build_tuple":
            reals = [v for v in value.items if not self._is_whole(v)]
            return _union(map(self._operand, reals))
        if value.op == "unary":
            return self._computed(value.fn, [value.value], inst)
        if value.op in ("binop", "static_binop", "inplace_binop"):
            function = value.immutable_fn if value.op == "inplace_binop" else value.fn
            return self._computed(function, [value.lhs, value.rhs], inst)
        return self._called(value, inst) if value.op == "call" else REAL

    def _converted(self, source: Any, kind: Any, inst: Any) -> Integers:
        """Of a variable that becomes one of another type, or another name."""
        given = self._typeof(source.name)
        if isinstance(given, types.BaseTuple):
            for one, needed in zip(getattr(given, "types", ()), getattr(kind, "types", ()), strict=False):
                if isinstance(needed, types.Float) and not isinstance(one, types.Float):
                    self._refuse(source, inst)
            return self._operand(source)
        found = self._operand(source)
        if found is None:
            self._refuse(source, inst)
        return found

    def _operand(self, operand: Any) -> Integers:
        if not isinstance(operand, statements.Var):
            return frozenset([int(operand)]) if isinstance(operand, int) else REAL
        if not self._is_whole(operand):
            return self._found.get(operand.name, REAL)
        kind = self._typeof(operand.name)
        constant = guard(get_definition, self._function, operand)
        is_constant = isinstance(constant, (statements.Const, statements.Global, statements.FreeVar))
        value = getattr(kind, "literal_value", constant.value if is_constant else None)
        if isinstance(value, (int, np.integer, np.bool_)) and abs(int(value)) <= _EXACT:
            return frozenset([int(value)])
        return None

    def _is_whole(self, operand: Any) -> bool:
        if not isinstance(operand, statements.Var):
            return isinstance(operand, int)
        return isinstance(self._typeof(operand.name), (types.Integer, types.Boolean))

    def _called(self, call: Any, inst: Any) -> Integers:
        kind = self._typeof(call.func.name)
        if isinstance(kind, types.Dispatcher):
            compiled = kind.dispatcher.overloads.get(tuple(self._calls[call].args))
            return compiled.metadata.get(RETURNED, REAL) if compiled else REAL
        function = getattr(kind, "typing_key", None)
        if function is widened:
            return self._operand(call.args[0])
        if function in (min, max, abs) or isinstance(function, np.ufunc):
            return self._computed(function, call.args, inst)
        if function is divmod:
            self._computed(operator.floordiv, call.args, inst)
        return REAL

    def _computed(self, function: Any, operands: Any, inst: Any) -> Integers:
        """Of an operation that is one of integers for Python if all operands are."""
        integers = [self._operand(v) for v in operands]
        mixed = [v for v in operands if not self._is_whole(v)]
        if function is operator.pow and operands[1] in mixed and integers[1] != REAL:
            self._refuse(operands[1], inst)
        if not mixed or REAL in integers:
            return REAL
        if None in integers or not (function in _FOLLOWED or isinstance(function, np.ufunc)):
            self._refuse(mixed[0], inst)
        found = set()
        for numbers in itertools.product(*map(_known, integers)):
            if function is operator.pow and not 0 <= numbers[1] < _EXACT.bit_length():
                self._refuse(mixed[0], inst)
            exact = function(*numbers)
            if isinstance(exact, (float, np.floating)):
                continue
            if abs(int(exact)) > _EXACT or not _same_bits(exact, function(*map(float, numbers))):
                self._refuse(mixed[0], inst)
            found.add(int(exact))
        return frozenset(found)

    def _refuse(self, operand: Any, inst: Any) -> None:
        name = "" if operand.name.startswith("$") else operand.name.partition(".")[0]
        raise errors.UnsupportedError(f"an integer or a real number: `{name}`", inst.loc)


def _known(integers: Integers) -> Iterator[int]:
    assert integers is not None
    return iter(sorted(integers))


def _same_bits(integer: Any, real: Any) -> bool:
    return np.float64(integer).tobytes() == np.float64(real).tobytes()


def _union(sets: Any) -> Integers:
    return reduce(lambda a, b: None if a is None or b is None else a | b, sets, REAL)
