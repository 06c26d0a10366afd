"""What compiled numbers may do: float64, int64 and bool, and nothing in silence.

`cosim.compiling.interpreted` does the same.

Narrower elements are widened when they are read, and have to fit where they are stored. What numba leaves undefined or
answers with 0 is a fault: integer division by zero, shifts by too much, a NaN made an integer. What Python and the C
library may answer differently is refused with the author's line.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, errors, types
from numba.core import ir as statements
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import get_definition, guard
from numba.core.postproc import PostProcessor
from numba.cpython import numbers
from numba.extending import intrinsic
from numba.np.ufunc.dufunc import DUFunc
from numba.np.ufunc.gufunc import GUFunc

from cosim.authoring.shared_operations import EXACT_NUMPY, SHARED_BUILTINS, SHARED_MATH, SHARED_NUMPY

WORD, REAL = ir.IntType(64), ir.DoubleType()
REPEATED = 0x10000  # the largest exponent for which numba multiplies

_IN_PLACE = {"add", "sub", "mul", "truediv"}
_KNOWN = {id(function) for function in SHARED_BUILTINS | SHARED_MATH | SHARED_NUMPY}
_METHODS = {"fill", "item", "argmax", "argmin"}


@contextmanager
def wrapping() -> Iterator[None]:
    """Inside, integers that are compiled wrap; numba tells LLVM that they never do. Needs numba's compiler lock."""
    emitted: Any = numbers
    flags = emitted._int_arith_flags
    emitted._int_arith_flags = lambda kind: []
    try:
        yield
    finally:
        emitted._int_arith_flags = flags


@intrinsic
def widened(context: Any, value: Any) -> Any:
    """A number that has been read, as int64 or float64; anything else as it is."""
    wide = value
    if isinstance(value, types.Integer) and not isinstance(value, types.Literal):
        wide = types.int64
    elif isinstance(value, types.Float):
        wide = types.float64

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if value == types.uint64:
            with cgutils.if_unlikely(builder, builder.icmp_signed("<", arguments[0], WORD(0))):
                context.call_conv.return_fault(builder, "OverflowError: no 64-bit integer", WORD(0), WORD(0))
        return context.cast(builder, arguments[0], value, wide)

    return wide(value), generate


def _narrow(value: Any) -> bool:
    """Whether reading an element of a type, or of a constant, could give another number than int64 and float64."""
    if isinstance(value, (tuple, types.BaseTuple)):
        return any(_narrow(v) for v in value)  # type: ignore[union-attr]  # those that there are can be iterated
    if isinstance(value, types.Array):
        return _narrow_number(value.dtype)
    return isinstance(value, np.ndarray) and value.dtype not in (np.float64, np.int64, np.bool_)


def _narrow_number(kind: Any) -> bool:
    return kind not in (types.float64, types.int64, types.boolean)


def _reads(value: Any, function: Any) -> bool:
    """Whether an expression gives an element of an array as it lies there."""
    if value.op != "call":
        return value.op in ("getitem", "static_getitem", "pair_first")
    called = guard(get_definition, function, value.func)
    if isinstance(called, (statements.Global, statements.FreeVar)):
        return called.value is min or called.value is max
    return isinstance(called, statements.Expr) and called.op == "getattr" and called.attr == "item"


def _globals(function: Any) -> Iterator[Any]:
    """The constants that a function sees."""
    for found in function._definitions.values():
        yield from (d.value for d in found if isinstance(d, (statements.Global, statements.FreeVar)))


@register_pass(mutates_CFG=True, analysis_only=False)
class Widening(FunctionPass):
    """Puts `widened` behind each read of an element."""

    _name = "widening"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """As of numba."""
        function = state.func_ir
        if not any(map(_narrow, (*state.args, *_globals(function)))):
            return False  # which saves a third of the compiler's time
        for block in function.blocks.values():
            body: list[Any] = []
            for inst in block.body:
                value = getattr(inst, "value", None)
                if isinstance(value, statements.Expr) and _reads(value, function):
                    read, name = (block.scope.make_temp(inst.loc) for _ in range(2))
                    callee = statements.Global("widened", widened, inst.loc)
                    call = statements.Expr.call(name, (read,), (), inst.loc)
                    body += [statements.Assign(value, read, inst.loc), statements.Assign(callee, name, inst.loc)]
                    body.append(statements.Assign(call, inst.target, inst.loc))
                    found = function._definitions
                    found[read.name], found[name.name] = [value], [callee]
                    found[inst.target.name] = [call if d is value else d for d in found[inst.target.name]]
                else:
                    body.append(inst)
            block.body = body
        PostProcessor(function).run()
        return True


def _is_foreign(function: Any) -> bool:
    """Whether a function is another one for Python than for numba: of Python itself, of numpy, or made by numba."""
    if isinstance(function, (np.ufunc, DUFunc, GUFunc)):
        return True
    module = getattr(function, "__module__", None) or "builtins"
    if module.startswith("numba.core.unsafe"):  # into which `try` is translated
        return False
    return callable(function) and module.partition(".")[0] in ("math", "cmath", "random", "numpy", "builtins", "numba")


class Arithmetic:
    """The part of `cosim.compiling.checks.Lowering` that looks at numbers."""

    builder: Any
    context: Any
    typeof: Any
    loadvar: Any

    def check_numbers(self, inst: Any) -> None:
        """Emit what has to hold before a statement is done, or refuse it."""
        if isinstance(inst, (statements.SetItem, statements.StaticSetItem)):
            self._check_store(inst)
        elif isinstance(inst, statements.Print):
            raise errors.UnsupportedError("print()", inst.loc)
        value = getattr(inst, "value", None)
        if not isinstance(value, statements.Expr):
            return
        if value.op in ("binop", "static_binop", "inplace_binop"):
            function = value.immutable_fn if value.op == "inplace_binop" else value.fn
            self._check_operator(function, value.lhs, value.rhs, inst)
        elif value.op == "call":
            self._check_call(value, inst)
        elif value.op == "unary" and value.fn is operator.invert and self._is_truth(value.value):
            raise errors.UnsupportedError("`~` of a truth value", inst.loc)
        elif value.op == "getattr" and value.attr == "ctypes":
            raise errors.UnsupportedError("an address may not be known", inst.loc)
        elif value.op == "arrayexpr" or (value.op == "unary" and self._is_array(value.value)):
            raise errors.UnsupportedError(_ALLOCATES, inst.loc)

    def _is_array(self, operand: Any) -> bool:
        return isinstance(operand, statements.Var) and isinstance(self.typeof(operand.name), types.Array)

    def _is_truth(self, operand: Any) -> bool:
        return isinstance(operand, statements.Var) and isinstance(self.typeof(operand.name), types.Boolean)

    def _check_operator(self, function: Any, left: Any, right: Any, inst: Any) -> None:
        if self._is_array(left) or self._is_array(right):
            if inst.value.op != "inplace_binop" or not self._is_array(left):
                raise errors.UnsupportedError(_ALLOCATES, inst.loc)
            if function.__name__ not in _IN_PLACE or not self._real(left) or not self._real(right):
                raise errors.UnsupportedError("this is done to arrays of float64 only, by + - * /", inst.loc)
            return
        if function is operator.pow and self._real(left) and self._whole(right):
            zero = self.builder.fcmp_ordered("==", self.loadvar(left.name), self._constant(left, 0.0))
            negative = self.builder.icmp_signed("<", self._word(right), WORD(0))
            self._fault(self.builder.and_(zero, negative), "ZeroDivisionError: 0.0 to a negative integer power")
        if not (self._whole(left) and self._whole(right)):
            return
        n = self._word(right)
        zero = self.builder.icmp_signed("==", n, WORD(0))
        if function in (operator.floordiv, operator.mod):
            self._fault(zero, "ZeroDivisionError: integer division or modulo by zero")
            most = self.builder.icmp_signed("==", self._word(left), WORD(-1 << 63))
            minus = self.builder.icmp_signed("==", n, WORD(-1))
            self._fault(self.builder.and_(most, minus), "OverflowError: no 64-bit integer")
        elif function in (operator.lshift, operator.rshift):
            wrong = self.builder.icmp_unsigned(">=", n, WORD(64))
            self._fault(wrong, "ValueError: a shift by less than 0 or more than 63 places")
        elif function is operator.pow:
            wrong = self.builder.icmp_unsigned(">", n, WORD(REPEATED))
            self._fault(wrong, f"ValueError: an integer to a power below 0 or above {REPEATED}")

    def _check_call(self, call: Any, inst: Any) -> None:
        kind = self.typeof(call.func.name)
        function = getattr(kind, "typing_key", None)
        by_address = isinstance(kind, types.ExternalFunctionPointer)
        if by_address or (isinstance(kind, types.Dispatcher) and not getattr(kind.dispatcher, "checked", False)):
            raise errors.UnsupportedError(
                "a function that cannot be checked: import a Python function by name", inst.loc
            )
        if isinstance(kind, types.BoundFunction):
            name = function[1] if isinstance(function, tuple) else str(function).rpartition(".")[2]
            if isinstance(kind.this, types.Array) and name not in _METHODS:
                raise errors.UnsupportedError(f"{name}() of an array: {_LOOP}", inst.loc)
            return
        if isinstance(kind, types.NumberClass) and _narrow_number(kind.instance_type):
            raise errors.UnsupportedError(f"{kind.instance_type}(): {_LOOP}", inst.loc)
        if _is_foreign(function) and id(function) not in _KNOWN:
            raise errors.UnsupportedError(f"{getattr(function, '__name__', function)}(): {_LOOP}", inst.loc)
        if isinstance(function, np.ufunc) and any(map(self._is_array, call.args)):
            if function not in EXACT_NUMPY or not all(map(self._real, call.args)):
                raise errors.UnsupportedError(f"{function.__name__}() of arrays: {_LOOP}", inst.loc)
            if len(call.args) == function.nin:
                raise errors.UnsupportedError(_ALLOCATES, inst.loc)
        if function is range and any(isinstance(self.typeof(a.name), types.Float) for a in call.args):
            raise errors.UnsupportedError("range() of a real number: make it whole with int() first", inst.loc)
        if function is round and len(call.args) > 1:
            raise errors.UnsupportedError(f"round() to digits: {_LOOP}", inst.loc)
        whole_class = isinstance(kind, types.NumberClass) and kind.instance_type == types.int64
        rounding = whole_class or function in (int, round, math.floor, math.ceil, math.trunc)
        if rounding and len(call.args) == 1 and isinstance(self.typeof(call.args[0].name), types.Float):
            self._check_integer(self.loadvar(call.args[0].name))
        if function in (round, math.floor, math.ceil, math.trunc) and self._whole(call.args[0]):
            name = function.__name__  # which numba makes a real number first
            raise errors.UnsupportedError(f"`{name}` of an integer", inst.loc)
        if isinstance(function, np.ufunc) and call.args and all(map(self._is_truth, call.args)):
            raise errors.UnsupportedError(f"`{function.__name__}` of truth values", inst.loc)
        if function is divmod and all(map(self._whole, call.args)):
            zero = self.builder.icmp_signed("==", self._word(call.args[1]), WORD(0))
            self._fault(zero, "ZeroDivisionError: integer division or modulo by zero")

    def _check_integer(self, value: Any) -> None:
        bound = float(1 << 63)
        above = self.builder.fcmp_ordered(">=", value, REAL(-bound))
        inside = self.builder.and_(above, self.builder.fcmp_ordered("<", value, REAL(bound)))
        self._fault(self.builder.not_(inside), "OverflowError: no 64-bit integer")

    def _check_store(self, inst: Any) -> None:
        array, value = self.typeof(inst.target.name), self.typeof(inst.value.name)
        if not isinstance(array, types.Array):
            return
        if isinstance(value, types.Array):
            raise errors.UnsupportedError("an array cannot be put into another at once: write a loop", inst.loc)
        if isinstance(value, types.Float) and not isinstance(array.dtype, types.Float):
            raise errors.UnsupportedError(f"a real number is put into an array of {array.dtype}", inst.loc)
        if isinstance(value, types.Integer) and isinstance(array.dtype, types.Integer):
            self._check_fit(self._word(inst.value), array.dtype)

    def _check_fit(self, value: Any, kind: Any) -> None:
        least, most = max(int(kind.minval), -1 << 63), min(int(kind.maxval), (1 << 63) - 1)
        if (least, most) == (-1 << 63, (1 << 63) - 1):
            return
        above = self.builder.sub(value, WORD(least))  # so that one comparison does for both ends
        wrong = self.builder.icmp_unsigned(">", above, WORD(most - least))
        self._fault(wrong, f"OverflowError: %lld does not fit into {kind}", value)

    def _fault(self, wrong: Any, text: str, first: Any = None) -> None:
        with cgutils.if_unlikely(self.builder, wrong):
            self.context.call_conv.return_fault(self.builder, text, WORD(0) if first is None else first, WORD(0))

    def _constant(self, like: Any, value: float) -> Any:
        return self.context.get_constant(self.typeof(like.name), value)

    def _real(self, operand: Any) -> bool:
        if not isinstance(operand, statements.Var):
            return isinstance(operand, float)
        kind = self.typeof(operand.name)
        return kind.dtype == types.float64 if isinstance(kind, types.Array) else isinstance(kind, types.Float)

    def _whole(self, operand: Any) -> bool:
        if not isinstance(operand, statements.Var):
            return isinstance(operand, int)
        return isinstance(self.typeof(operand.name), (types.Integer, types.Boolean))

    def _word(self, operand: Any) -> Any:
        if not isinstance(operand, statements.Var):
            return WORD(int(operand))
        return self.context.cast(self.builder, self.loadvar(operand.name), self.typeof(operand.name), types.int64)


_ALLOCATES = "its result is a new array, which needs memory: write a loop, or give an array to write to"
_LOOP = "not among what both engines have alike: write a loop with `math`"
