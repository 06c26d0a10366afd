"""What may be written at a place of a diagram or a study: keys, block types, signals, words."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Variable, shape_text
from cosim.editor import grammar_paths, meanings
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading
from cosim.language.formula import WORDS
from cosim.language.keys import ANY, FORMULA, TRUTH, TYPES
from cosim.wiring import catalogue, settable, variable_words
from cosim.wiring.catalogue import Group

MOST_MEMBERS = 20
_TAKEN = re.compile(r"([\w/-]+)\.([\w.]+)\[$")


@dataclass(frozen=True)
class Suggestion:
    """A word, what else is written with it, a line about it, and a page.

    first: it is what is most likely meant. kind: of KINDS.
    """

    label: str
    kind: str
    detail: str = ""
    page: str = ""
    ending: str = ""
    first: bool = False


KINDS = ("key", "type", "block", "signal", "word", "function")


def suggest(cursor: Cursor, reading: Reading, own: Callable[[], list[Group]]) -> list[Suggestion]:
    """All that may stand there, whatever is typed of it: an editor looks for what fits that.

    own: gives the blocks of a project's Python files.
    """
    found = list(_keys(cursor, reading) if cursor.is_key else _values(cursor, reading, own))
    return list({suggestion.label: suggestion for suggestion in found}.values())


def _keys(cursor: Cursor, reading: Reading) -> Iterator[Suggestion]:
    path, ending = grammar_paths.in_diagram(cursor.path, reading.is_study), "" if cursor.colon else ": "
    section = grammar_paths.declared(cursor.path, reading.is_study)
    if path == ("blocks",):
        for name, declaration in reading.declarations.items():
            yield Suggestion(name, "block", declaration.name, meanings.of_type(declaration), ending)
    if len(path) == 3 and path[0] == "blocks":
        yield from _declared(path[1], path[2], reading, ending)
    if path == ("fleets",) and reading.diagram:
        yield from (Suggestion(name, "word", ending=ending) for name in reading.diagram.fleets)
    kind = _kind(path, reading)
    for name, key in section.below.items() if section else ():
        if name != ANY and not (kind and kind not in key.kinds) and not (kind and name in TYPES and name != kind):
            yield Suggestion(name, "key", key.help, meanings.of_key(name, key), ending)


def _kind(path: tuple[str, ...], reading: Reading) -> str:
    """Of which kind the block is whose keys are written; "" if it is none yet, or in doubt."""
    entry = reading.diagram.blocks.get(path[1]) if reading.diagram and len(path) == 2 and path[0] == "blocks" else None
    return entry.kind if entry else ""


def _declared(block: str, section: str, reading: Reading, ending: str) -> Iterator[Suggestion]:
    """What a block's type, or the diagram that it is, has below a section."""
    if block in reading.inner and section == "inputs":
        yield from (Suggestion(name, "signal", "input", ending=ending) for name in reading.inner[block].inputs)
    declaration = reading.declarations.get(block)
    known = settable.sections(declaration).get(section) if declaration else None
    if declaration is None or known is None:
        return
    given = _given(block, section, reading)
    for name, variable in known.items():
        if variable:
            yield Suggestion(name, "signal", _line(declaration, variable), "", ending, name not in given)
        else:
            yield Suggestion(name, "word", _size(declaration, name), "", ending)


def _size(declaration: Declaration, name: str) -> str:
    dimension = declaration.dimensions.get(name)
    return dimension.description if dimension else ""


def _given(block: str, section: str, reading: Reading) -> Iterable[str]:
    entry = reading.diagram.blocks.get(block) if reading.diagram else None
    return getattr(entry, section) if entry else ()


def _line(declaration: Declaration, variable: Variable) -> str:
    unit = variable_words.unit(variable)
    head = shape_text(variable.shape) + (f" {unit}" if unit else "")
    return "; ".join(part for part in (head.strip(), *variable_words.notes(declaration, variable)) if part)


def _values(cursor: Cursor, reading: Reading, own: Callable[[], list[Group]]) -> Iterator[Suggestion]:
    path = grammar_paths.in_diagram(cursor.path, reading.is_study)
    key = grammar_paths.declared(cursor.path, reading.is_study)
    if key and key.type:
        yield from (Suggestion(word, "word", key.help) for word in key.type.known)
        yield from (Suggestion(word, "word", key.help) for word in (("true", "false") if key.type is TRUTH else ()))
    if path[:1] == ("blocks",) and len(path) == 3:
        yield from _of_block(path[2], reading, own)
    if path == ("run", "order"):
        yield from (Suggestion(name, "block", d.name) for name, d in reading.declarations.items())
    if grammar_paths.names_signals(cursor.path, reading.is_study):
        taker = _taker(path, reading)
        yield from _signals(reading, taker, taps=path[:1] != ("blocks",))
        if path[0] == "requirements" or (key and key.type is FORMULA):
            yield from (Suggestion(word, "function") for word in WORDS)


def _of_block(key: str, reading: Reading, own: Callable[[], list[Group]]) -> Iterator[Suggestion]:
    """Block types, and the fleets that a block may be of."""
    groups = catalogue.installed() if key == "block" else own() if key == "python" else ()
    for block in (block for group in groups for block in group.blocks):
        name = block.written if key == "block" else os.path.relpath(block.written, reading.path.parent)
        yield Suggestion(name, "type", block.summary)
    if key == "per" and reading.diagram:
        yield from (Suggestion(name, "word", f"{count}") for name, count in reading.diagram.fleets.items())


def _taker(path: tuple[str, ...], reading: Reading) -> Variable | None:
    """The input that is wired at a path."""
    declaration = reading.declarations.get(path[1]) if path[:1] == ("blocks",) and len(path) > 3 else None
    return declaration.variables.get(path[3]) if declaration else None


def _signals(reading: Reading, taker: Variable | None, taps: bool) -> Iterator[Suggestion]:
    """`block.port` of all outputs; taps: also of what only recordings and the like may read."""
    for name, diagram in reading.inner.items():
        yield from (Suggestion(f"{name}.{port}", "signal", "output") for port in diagram.outputs)
    for name, declaration in reading.declarations.items():
        for variable in declaration.variables.values():
            if variable.causality == "output" or (taps and _is_tapped(variable)):
                line = f"{declaration.name}: {_line(declaration, variable)}"
                fits = taker is not None and (variable.unit, variable.dtype) == (taker.unit, taker.dtype)
                yield Suggestion(f"{name}.{variable.name}", "signal", line, first=fits)


def _is_tapped(variable: Variable) -> bool:
    return variable.causality in ("local", "parameter") and not variable.dtype.hasobject


def members(before: str, reading: Reading) -> list[Suggestion]:
    """What may stand in the brackets behind `block.port`, which ends what is before the cursor."""
    found = _TAKEN.search(before)
    component = reading.network.components.get(found[1]) if found and reading.network else None
    variable = component.declaration.variables.get(found[2]) if found and component else None
    axes = component.signal_axes(variable) if component and variable else None
    if not axes:
        return []
    size = axes[0].size
    numbers = [Suggestion(str(k + 1), "word", first=True) for k in range(min(size, MOST_MEMBERS))]
    return [*numbers, Suggestion(f"1..{size}", "word", "all members")]
