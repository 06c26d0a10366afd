"""Lists of block types in the terminal: all there are, those of a file, those that some words find."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from cosim.errors import MissingFile, Position, UnknownBlock
from cosim.language.elementary import FUNCTIONS
from cosim.language.expression import CONSTANTS
from cosim.terminal import inspection
from cosim.terminal.screen import print_rows, print_warnings, print_wrapped, say
from cosim.wiring import catalogue, library
from cosim.wiring.catalogue import Group

WIDEST_NAME = 26


def print_all() -> None:
    """The installed blocks and those of the current folder, in groups."""
    groups = _groups()
    _print(groups)
    count = sum(len(group.blocks) for group in groups)
    rest = "`cosim blocks NAME` shows one's ports, parameters and equations; `cosim blocks WORD` looks for some."
    print_wrapped(f"{count} blocks. {rest} Arithmetic needs none: `cosim blocks expression`.", 0)
    sys.stdout.flush()
    print_warnings(library.broken())


def is_path(text: str) -> bool:
    """Whether words name a file or a folder, there or not."""
    return text.endswith((".py", ".yaml", ".yml", "/", ".fmu")) or Path(text).exists()


def print_own(path: Path) -> None:
    """The blocks of a file, a folder or a diagram. Raises: MissingFile where there is none."""
    groups = catalogue.own(path)
    if not groups:
        what = "no file of blocks is named in" if path.suffix in (".yaml", ".yml") else "there is no block in"
        raise MissingFile(f"{what} `{path}`", Position(str(path)), "`cosim new block NAME` writes one to begin with")
    _print(groups)


def print_found(words: str) -> None:
    """The one block of a name, or those whose names or texts have all the words.

    Raises: UnknownBlock where there are none.
    """
    if words.lower() == "expression":
        _print_expression()
        return
    groups = _groups()
    named = [block for group in groups for block in group.blocks if block.name.lower() == words.lower()]
    first = [block for block in named if block.written == block.name] or named
    if len(first) == 1:
        inspection.print_block(first[0].written)
        for other in (block for block in named if block is not first[0]):
            say(f"another one: {other.written}")
        return
    found = catalogue.matching(groups, words)
    if not found:
        close = get_close_matches(words, [block.name for group in groups for block in group.blocks], n=1, cutoff=0.5)
        fix = f"did you mean `{close[0]}`?" if close else "`cosim blocks` lists all there are"
        raise UnknownBlock(f"there is no block type `{words}`, nor one whose text has these words", None, fix)
    _print(found)


def _print_expression() -> None:
    """What arithmetic may be written in the place of a block type."""
    print_wrapped('Arithmetic as a block: a diagram writes  expression: "k*(r - x)"', 2)
    say("")
    print_wrapped("Its output is `y`, or those that are named: {r: …, phi: …}.", 2)
    say("")
    print_wrapped("names        the block's inputs, parameters and other outputs, and time (s)", 13)
    print_wrapped(f"constants    {', '.join(CONSTANTS)}", 13)
    print_wrapped("operators    + - * / // % **   < <= > >= == !=   and or not", 13)
    print_wrapped(f"functions    {', '.join(FUNCTIONS)}, if(condition, a, b)", 13)


def _groups() -> list[Group]:
    """The installed blocks, and last, where it is seen, what a person has written here."""
    return [*catalogue.installed(), *catalogue.own(Path(), known=library.files())]


def _print(groups: Sequence[Group]) -> None:
    for group in groups:
        print_wrapped(f"{group.title}: {group.summary}" if group.summary else f"{group.title}:", 2)
        width = min(WIDEST_NAME, max(len(_shown(block, group)) for block in group.blocks))
        print_rows([[_shown(block, group).ljust(width), block.summary] for block in group.blocks], indent="  ")
        say("")


def _shown(block: catalogue.Listed, group: Group) -> str:
    """The name by which a block is written; a file's stands above it."""
    return block.name if group.key == "python" else block.written
