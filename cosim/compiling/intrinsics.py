"""What `cosim.machine.memory` means in compiled code: loads, array views and calls at run-time addresses."""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

BYTES = types.CPointer(types.uint8)
NUMBERS = {name: getattr(types, name) for name in ("float64", "float32", "int8", "int16", "int32", "int64")}
NUMBERS |= {name: getattr(types, name) for name in ("uint8", "uint16", "uint32", "uint64")} | {"bool": types.boolean}


def _pointer(number: Any) -> Any:
    """An intrinsic: the typed pointer at `base + offset`."""
    kind = types.CPointer(number)

    @intrinsic
    def pointer(context: Any, base: Any, offset: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(builder.gep(arguments[0], [arguments[1]]), context.get_value_type(kind))

        return kind(BYTES, types.int64), generate

    return pointer


def _load(number: Any) -> Any:
    """An intrinsic: the number stored at `base + offset`."""

    @intrinsic
    def load(context: Any, base: Any, offset: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.gep(arguments[0], [arguments[1]])
            data = builder.bitcast(place, context.get_data_type(number).as_pointer())
            return context.data_model_manager[number].from_data(builder, builder.load(data))

        return number(BYTES, types.int64), generate

    return load


def _stack(number: Any) -> Any:
    """An intrinsic: a pointer to so many numbers, which last as long as the function that asks for them runs."""
    kind = types.CPointer(number)

    @intrinsic(prefer_literal=True)
    def stack(context: Any, count: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            whole = ir.ArrayType(context.get_data_type(number), count.literal_value)
            return builder.bitcast(cgutils.alloca_once(builder, whole), context.get_value_type(kind))

        return kind(count), generate

    return stack


for _name, _number in NUMBERS.items():
    globals()[f"pointer_{_name}"] = _pointer(_number)
    globals()[f"load_{_name}"] = _load(_number)
    globals()[f"stack_{_name}"] = _stack(_number)


def _view(number: Any) -> Any:
    """An intrinsic: the array of so many numbers at an address, which owns nothing."""
    kind = types.Array(number, 1, "C")

    @intrinsic
    def view(context: Any, address: Any, size: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array, code = make_array(kind)(context, builder), context.get_data_type(number)
            width = context.get_constant(types.intp, context.get_abi_sizeof(code))
            data = builder.inttoptr(arguments[0], code.as_pointer())
            populate_array(array, data, shape=[arguments[1]], strides=[width], itemsize=width, meminfo=None)
            return array._getvalue()

        return kind(types.int64, types.int64), generate

    return view


@intrinsic
def size(context: Any, size: Any) -> Any:
    """A size of a dimension, which wiring has seen to be from 1 to 2^31 - 1."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        for relation, bound in ((">=", 1), ("<", 1 << 31)):
            builder.assume(builder.icmp_signed(relation, arguments[0], ir.IntType(64)(bound)))
        return arguments[0]

    return types.int64(types.int64), generate


@intrinsic
def read_only(context: Any, array: Any) -> Any:
    """The array, of a type for which numba refuses what writes to it, also through views and helpers."""
    return array.copy(readonly=True)(array), lambda context, builder, signature, arguments: arguments[0]


@intrinsic
def array(context: Any, pointer: Any, shape: Any) -> Any:
    """An array whose elements lie side by side, from a pointer on: numba.carray without a function."""
    kind = types.Array(pointer.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        step = ir.IntType(64)(context.get_abi_sizeof(context.get_data_type(pointer.dtype)))
        return _array(context, builder, signature, (*arguments, step))

    return kind(pointer, shape), generate


@intrinsic
def strided(context: Any, pointer: Any, shape: Any, step: Any) -> Any:
    """An array whose elements are so many bytes apart, from a pointer on."""
    kind = types.Array(pointer.dtype, len(shape), "A")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _array(context, builder, signature, arguments)

    return kind(pointer, shape, types.int64), generate


def _array(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """The view that a signature promises, of a pointer, a shape, and by how many bytes elements are apart."""
    data, sizes, step = arguments
    kind, word = signature.return_type, ir.IntType(64)
    element = context.get_data_type(kind.dtype)
    lengths = [
        context.cast(builder, size, given, types.intp)
        for size, given in zip(cgutils.unpack_tuple(builder, sizes, kind.ndim), signature.args[1], strict=True)
    ]
    strides = [step]
    for size in reversed(lengths[1:]):
        strides.insert(0, builder.mul(strides[0], size))
    view = make_array(kind)(context, builder)
    data, itemsize = builder.bitcast(data, element.as_pointer()), word(context.get_abi_sizeof(element))
    populate_array(view, data=data, shape=lengths, strides=strides, itemsize=itemsize, meminfo=None)
    return view._getvalue()


@intrinsic
def same_size(context: Any, size: Any, needed: Any) -> Any:
    """`cosim.authoring.lowering.routines.same_size`, compiled."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        with cgutils.if_unlikely(builder, builder.icmp_signed("!=", *arguments)):
            text = "ValueError: an array of size %lld does not fit one of size %lld"
            context.call_conv.return_fault(builder, text, *arguments)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64), generate


@intrinsic
def instance(context: Any, k: Any) -> Any:
    """Have the number of the instance at hand where a function that is called from here fails."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.instance = arguments[0]
        return context.get_dummy_value()

    return types.none(types.int64), generate


#: What `cosim.machine.memory` calls so, compiled.
words_at, reals_at, singles_at = _view(types.int64), _view(types.float64), _view(types.float32)
integers_at, bytes_at = _view(types.int32), _view(types.uint8)


def power(base: float, exponent: float) -> float:
    """`cosim.machine.memory.power`, compiled."""
    result: float = base**exponent
    return result


@dataclass(frozen=True)
class _ControlWord:
    """A floating-point control word of the processor, and its value for IEEE 754's default arithmetic.

    mask: what is no sticky flag. get, set: the instructions that store and load the word where a pointer in a register
    points; clobbered: what they change.
    """

    bits: int
    standard: int
    mask: int
    get: str
    set: str
    clobbered: str

    def restore(self, builder: Any) -> None:
        """Set it to the default, if it is not."""
        kind = ir.IntType(self.bits)
        place = cgutils.alloca_once(builder, kind)
        self._move(builder, self.get, place)
        wrong = builder.and_(builder.xor(builder.load(place), kind(self.standard)), kind(self.mask))
        with builder.if_then(builder.icmp_unsigned("!=", wrong, kind(0)), likely=False):
            builder.store(kind(self.standard), place)
            self._move(builder, self.set, place)

    def _move(self, builder: Any, instruction: str, place: Any) -> None:
        kind = ir.FunctionType(ir.VoidType(), [place.type])
        builder.asm(kind, instruction, f"r,~{{memory}},~{{{self.clobbered}}}", [place], side_effect=True)


_X86_STACK_STANDARD = 0x027F if sys.platform == "win32" else 0x037F
_X86 = (
    _ControlWord(32, 0x1F80, 0xFFC0, "stmxcsr ($0)", "ldmxcsr ($0)", "fpsr"),
    _ControlWord(16, _X86_STACK_STANDARD, 0x0F3F, "fnstcw ($0)", "fldcw ($0)", "fpsr"),
)
_ARM = (_ControlWord(64, 0, 0x7FFFFFFF, "mrs x9, fpcr; str x9, [$0]", "ldr x9, [$0]; msr fpcr, x9", "x9"),)


def _is_arm() -> bool:
    return platform.machine().lower() in ("arm64", "aarch64")


@intrinsic
def invoke(context: Any, function: Any, arguments: Any) -> Any:
    """`cosim.machine.memory.invoke`, compiled: an indirect C call whose signature follows from the arguments' types.

    The loop runs with IEEE 754's default arithmetic, see `cosim.machine.floating`, and so it goes on after the call.
    """
    kinds = [types.float64 if isinstance(a, types.Float) else types.int64 for a in arguments]

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = cgutils.unpack_tuple(builder, values[1], len(kinds))
        given = [context.cast(builder, v, a, k) for v, a, k in zip(given, arguments, kinds, strict=True)]
        kind = ir.FunctionType(ir.IntType(32), [context.get_value_type(k) for k in kinds])
        function = builder.inttoptr(values[0], kind.as_pointer())
        status = builder.call(function, given)
        for word in _ARM if _is_arm() else _X86:
            word.restore(builder)
        return status

    return types.int32(types.int64, arguments), generate


@intrinsic
def call(context: Any, function: Any, time: Any, base: Any, frame: Any) -> Any:
    """`cosim.machine.memory.call`, compiled: an indirect C call."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte, word = cgutils.voidptr_t, ir.IntType(64).as_pointer()
        kind = ir.FunctionType(ir.IntType(32), [ir.DoubleType(), byte, word])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        values = [arguments[1], builder.inttoptr(arguments[2], byte), builder.inttoptr(arguments[3], word)]
        return builder.call(target, values)

    return types.int32(types.int64, types.float64, types.int64, types.int64), generate


@intrinsic
def address_of(context: Any, pointer: Any) -> Any:
    """The address that a pointer holds."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ptrtoint(arguments[0], ir.IntType(64))

    return types.int64(pointer), generate


@intrinsic
def load(context: Any, address: Any) -> Any:
    """`cosim.machine.memory.load`, compiled: sequentially consistent."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        return builder.load_atomic(place, "seq_cst", 8)

    return types.int64(types.int64), generate


@intrinsic
def store(context: Any, address: Any, value: Any) -> Any:
    """`cosim.machine.memory.store`, compiled: sequentially consistent."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        builder.store_atomic(arguments[1], place, "seq_cst", 8)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64), generate


@intrinsic
def pause(context: Any) -> Any:
    """`cosim.machine.memory.pause`, compiled: the processor's hint that it spins."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        name, hint = ("llvm.aarch64.hint", [ir.IntType(32)(1)]) if _is_arm() else ("llvm.x86.sse2.pause", [])
        kind = ir.FunctionType(ir.VoidType(), [h.type for h in hint])
        builder.call(cgutils.get_or_insert_function(builder.module, kind, name), hint)
        return context.get_dummy_value()

    return types.none(), generate
