"""One function of LLVM IR as C: its blocks are labels, its values constants, and a `phi` a variable.

A phi is set on each way into its block, first to a second variable, as the phis of a block change at once.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from cosim.export.c_code import c_calls
from cosim.export.c_code.c_expressions import BIT, computed
from cosim.export.c_code.c_values import ValueReader, access, c_type, signed
from cosim.export.c_code.llvm_reader import ATTRIBUTES, FLAGS, FunctionText, LlvmType, Tokens, Untranslatable

_KERNEL = [LlvmType("double"), LlvmType("ptr"), LlvmType("ptr")]


class Head:
    """The head of a function: its name, and the types and names of its result and parameters."""

    def __init__(self, text: str) -> None:
        tokens = Tokens(text)
        tokens.expect("define")
        tokens.skip(FLAGS | ATTRIBUTES)
        self.result = tokens.type()
        self.name = tokens.next()
        tokens.expect("(")
        self.parameters: list[tuple[LlvmType, str]] = []
        while not tokens.accept(")"):
            kind = tokens.type()
            tokens.skip(ATTRIBUTES)
            named = tokens.peek().startswith("%")
            self.parameters.append((kind, tokens.next() if named else f"%{len(self.parameters)}"))
            tokens.accept(",")


class FunctionWriter:
    """Writes a function. names: C's, of the module's constants and functions; kernel: whether it is called as one."""

    def __init__(self, head: Head, text: FunctionText, names: Mapping[str, str], kernel: bool) -> None:
        self._head = head
        self._text = text
        self._names = names
        self._kernel = kernel
        self._locals: dict[str, str] = {}
        self._declared: list[str] = []  # at the top
        self._lines: list[str] = []
        self._labels = {block.label: f"b{k}" for k, block in enumerate(text.blocks)}
        self._ways: dict[str, list[tuple[str, dict[str, str]]]] = {}  # the phis of a block, by where it comes from
        self._reader = ValueReader(self._local, self._constant)
        self._block = ""

    def declaration(self) -> str:
        """The head in C: that of a kernel as wrapper/model.h wants it, or a private one."""
        name = self._names[self._head.name]
        if self._kernel:
            time, base, frame = (self._local(parameter) for _, parameter in self._head.parameters)
            return f"KERNEL int32_t {name}(double {time}, uint8_t *{base}, int64_t *{frame}_)"
        parameters = ", ".join(f"{c_type(kind)} {self._local(name)}" for kind, name in self._head.parameters)
        return f"static {c_type(self._head.result)} {name}({parameters or 'void'})"

    def definition(self) -> str:
        """The whole function. Raises: Untranslatable."""
        declaration = self.declaration()
        if self._kernel:
            frame = self._local(self._head.parameters[2][1])
            self._declared.append(f"    uint8_t *const {frame} = (uint8_t *){frame}_;")
        blocks = self._text.ordered()
        for block in blocks:
            self._find_phis(block.label, block.lines)
        for k, block in enumerate(blocks):
            self._block = block.label
            if k:
                self._lines.append(f"{self._labels[block.label]}:;")
            self._lines += [f"    {name} = {name}_;" for name, _ in self._ways[block.label]]
            for line in block.lines:
                if " = phi " not in line:
                    self._statement(line)
        return "\n".join([f"{declaration} {{", *self._declared, *self._lines, "}"])

    # ---- names ----

    def _local(self, name: str) -> str:
        return self._locals.setdefault(name, f"v{len(self._locals)}")

    def _constant(self, name: str) -> str:
        if name not in self._names:
            raise Untranslatable(f"it names `{name}`")
        return self._names[name]

    def _set(self, name: str, kind: LlvmType, expression: str) -> None:
        self._lines.append(f"    {c_type(kind)} const {self._local(name)} = {expression};")

    # ---- from block to block ----

    def _find_phis(self, label: str, lines: list[str]) -> None:
        self._ways[label] = []
        for line in lines:
            tokens = Tokens(line)
            name = tokens.next()
            if not (tokens.accept("=") and tokens.accept("phi")):
                continue
            tokens.skip(FLAGS)
            kind = tokens.type()
            values = {}
            while tokens.accept("["):
                value = self._reader.value(tokens, kind)
                tokens.expect(",")
                values[tokens.next()] = value
                tokens.expect("]")
                tokens.accept(",")
            variable = self._local(name)
            self._declared += [f"    {c_type(kind)} {variable}{end};" for end in ("", "_")]
            self._ways[label].append((variable, values))

    def _go(self, label: str) -> str:
        moves = [f"{name}_ = {values[self._block]};" for name, values in self._ways[label]]
        return " ".join([*moves, f"goto {self._labels[label]};"])

    def _branch(self, tokens: Tokens) -> None:
        if tokens.accept("label"):
            self._lines.append(f"    {self._go(tokens.next())}")
            return
        _, condition = self._reader.typed(tokens)
        targets = []
        while tokens.accept(","):
            tokens.expect("label")
            targets.append(self._go(tokens.next()))
        self._lines.append(f"    if ({condition}) {{ {targets[0]} }} else {{ {targets[1]} }}")

    def _switch(self, tokens: Tokens) -> None:
        _, value = self._reader.typed(tokens)
        tokens.expect(",")
        tokens.expect("label")
        otherwise = tokens.next()
        tokens.expect("[")
        self._lines.append(f"    switch ({value}) {{")
        while not tokens.accept("]"):
            _, case = self._reader.typed(tokens)
            tokens.expect(",")
            tokens.expect("label")
            self._lines.append(f"    case {case}: {self._go(tokens.next())}")
        self._lines += [f"    default: {self._go(otherwise)}", "    }"]

    def _return(self, tokens: Tokens) -> None:
        kind = tokens.type()
        value = "" if kind.kind == "void" else " " + self._reader.value(tokens, kind)
        self._lines.append(f"    return{' (int32_t)' if self._kernel else ''}{value};")

    # ---- statements ----

    def _statement(self, line: str) -> None:
        tokens = Tokens(line)
        name = tokens.next() if tokens.peek().startswith("%") else ""
        if name:
            tokens.expect("=")
        tokens.skip(FLAGS)
        operation = tokens.next()
        tokens.skip(FLAGS)
        others = {"br": self._branch, "switch": self._switch, "ret": self._return, "store": self._store}
        named = {"call": self._call, "alloca": self._allocate, "extractvalue": self._extract}
        if operation in others:
            others[operation](tokens)
        elif operation in named:
            named[operation](name, tokens)
        elif operation == "unreachable":
            self._lines.append("    __builtin_unreachable();")
        else:
            self._set(name, *computed(self._reader, operation, tokens))

    def _store(self, tokens: Tokens) -> None:
        kind, value = self._reader.typed(tokens)
        tokens.expect(",")
        _, place = self._reader.typed(tokens)
        self._lines.append(f"    store_{access(kind)}({place}, {value});")

    def _allocate(self, name: str, tokens: Tokens) -> None:
        size = tokens.type().size
        if tokens.accept(",") and tokens.peek() != "align":
            tokens.type()
            size *= int(tokens.next())
        variable = self._local(name)
        self._declared.append(f"    _Alignas(16) uint8_t {variable}[{size}];")

    def _extract(self, name: str, tokens: Tokens) -> None:
        """A part of what a function that tells of an overflow gives."""
        kind = tokens.type()
        whole = self._local(tokens.next())
        tokens.expect(",")
        part = int(tokens.next())
        self._set(name, kind.items[part], f"{whole}_{part}")

    # ---- calls ----

    def _call(self, name: str, tokens: Tokens) -> None:
        tokens.skip(FLAGS | ATTRIBUTES)
        result = tokens.type()
        callee = tokens.next()
        if callee.startswith("@llvm.") and callee[6:].startswith(c_calls.SILENT):
            return
        tokens.expect("(")
        arguments = []
        while not tokens.accept(")"):
            arguments.append(self._reader.typed(tokens))
            tokens.accept(",")
        if found := c_calls.OVERFLOWING.fullmatch(callee[1:]):
            self._overflow(name, found, arguments)
        elif name:
            self._set(name, result, self._called(callee, result, arguments))
        else:
            self._lines.append(f"    {self._called(callee, result, arguments)};")

    def _called(self, callee: str, result: LlvmType, arguments: list[tuple[LlvmType, str]]) -> str:
        values = [value for _, value in arguments]
        if callee.startswith("%"):  # a kernel, by its address
            if [kind for kind, _ in arguments] != _KERNEL:
                raise Untranslatable("it calls an address as no kernel is called")
            called = f"((Kernel)(uintptr_t){self._local(callee)})"
            return f"(uint32_t){called}({values[0]}, {values[1]}, (int64_t *){values[2]})"
        if callee in self._names:
            return f"{self._names[callee]}({', '.join(values)})"
        return c_calls.of_library(callee[1:], result, values)

    def _overflow(self, name: str, found: re.Match[str], arguments: list[tuple[LlvmType, str]]) -> None:
        sign, operation, bits = found.groups()
        variable, kind = self._local(name), LlvmType("int", int(bits))
        values = [signed(value, kind) if sign == "s" else value for _, value in arguments]
        to = f"(int{bits}_t *)&{variable}_0" if sign == "s" else f"&{variable}_0"
        self._lines.append(f"    {c_type(kind)} {variable}_0;")
        call = f"__builtin_{operation}_overflow({', '.join(values)}, {to})"
        self._lines.append(f"    {c_type(BIT)} const {variable}_1 = {call};")
