"""What a word of a diagram or a study stands for: a key, a block type, a block, a port of one, a file."""

from __future__ import annotations

from dataclasses import dataclass

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Variable
from cosim.editor import grammar_paths
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading
from cosim.language.keys import TYPES, Key
from cosim.language.reader import endpoint
from cosim.wiring import settable

_FILES = ("fmu", "diagram")


@dataclass(frozen=True)
class Meant:
    """What is meant: of these, what there is. file: as it is written; block: its name in the diagram."""

    key: Key | None = None
    block: str = ""
    declaration: Declaration | None = None
    variable: Variable | None = None
    file: str = ""


def find(cursor: Cursor, reading: Reading) -> Meant:
    """What the word under the cursor stands for."""
    path = grammar_paths.in_diagram(cursor.path, reading.is_study)
    return _of_key(cursor, path, reading) if cursor.is_key else _of_value(cursor, path, reading)


def _of_key(cursor: Cursor, path: tuple[str, ...], reading: Reading) -> Meant:
    if path == ("blocks",):
        return Meant(block=cursor.word, declaration=reading.declarations.get(cursor.word))
    declaration = reading.declarations.get(path[1]) if len(path) == 3 and path[0] == "blocks" else None
    if declaration:
        variable = settable.sections(declaration).get(path[2], {}).get(cursor.word)
        return Meant(block=path[1], declaration=declaration, variable=variable)
    return Meant(grammar_paths.declared((*cursor.path, cursor.word.removesuffix("+")), reading.is_study))


def _of_value(cursor: Cursor, path: tuple[str, ...], reading: Reading) -> Meant:
    if not path:
        return Meant()
    last = path[-1]
    if last == "extends" or (last in _FILES and (len(path) == 3 or reading.is_study)):
        block = path[1] if len(path) == 3 else ""
        return Meant(block=block, declaration=reading.declarations.get(block), file=cursor.word)
    if len(path) == 3 and path[0] == "blocks" and last in TYPES:
        return Meant(block=path[1], declaration=reading.declarations.get(path[1]))
    block, port = endpoint(cursor.word)
    named = grammar_paths.names_signals(cursor.path, reading.is_study) or path == ("run", "order")
    if named and (block in reading.declarations or block in reading.inner):
        declaration = reading.declarations.get(block)
        variable = declaration.variables.get(port.partition("[")[0]) if declaration else None
        return Meant(block=block, declaration=declaration, variable=variable)
    return Meant(grammar_paths.declared(cursor.path, reading.is_study))
