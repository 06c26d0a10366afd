"""What keeps a compiled function within its arrays, and what it leaves behind where it fails.

An index is compared once, unsigned, with the size of its axis; LLVM proves most comparisons away, and the failing side
is one call of a cold function. Whatever fails, an index or a `raise`, writes a fault to the first words of the frame
(see `cosim.compiling.frame`): the address of a text, two numbers that belong into it, and the instance. So a fault
can be told without Python. numba's own records of exceptions, which are pickles, are not used.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import callconv, cgutils, compiler, config, cpu, errors, types
from numba.core import ir as statements
from numba.core.compiler_machinery import register_pass
from numba.core.ir_utils import get_definition, guard
from numba.core.lowering import Lower
from numba.core.runtime.context import NRTContext
from numba.core.typed_passes import NativeLowering, NopythonTypeInference

from cosim.compiling import mixed_numbers
from cosim.compiling.arithmetic import Arithmetic, Widening
from cosim.compiling.frame import FIRST_NUMBER, INSTANCE, SECOND_NUMBER

#: What a function of ours returns when it has left a fault. Functions of numba's library return USEREXC.
FAULT = callconv.errcode_t(callconv.RETCODE_USEREXC.constant + 1)
WORD = ir.IntType(64)
BYTES = ir.IntType(8).as_pointer()

#: Writes a fault; its arguments: where to, text, two numbers, instance.
RECORD = f"""
define void @cosim_fault(ptr %fault, ptr %text, i64 %first, i64 %second) cold noinline nounwind {{
  %first_place = getelementptr i64, ptr %fault, i64 {FIRST_NUMBER}
  %second_place = getelementptr i64, ptr %fault, i64 {SECOND_NUMBER}
  store ptr %text, ptr %fault
  store i64 %first, ptr %first_place
  store i64 %second, ptr %second_place
  ret void
}}
"""


@dataclass(frozen=True)
class Site:
    """The statement of an author's function that is being compiled, and the array that it indexes."""

    file: str
    line: int
    array: str = "an array"

    def __str__(self) -> str:
        return f"{Path(self.file).name}:{self.line}"


class CallConvention(callconv.CPUCallConv):
    """numba's, but all functions of a kernel write to one fault, that of the frame."""

    def set_static_user_exc(
        self, builder: Any, exc: Any, exc_args: Any = None, loc: Any = None, func_name: Any = None
    ) -> None:
        """Write what an exception says."""
        site = Site(loc.filename, loc.line) if loc else getattr(builder, "site", None)
        self._write(builder, _escaped(_exception_text(exc, exc_args)), site)

    def return_user_exc(
        self, builder: Any, exc: Any, exc_args: Any = None, loc: Any = None, func_name: Any = None
    ) -> None:
        """Write what an exception says, and return, or go on where the author catches it."""
        self.set_static_user_exc(builder, exc, exc_args, loc, func_name)
        self._leave(builder)

    def return_fault(self, builder: Any, text: str, first: Any, second: Any) -> None:
        """Write a text with two numbers (``%lld``), and return, or go on where the author catches it."""
        self._write(builder, text, getattr(builder, "site", None), first, second)
        self._leave(builder)

    def return_dynamic_user_exc(
        self, builder: Any, exc: Any, exc_args: Any, nb_types: Any, loc: Any = None, func_name: Any = None
    ) -> None:
        """Refuse what would have to be put together while it runs."""
        raise errors.UnsupportedError("the arguments of an exception have to be constants", loc)

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """Hand on what a called function has left, with the instance where the caller knows it."""
        state = self.check_try_status(builder)
        strange = builder.icmp_signed("==", status.code, callconv.RETCODE_USEREXC)
        with cgutils.if_unlikely(builder, strange):
            self._write(builder, "an exception in a function that is called there", getattr(builder, "site", None))
        if (instance := getattr(builder, "instance", None)) is not None:
            fault = builder.bitcast(self._get_excinfo_argument(builder.function), WORD.as_pointer())
            builder.store(instance, builder.gep(fault, [WORD(INSTANCE)]))
        with builder.if_then(builder.not_(state.in_try)):
            self._return_errcode_raw(builder, FAULT)

    def call_function(
        self, builder: Any, callee: Any, resty: Any, argtys: Any, args: Any, attrs: Any = None
    ) -> tuple[Any, Any]:
        """Call a function with this function's own place for faults."""
        kind = self.get_return_type(resty).pointee
        result = cgutils.alloca_once(builder, kind)
        builder.store(cgutils.get_null_value(kind), result)
        fault = self._get_excinfo_argument(builder.function)
        given = self._get_arg_packer(argtys).as_arguments(builder, args)
        code = builder.call(callee, [result, fault, *given], attrs=tuple(attrs or ()))
        status = self._get_return_status(builder, code, builder.load(fault))
        return status, self.context.get_returned_value(builder, resty, builder.load(result))

    def _write(self, builder: Any, text: str, site: Site | None, *numbers: Any) -> None:
        place = f" ({_escaped(str(site))})" if site else ""
        constant = self.context.insert_const_string(builder.module, text + place)
        kind = ir.FunctionType(ir.VoidType(), [BYTES, BYTES, WORD, WORD])
        write = cgutils.get_or_insert_function(builder.module, kind, "cosim_fault")
        fault = builder.bitcast(self._get_excinfo_argument(builder.function), BYTES)
        builder.call(write, [fault, constant, *(numbers or (WORD(0), WORD(0)))])

    def _leave(self, builder: Any) -> None:
        self.check_try_status(builder)
        if caught := getattr(builder, "_in_try_block", None):
            builder.branch(caught["target"])
        else:
            self._return_errcode_raw(builder, FAULT)


def _exception_text(exc: Any, arguments: Any) -> str:
    """An exception as Python shows it, such as "ValueError: too large"."""
    if exc is None:
        return "an exception that was raised again"
    words = ", ".join(map(str, arguments or ()))
    return f"{exc.__name__}: {words}" if words else exc.__name__


def _escaped(text: str) -> str:
    return text.replace("%", "%%")


class _Uncounted(NRTContext):
    """numba's run time for arrays of which none owns anything, so that nothing counts who refers to them."""

    def incref(self, builder: Any, typ: Any, value: Any) -> None:
        """One more, of nothing."""

    def decref(self, builder: Any, typ: Any, value: Any) -> None:
        """One less, of nothing."""


class Context(cpu.CPUContext):
    """numba's own processor target, with this calling convention."""

    @cached_property
    def nrt(self) -> Any:
        """As of numba."""
        return _Uncounted(self, self.enable_nrt)

    @property
    def call_conv(self) -> CallConvention:
        """As of numba."""
        return CallConvention(self)

    def compile_subroutine(
        self,
        builder: Any,
        impl: Any,
        sig: Any,
        locals: Any = None,  # noqa: A002  # as numba calls it
        flags: Any = None,
        caching: bool = True,
    ) -> Any:
        """Compile a function of numba's own, where division of real numbers by zero raises nothing either."""
        if flags is None:
            flags = compiler.Flags()
            flags.nrt, flags.error_model = True, "numpy"
        return super().compile_subroutine(builder, impl, sig, locals, flags, caching)


class Lowering(Arithmetic, Lower):
    """Notes each statement's place, and refuses or checks what numba indexes without a check."""

    def pre_lower(self) -> None:
        """As of numba."""
        super().pre_lower()
        if not self.func_ir.loc.filename.startswith("<"):
            numbers = mixed_numbers.Numbers(self.func_ir, self.fndesc.typemap.__getitem__, self.fndesc.calltypes)
            numbers.returned()
            self.metadata[mixed_numbers.NUMBERS] = numbers

    def lower_inst(self, inst: Any) -> None:
        """As of numba, for one statement."""
        indexed = _indexed(inst)
        if not self.func_ir.loc.filename.startswith("<"):
            named = self._name(indexed) if indexed else "an array"
            self.builder.site = Site(self.func_ir.loc.filename, inst.loc.line, named)
            if indexed and not isinstance(self.typeof(indexed.name), (types.Array, types.BaseTuple)):
                raise errors.UnsupportedError(f"{self.typeof(indexed.name)} cannot be indexed", inst.loc)
            self.check_numbers(inst)
            if isinstance(inst, statements.Assign) and isinstance(inst.value, statements.Expr):
                self._match_shapes(inst.value)
        super().lower_inst(inst)

    def _match_shapes(self, expression: Any) -> None:
        """Where an array is computed element by element, check that the others have its shape or broadcast to it."""
        if expression.op == "inplace_binop":
            operands = [expression.lhs, expression.rhs]
            results = [expression.lhs]
        elif expression.op == "call" and isinstance(self._called(expression), np.ufunc):
            operands = list(expression.args)
            results = operands[self._called(expression).nin :]
        else:
            return
        arrays = [v for v in operands if isinstance(self.typeof(v.name), types.Array)]
        if not arrays or not results or not isinstance(self.typeof(results[0].name), types.Array):
            return
        shape = self._shape(results[0])
        for array in arrays:
            sizes = self._shape(array)
            if len(sizes) > len(shape):
                raise errors.UnsupportedError("an array with more axes than the one that it is put into", array.loc)
            for axis, (size, needed) in enumerate(zip(sizes, shape[len(shape) - len(sizes) :], strict=True)):
                self._match(size, needed, axis, broadcast=array not in results)

    def _match(self, size: Any, needed: Any, axis: int, broadcast: bool) -> None:
        builder = self.builder
        wrong = builder.icmp_signed("!=", size, needed)
        if broadcast:
            wrong = builder.and_(wrong, builder.icmp_signed("!=", size, WORD(1)))
        with cgutils.if_unlikely(builder, wrong):
            text = f"ValueError: an array of size %lld along axis {axis} does not fit into one of size %lld"
            self.context.call_conv.return_fault(builder, text, size, needed)

    def _name(self, variable: Any) -> str:
        """A variable as the author wrote it."""
        constant = guard(get_definition, self.func_ir, variable)
        name = constant.name if isinstance(constant, (statements.Global, statements.FreeVar)) else variable.name
        return "an array" if name.startswith(("$", "closure__")) else f"`{name.partition('.')[0]}`"

    def _called(self, expression: Any) -> Any:
        kind = self.typeof(expression.func.name)
        return getattr(kind, "typing_key", None)

    def _shape(self, variable: Any) -> list[Any]:
        kind = self.typeof(variable.name)
        array = self.context.make_array(kind)(self.context, self.builder, self.loadvar(variable.name))
        return list(cgutils.unpack_tuple(self.builder, array.shape, kind.ndim))


def _indexed(inst: Any) -> Any:
    """The variable that a statement indexes, if any."""
    if isinstance(inst, (statements.SetItem, statements.StaticSetItem)):
        return inst.target
    value = getattr(inst, "value", None)
    return value.value if isinstance(value, statements.Expr) and "getitem" in value.op else None


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    _name = "checked_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return Lowering


class Compiler(compiler.CompilerBase):
    """numba's passes, with `Widening` before types are inferred and `Lowering` as the last."""

    def define_pipelines(self) -> list[Any]:
        """As of numba."""
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        changed: dict[Any, list[Any]] = {
            NativeLowering: [_Lowering],
            NopythonTypeInference: [Widening, NopythonTypeInference],
        }
        passes.passes = [(p, text) for known, text in passes.passes for p in changed.get(known, [known])]
        passes.finalize()
        return [passes]


def _check_index(context: Any, builder: Any, index: Any, size: Any, axis: int | None = None) -> None:
    """Instead of numba's: one comparison does for both ends.

    Negative indices have had the size added before, as in Python, and no size is negative.
    """
    if not hasattr(builder, "site"):  # inside a function of numba's library
        _numba_check(context, builder, index, size, axis)
        return
    with cgutils.if_unlikely(builder, builder.icmp_unsigned(">=", index, size)):
        negative = builder.icmp_signed("<", index, index.type(0))
        written = builder.select(negative, builder.sub(index, size), index)
        text = (
            f"IndexError: index %lld is out of bounds for axis {axis or 0} of {_escaped(builder.site.array)}, size %lld"
        )
        context.call_conv.return_fault(builder, text, written, size)


_numba_check = cgutils.do_boundscheck


@contextmanager
def checking() -> Iterator[None]:
    """Inside, whatever is compiled with the flag `boundscheck` is checked. Needs numba's compiler lock."""
    settings: Any = config
    chosen = settings.BOUNDSCHECK
    settings.BOUNDSCHECK = None  # a person's NUMBA_BOUNDSCHECK would overrule the flag
    cgutils.do_boundscheck = _check_index
    try:
        yield
    finally:
        cgutils.do_boundscheck = _numba_check
        settings.BOUNDSCHECK = chosen
