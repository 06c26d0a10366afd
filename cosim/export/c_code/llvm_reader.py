"""Reads the text of optimised LLVM IR: constants, functions, blocks, and instructions as tokens."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

_TOKEN = re.compile(
    r"""c"[^"]*"                          # bytes
      | [%@](?:"[^"]*"|[-$.\w]+)          # a name
      | "[^"]*"
      | -?\d+\.\d+(?:e[+-]\d+)?           # a number, in decimal or by its bits
      | 0x[0-9A-Fa-f]+
      | -?\d+
      | ![\w.]*
      | \#\d+
      | \.\.\.
      | [\w.]+
      | [()\[\]{}<>,=*:|]""",
    re.VERBOSE,
)
_TARGET = re.compile(r'label (%(?:"[^"]*"|[-$.\w]+))')
_LABEL = re.compile(r'^("[^"]*"|[-$.\w]+):')


class Untranslatable(Exception):
    """What is not among that which kernels are made of; its text says what."""


@dataclass(frozen=True)
class LlvmType:
    """A type. kind: int, double, float, ptr, void, array, struct, or what values never have. bits: of an int."""

    kind: str
    bits: int = 0
    count: int = 0
    items: tuple[LlvmType, ...] = ()

    @property
    def size(self) -> int:
        """In bytes."""
        if self.kind == "array":
            return self.count * self.items[0].size
        if self.kind == "struct":
            end = self.offset(len(self.items))
            return -(-end // self.alignment) * self.alignment
        return {"int": self.container // 8, "double": 8, "float": 4, "ptr": 8}[self.kind]

    @property
    def container(self) -> int:
        """The bits of C's type that holds an int."""
        return next(bits for bits in (8, 16, 32, 64, 128) if bits >= self.bits)

    @property
    def alignment(self) -> int:
        """In bytes."""
        return max((item.alignment for item in self.items), default=0) or self.size

    def offset(self, field_: int) -> int:
        """Of a field of a struct; of the one after the last, its end."""
        end = 0
        for k, item in enumerate(self.items):
            begin = -(-end // item.alignment) * item.alignment
            if k == field_:
                return begin
            end = begin + item.size
        return end


class Tokens:
    """A statement's tokens, read from left to right."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.items = _TOKEN.findall(text)
        for at in range(len(self.items) - 1):
            if self.items[at] == "," and self.items[at + 1].startswith("!"):
                del self.items[at:]  # metadata says nothing of what is computed
                break
        self.at = 0

    def peek(self) -> str:
        """The next token, "" at the end."""
        return self.items[self.at] if self.at < len(self.items) else ""

    def next(self) -> str:
        """The next token, which is then read."""
        self.at += 1
        return self.items[self.at - 1] if self.at <= len(self.items) else ""

    def accept(self, token: str) -> bool:
        """Whether the next token is this one, which is then read."""
        found = self.peek() == token
        self.at += found
        return found

    def expect(self, token: str) -> None:
        """Read this token. Raises: Untranslatable where another one comes."""
        if not self.accept(token):
            raise Untranslatable(f"`{self.text.strip()[:100]}` has `{self.peek()}` where `{token}` is expected")

    def skip(self, words: frozenset[str]) -> None:
        """Read over flags and attributes, with what they have in parentheses."""
        while self.peek() in words or self.peek().startswith("#"):
            word = self.next()
            if word in _WITH_NUMBER and self.peek().isdigit():
                self.next()
            if self.peek() == "(" and word in ATTRIBUTES:
                self._skip_parentheses()

    def _skip_parentheses(self) -> None:
        depth = 0
        while self.peek():
            depth += {"(": 1, ")": -1}.get(self.next(), 0)
            if depth == 0:
                return
        raise Untranslatable(f"`{self.text.strip()[:100]}` ends within parentheses")

    def type(self) -> LlvmType:
        """Read a type. Raises: Untranslatable."""
        word = self.next()
        if word in ("double", "float", "ptr", "void", "metadata", "label"):
            return LlvmType(word)
        if re.fullmatch(r"i\d+", word) and int(word[1:]) <= 128:
            return LlvmType("int", int(word[1:]))
        if word == "[":
            count = int(self.next())
            self.expect("x")
            item = self.type()
            self.expect("]")
            return LlvmType("array", count=count, items=(item,))
        if word == "{":
            items = [self.type()]
            while self.accept(","):
                items.append(self.type())
            self.expect("}")
            return LlvmType("struct", items=tuple(items))
        raise Untranslatable(f"`{self.text.strip()[:100]}` has the type `{word}`")


#: What may be said of an instruction, an argument or a function without changing what is computed.
_FLAG = (
    "nuw nsw exact disjoint nneg samesign inbounds nusw tail musttail notail fastcc ccc coldcc volatile "
    "nnan ninf nsz arcp contract afn reassoc fast"
)
_ATTRIBUTE = (
    "noundef nonnull noalias readonly readnone writeonly nocapture captures align dereferenceable "
    "dereferenceable_or_null returned signext zeroext inreg immarg nofree initializes range nofpclass "
    "dead_on_unwind writable local_unnamed_addr unnamed_addr internal private hidden dso_local "
    "constant global linkonce_odr available_externally memory nocallback nosync nounwind willreturn"
)
FLAGS = frozenset(_FLAG.split())
ATTRIBUTES = frozenset(_ATTRIBUTE.split())
_WITH_NUMBER = frozenset(["align", "dereferenceable"])


@dataclass
class BasicBlock:
    """Instructions that follow each other, by the label of the block."""

    label: str
    lines: list[str] = field(default_factory=list)

    def following(self) -> list[str]:
        """The labels of the blocks to which its last instruction may lead."""
        return _TARGET.findall(self.lines[-1])


@dataclass
class FunctionText:
    """A function: its head, from `define` on, and its blocks."""

    head: str
    blocks: list[BasicBlock]

    def ordered(self) -> list[BasicBlock]:
        """The blocks that can be reached, each after all through which every way to it leads: reverse postorder."""
        known = {block.label: block for block in self.blocks}
        seen = {self.blocks[0].label}
        waiting = [(self.blocks[0], iter(self.blocks[0].following()))]
        done = []
        while waiting:
            block, labels = waiting[-1]
            label = next((label for label in labels if label not in seen), None)
            if label is None:
                done.append(block)
                waiting.pop()
            else:
                seen.add(label)
                waiting.append((known[label], iter(known[label].following())))
        return done[::-1]


@dataclass
class ModuleText:
    """constants: their lines."""

    constants: list[str]
    functions: list[FunctionText]


def read(text: str) -> ModuleText:
    """Take the text of a module apart."""
    module = ModuleText([], [])
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("@"):
            module.constants.append(line)
        elif line.startswith("define "):
            module.functions.append(_function(line, lines))
    return module


def _function(head: str, lines: Iterator[str]) -> FunctionText:
    unnamed = len(re.findall(r"[ (]%\d+(?=[,)])", head))
    blocks = [BasicBlock(f"%{unnamed}")]
    for line in lines:
        if line == "}":
            break
        if label := _LABEL.match(line):
            if len(blocks) > 1 or blocks[0].lines:
                blocks.append(BasicBlock(f"%{label[1]}"))
            else:
                blocks[0].label = f"%{label[1]}"
        elif line.strip() and not line.strip().startswith(";"):
            if _is_open(blocks[-1]):
                blocks[-1].lines[-1] += " " + line.strip()  # a switch, over several lines
            else:
                blocks[-1].lines.append(line)
    return FunctionText(head, blocks)


def _is_open(block: BasicBlock) -> bool:
    """Whether the last line is a switch whose list of cases goes on."""
    last = block.lines[-1].strip() if block.lines else ""
    return last.startswith("switch ") and not last.endswith("]")
