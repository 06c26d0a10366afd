"""A value of a computation that is written down as LLVM IR while Python goes through it.

No operation may be put together with another, or replaced: there are no fast-math flags.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

_ARITHMETIC = {"add": "+", "sub": "-", "mul": "*"}


class Lines:
    """The lines of a function so far, each computed once, and the tables that it reads."""

    def __init__(self) -> None:
        self._values: dict[str, Traced] = {}
        self.tables: dict[str, tuple[int, ...]] = {}

    @property
    def text(self) -> str:
        """The instructions."""
        return "\n".join(f"  {value.text} = {line}" for line, value in self._values.items())

    def value(self, kind: str, line: str) -> Traced:
        """What an instruction computes."""
        if line not in self._values:
            self._values[line] = Traced(self, kind, f"%v{len(self._values)}")
        return self._values[line]


@dataclass(frozen=True, eq=False)
class Traced:  # noqa: PLW1641  # whose comparisons compute
    """A value. kind: double, i64 or i1; text: what IR calls it."""

    lines: Lines
    kind: str
    text: str

    def _operand(self, other: Any) -> str:
        if isinstance(other, Traced):
            assert other.kind == self.kind
            return other.text
        return _constant(other, self.kind)

    def _binary(self, real: str, integer: str, other: Any, swapped: bool = False) -> Traced:
        operands = self.text, self._operand(other)
        first, second = operands[::-1] if swapped else operands
        name = real if self.kind == "double" else integer
        assert name, f"no such operation of {self.kind}"
        return self.lines.value(self.kind, f"{name} {self.kind} {first}, {second}")

    def __add__(self, other: Any) -> Traced:
        return self._binary("fadd", "add", other)

    def __radd__(self, other: Any) -> Traced:
        return self._binary("fadd", "add", other, swapped=True)

    def __sub__(self, other: Any) -> Traced:
        return self._binary("fsub", "sub", other)

    def __rsub__(self, other: Any) -> Traced:
        return self._binary("fsub", "sub", other, swapped=True)

    def __mul__(self, other: Any) -> Traced:
        return self._binary("fmul", "mul", other)

    def __rmul__(self, other: Any) -> Traced:
        return self._binary("fmul", "mul", other, swapped=True)

    def __truediv__(self, other: Any) -> Traced:
        return self._binary("fdiv", "", other)

    def __rtruediv__(self, other: Any) -> Traced:
        return self._binary("fdiv", "", other, swapped=True)

    def __and__(self, other: Any) -> Traced:
        return self._binary("", "and", other)

    def __or__(self, other: Any) -> Traced:
        return self._binary("", "or", other)

    def __xor__(self, other: Any) -> Traced:
        return self._binary("", "xor", other)

    def __lshift__(self, other: Any) -> Traced:
        return self._binary("", "shl", other)

    def __rshift__(self, other: Any) -> Traced:
        return self._binary("", "lshr", other)

    def __neg__(self) -> Traced:
        return self.lines.value(self.kind, f"fneg double {self.text}") if self.kind == "double" else 0 - self

    def __abs__(self) -> Traced:
        return self.lines.value("double", f"call double @llvm.fabs.f64(double {self.text})")

    def _compared(self, real: str, integer: str, other: Any) -> Traced:
        name = f"fcmp {real}" if self.kind == "double" else f"icmp {integer}"
        return self.lines.value("i1", f"{name} {self.kind} {self.text}, {self._operand(other)}")

    def __lt__(self, other: Any) -> Traced:
        return self._compared("olt", "slt", other)

    def __le__(self, other: Any) -> Traced:
        return self._compared("ole", "sle", other)

    def __gt__(self, other: Any) -> Traced:
        return self._compared("ogt", "sgt", other)

    def __ge__(self, other: Any) -> Traced:
        return self._compared("oge", "sge", other)

    def __eq__(self, other: object) -> Any:
        return self._compared("oeq", "eq", other)

    def __ne__(self, other: object) -> Any:
        return self._compared("une", "ne", other)

    def select(self, first: Any, second: Any) -> Traced:
        """As `operations.select`."""
        traced = next((v for v in (first, second) if isinstance(v, Traced)), None)
        kind = traced.kind if traced else "double" if isinstance(first, float) else "i64"
        texts = [v.text if isinstance(v, Traced) else _constant(v, kind) for v in (first, second)]
        return self.lines.value(kind, f"select i1 {self.text}, {kind} {texts[0]}, {kind} {texts[1]}")

    def bits(self) -> Traced:
        """As `operations.bits`."""
        return self.lines.value("i64", f"bitcast double {self.text} to i64")

    def real(self) -> Traced:
        """As `operations.real`."""
        return self.lines.value("double", f"bitcast i64 {self.text} to double")

    def sqrt(self) -> Traced:
        """As `operations.sqrt`."""
        return self.lines.value("double", f"call double @llvm.sqrt.f64(double {self.text})")

    def picked_from(self, table: tuple[int, ...]) -> Traced:
        """As `operations.pick`."""
        name = next((n for n, t in self.lines.tables.items() if t == table), f"table{len(self.lines.tables)}")
        self.lines.tables[name] = table
        place = f"getelementptr inbounds [{len(table)} x i64], ptr @{{{name}}}, i64 0, i64 {self.text}"
        return self.lines.value("i64", f"load i64, ptr {self.lines.value('ptr', place).text}")


def _constant(value: Any, kind: str) -> str:
    if kind == "double":
        return f"0x{struct.unpack('<Q', struct.pack('<d', float(value)))[0]:016X}"
    assert isinstance(value, int)
    return ("true" if value else "false") if kind == "i1" else str(value)
