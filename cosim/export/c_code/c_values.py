"""LLVM's types, names and constants in C: integers are unsigned, pointers count bytes."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable

from cosim.export.c_code.llvm_reader import ATTRIBUTES, FLAGS, LlvmType, Tokens, Untranslatable

_NUMBER = re.compile(r"(\d+)u|UINT64_C\((\d+)\)")
_BYTE = re.compile(rb"\\([0-9A-Fa-f]{2})")


def c_type(kind: LlvmType) -> str:
    """The type of a C variable that holds a value. Raises: Untranslatable."""
    if kind.kind == "int":
        return f"uint{kind.container}_t"
    found = {"double": "double", "float": "float", "ptr": "uint8_t *", "void": "void"}.get(kind.kind)
    if found is None:
        raise Untranslatable(f"a value is an LLVM {kind.kind}")
    return found


def access(kind: LlvmType) -> str:
    """The name that the functions of wrapper/kernel.h have for a type in memory. Raises: Untranslatable."""
    c_type(kind)
    return f"i{kind.container}" if kind.kind == "int" else kind.kind


def integer(value: int, kind: LlvmType) -> str:
    """A constant."""
    value &= (1 << kind.bits) - 1
    if kind.container == 128:
        return f"((uint128_t)UINT64_C({value >> 64}) << 64 | UINT64_C({value & (1 << 64) - 1}))"
    return f"UINT64_C({value})" if kind.container == 64 else f"{value}u"


def real(token: str, kind: LlvmType) -> str:
    """A constant, to the last bit; LLVM writes those of single precision as a double's bits."""
    bits = int(token, 16) if token.startswith("0x") else struct.unpack("<Q", struct.pack("<d", float(token)))[0]
    number = struct.unpack("<d", struct.pack("<Q", bits))[0]
    whole = number.hex() if math.isfinite(number) else f"double_of_bits(UINT64_C({bits:#x}))"
    return f"(float){whole}" if kind.kind == "float" else whole


def signed(expression: str, kind: LlvmType) -> str:
    """An integer with its sign, in a type that has room for it."""
    if kind.bits == kind.container:
        return f"(int{kind.bits}_t){expression}"
    width = max(kind.container, 64)
    shift = width - kind.bits
    return f"((int{width}_t)((uint{width}_t){expression} << {shift}) >> {shift})"


def narrowed(expression: str, kind: LlvmType) -> str:
    """An expression, computed in a wider type, as an integer of its own."""
    if kind.bits == kind.container:
        return f"(uint{kind.bits}_t)({expression})"
    mask = integer(-1, kind)
    return f"(uint{kind.container}_t)(({expression}) & {mask})"


class ValueReader:
    """Reads values as C expressions. local, constant: C's names for LLVM's."""

    def __init__(self, local: Callable[[str], str], constant: Callable[[str], str]) -> None:
        self._local = local
        self._constant = constant

    def typed(self, tokens: Tokens) -> tuple[LlvmType, str]:
        """A type, attributes, and a value of it."""
        kind = tokens.type()
        tokens.skip(ATTRIBUTES)
        return kind, self.value(tokens, kind)

    def value(self, tokens: Tokens, kind: LlvmType) -> str:
        """A value of a type. Raises: Untranslatable."""
        word = tokens.next()
        if word.startswith("%"):
            return self._local(word)
        if word.startswith("@"):
            return self._constant(word)
        if word in ("true", "false"):
            return "1u" if word == "true" else "0u"
        if word in ("null", "zeroinitializer", "undef", "poison"):
            return "NULL" if kind.kind == "ptr" else "0"
        if kind.kind == "int" and re.fullmatch(r"-?\d+", word):
            return integer(int(word), kind)
        if kind.kind in ("double", "float"):
            return real(word, kind)
        if word == "getelementptr":
            tokens.skip(FLAGS | ATTRIBUTES)
            tokens.expect("(")
            found = self.place(tokens)
            tokens.expect(")")
            return found
        if word in ("inttoptr", "ptrtoint"):
            tokens.expect("(")
            _, inner = self.typed(tokens)
            tokens.expect("to")
            tokens.type()
            tokens.expect(")")
            return f"(uint8_t *)(uintptr_t){inner}" if word == "inttoptr" else f"(uint64_t)(uintptr_t){inner}"
        raise Untranslatable(f"`{tokens.text.strip()[:100]}` has the constant `{word}`")

    def place(self, tokens: Tokens) -> str:
        """The address that `getelementptr` gives of the type, base and indices that follow."""
        kind = tokens.type()
        tokens.expect(",")
        _, base = self.typed(tokens)
        terms = []
        first = True
        while tokens.accept(","):
            index_type, index = self.typed(tokens)
            number = _number(index, index_type)
            if first or kind.kind == "array":
                kind = kind if first else kind.items[0]
                size = kind.size
            elif number is None:
                raise Untranslatable(f"`{tokens.text.strip()[:100]}` has a field without a number")
            else:
                kind, size, number = kind.items[number], 1, kind.offset(number)
            first = False
            if number is None:
                terms.append(f" + {signed(index, index_type)}" + (f" * {size}" if size > 1 else ""))
            elif number:
                terms.append(f" + {number * size}")
        return f"({base}{''.join(terms)})"


def _number(index: str, kind: LlvmType) -> int | None:
    """The number that a constant index is."""
    found = _NUMBER.fullmatch(index)
    if not found:
        return None
    number = int(found[1] or found[2])
    return number - (1 << kind.bits) if number >> (kind.bits - 1) else number


def content(tokens: Tokens, kind: LlvmType) -> list[str]:
    """The elements of a constant array, as C constants. Raises: Untranslatable."""
    item = kind.items[0]
    word = tokens.peek()
    if word == "zeroinitializer":
        return ["0"]
    if word.startswith('c"'):
        raw = _BYTE.sub(lambda m: bytes([int(m[1], 16)]), word[2:-1].encode())
        return [str(byte) for byte in raw]
    reader = ValueReader(_no_name, _no_name)
    tokens.expect("[")
    found = [reader.typed(tokens)[1]]
    while tokens.accept(","):
        found.append(reader.typed(tokens)[1])
    if item.kind not in ("int", "double", "float"):
        raise Untranslatable(f"a constant holds an LLVM {item.kind}")
    return found


def _no_name(name: str) -> str:
    raise Untranslatable(f"a constant names `{name}`")
