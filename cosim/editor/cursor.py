"""Which keys a place in a YAML text stands below, by indentation and brackets alone: half a line is no obstacle."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

_QUOTED = r"""(?:"([^"]*)"|'([^']*)'|"""
_KEY = re.compile(_QUOTED + r"""([^\s,\[\]{}#&*!|>'"%@`-][^#]*?))\s*:(?=\s|$)""")
_KEY_IN_BRACES = re.compile(_QUOTED + r"""([^\s,\[\]{}#&*!|>'"%@`-][^:#{}\[\],]*?))\s*:(?=\s|$)""")
_BEFORE_VALUE = re.compile(r"\s*(?:[&!]\S*\s+)*")
_WORD = re.compile(r"(?:[\w./@~+-]|:(?=\S))+")
_FLOW = "[{"


@dataclass(frozen=True)
class Cursor:
    """A word of a text, or the place of one that is to come. Lines and columns count from 0, as editors do.

    path: the keys that it stands below; those of a value with its own. is_key: whether it is, or begins, an entry of a
    mapping; colon: whether it is followed by one. begin, end: its columns; typed: what is there up to the cursor. In a
    comment there is no word, and no key.
    """

    path: tuple[str, ...]
    is_key: bool
    colon: bool
    line: int
    begin: int
    end: int
    word: str
    typed: str


def find(text: str, line: int, column: int) -> Cursor:
    """The word at a place of a text."""
    lines = text.split("\n")
    row = lines[line].rstrip("\r") if line < len(lines) else ""
    column = min(column, len(row))
    begin, end = next(
        ((m.start(), m.end()) for m in _WORD.finditer(row) if m.start() <= column <= m.end()), [column] * 2
    )
    if _ends_in_comment(row[:begin]):
        return Cursor(("#",), False, False, line, begin, end, "", "")
    outline = _Outline()
    for before in lines[:line]:
        outline.pass_line(before.rstrip("\r"))
    first = outline.enter(row[:begin])
    colon = bool(re.match(r"['\"]?\s*:(\s|$)", row[end:]))
    return Cursor(outline.path, first or colon, colon, line, begin, end, row[begin:end], row[begin:column])


def _ends_in_comment(part: str) -> bool:
    quote, before = "", " "
    for sign in part:
        if quote:
            quote = "" if sign == quote else quote
        elif before in " [{,:" and sign in "\"'":
            quote = sign
        elif before == " " and sign == "#":
            return True
        before = sign
    return False


@dataclass
class _Outline:
    """What has been passed: block mappings with their indentation, `-` for an item; flow collections that are open."""

    blocks: list[tuple[int, str]] = field(default_factory=list)
    flow: list[tuple[str, str]] = field(default_factory=list)  # the bracket, and of a mapping the key it is at
    literal: int | None = None  # the indentation of the key of a text over several lines
    quote: str = ""

    @property
    def path(self) -> tuple[str, ...]:
        keys = [key for _, key in self.blocks if key != "-"] + [key for _, key in self.flow if key]
        return tuple(key.removesuffix("+") for key in keys)

    def pass_line(self, line: str) -> None:
        """Go over a whole line."""
        self._give_up(line)
        if self.flow or self.quote:
            self._pass_values(line, 0)
        elif line.strip() and not line.lstrip().startswith(("#", "---", "...")):
            self.enter(line)

    def enter(self, part: str) -> bool:
        """Go over the begin of a line; whether what comes next begins an entry."""
        self._give_up(part)
        if self.flow or self.quote:
            self._pass_values(part, 0)
            return self._at_entry()
        at = len(part) - len(part.lstrip(" "))
        if self.literal is not None:
            if at > self.literal:
                return False
            self.literal = None
        dash = False
        while part[at : at + 2] in ("- ", "-"):
            while self.blocks and (self.blocks[-1][0] > at or self.blocks[-1] == (at, "-")):
                self.blocks.pop()
            self.blocks.append((at, "-"))
            at += 1
            at += len(part[at:]) - len(part[at:].lstrip(" "))
            dash = True
        while self.blocks and self.blocks[-1][0] >= at:
            self.blocks.pop()
        if key := _KEY.match(part, at):
            self.blocks.append((at, _name(key)))
            self._begin_value(part, key.end(), at)
            return bool(self.flow) and self._at_entry()
        if part[at:].strip():
            self._begin_value(part, at, at)
            return bool(self.flow) and self._at_entry()
        return not dash

    def _give_up(self, line: str) -> None:
        """Brackets and quotation marks that nobody has closed end where a line stands no deeper than what has them."""
        at = len(line) - len(line.lstrip(" "))
        if (self.flow or self.quote) and self.blocks and at <= self.blocks[-1][0] and line[at : at + 1] not in "]}":
            self.flow, self.quote = [], ""

    def _at_entry(self) -> bool:
        return bool(self.flow) and self.flow[-1] == ("{", "")

    def _begin_value(self, line: str, at: int, indent: int) -> None:
        """A value begins; plain text may have brackets that mean nothing."""
        found = _BEFORE_VALUE.match(line, at)
        begin = found.end() if found else at
        sign = line[begin : begin + 1]
        if sign in ("|", ">"):
            self.literal = indent
        elif sign and sign in _FLOW + "\"'":
            self._pass_values(line, begin)

    def _pass_values(self, line: str, at: int) -> None:
        while at < len(line):
            sign = line[at]
            if self.quote:
                self.quote = "" if sign == self.quote else self.quote
            elif sign == "#" and line[at - 1 : at] in ("", " "):
                return
            elif self._at_entry() and (key := _KEY_IN_BRACES.match(line, at)):
                self.flow[-1] = ("{", _name(key))
                at = key.end()
                continue
            elif sign in "\"'":
                self.quote = sign
            else:
                self._bracket(sign)
            if not (self.flow or self.quote):
                return
            at += 1

    def _bracket(self, sign: str) -> None:
        if sign in _FLOW:
            self.flow.append((sign, ""))
        elif sign in "]}" and self.flow:
            self.flow.pop()
        elif sign == "," and self.flow:
            self.flow[-1] = (self.flow[-1][0], "")


def _name(key: re.Match[str]) -> str:
    return key[1] or key[2] or key[3] or ""
