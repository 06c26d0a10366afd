"""Values that stand in a file of their own: a column of a CSV table, an array of an NPZ or NPY file.

The file is read with the diagram, so that its content is what a value is: whatever depends on the value depends on it.
Nothing in it is run: no pickled objects are loaded. Paths are relative to the YAML file that names them.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import CosimError, Position, TooLarge, WrongFile, WrongShape, WrongValue, nearest
from cosim.language import source
from cosim.language.source import MOST_FILE_BYTES, Node

TABLES, ARRAYS = (".csv", ".tsv", ".txt"), (".npz", ".npy")
"""How names of files end, in lower case, that are read as tables, and as arrays."""
_SEPARATORS = ",;\t"


@dataclass(frozen=True)
class FromFile:
    """A value that was read from a file: an array of numbers or truth values, without NaN.

    part: the column or array, as the diagram says it. digest: of the file's content.
    """

    path: Path
    part: tuple[tuple[str, str], ...]
    digest: str
    array: np.ndarray

    def __str__(self) -> str:
        return str(self.path)

    def plain(self, folder: Path = Path()) -> dict[str, str]:
        """What a diagram in a folder says to mean this very content."""
        file = os.path.relpath(self.path, folder) if not self.path.is_absolute() else str(self.path)
        return {"file": file, **dict(self.part), "sha256": self.digest}


def read(node: Node) -> FromFile:
    """What a mapping with a `file` says that conforms to the grammar.

    Raises: MissingFile, TooLarge, WrongFile, WrongShape, WrongValue, at the place in the diagram or in the table.
    """
    said: Mapping[str, Node] = node.value
    place = said["file"].position
    for key, child in said.items():
        if not isinstance(child.value, str):
            word = source.describe(child)
            raise WrongValue(f"`{key}` must be text, not {word}", child.position, "put it between quotation marks")
    folder = Path(place.file).parent if place.line else Path()
    path = Path(os.path.normpath(folder / said["file"].value))
    kind = path.suffix.lower()
    if kind not in (*TABLES, *ARRAYS):
        message = f"`{path.name}` is neither a table nor an array by its name"
        raise WrongFile(message, place, f"its name ends with {', '.join((*TABLES, *ARRAYS))}")
    other = "array" if kind in TABLES else "column"
    if other in said:
        fix = "write `column:`, or leave it out for all columns" if kind in TABLES else "write `array:`"
        raise WrongValue(f"`{path.name}` has no `{other}`", said[other].position, fix)
    content = source.read_bytes(path, place)
    digest = hashlib.sha256(content).hexdigest()
    if "sha256" in said and said["sha256"].value != digest:
        message = f"the content of `{path}` is another one than when this diagram was written"
        raise WrongFile(message, said["sha256"].position, "remove `sha256` if the new content is meant")
    part = said.get("column") or said.get("array")
    name = part.value if part else None
    try:
        array = _table(content, str(path), name) if kind in TABLES else _array(content, str(path), name)
    except CosimError as error:
        error.position = error.position or (part or said["file"]).position
        raise
    return FromFile(path, tuple((k, said[k].value) for k in ("column", "array") if k in said), digest, array)


def array_of(node: Node) -> np.ndarray | None:
    """The array that a node has, also one of a file; None for any other value."""
    array = node.value.array if isinstance(node.value, FromFile) else node.value
    return array if isinstance(array, np.ndarray) else None


def listed(node: Node) -> Node:
    """An array as the list that it would be in the diagram; any other value as it is."""
    array = array_of(node)
    return node if array is None else _as_node(array.tolist(), node.position)


def _as_node(value: Any, position: Position) -> Node:
    return Node([_as_node(item, position) for item in value] if isinstance(value, list) else value, position)


# ---- tables ----


@lru_cache(maxsize=8)
def _table(content: bytes, file: str, column: str | None) -> np.ndarray:
    """A column (rows,), or all (rows, columns), of which one alone is a column."""
    rows = _rows(content, file)
    if not rows:
        raise WrongFile(f"`{file}` has no row", fix="give it a line of names, and lines of numbers")
    line, first = rows[0]
    stripped = [name.strip() for name in first]
    names = None if all(map(_is_number, first)) and column not in stripped else stripped  # which may be years
    body = rows[1:] if names else rows
    if not body:
        raise WrongFile(f"`{file}` has no numbers below its names", Position(file, line, 1), "add lines of numbers")
    for line, row in body:
        if len(row) != len(first):
            message = f"line {line} of `{file}` has {len(row)} entries, the first one {len(first)}"
            raise WrongShape(message, Position(file, line, 1), "give every line as many entries, none of them empty")
    chosen = range(len(first)) if column is None else [_column(column, names, file)]
    said = names or [f"{k + 1}" for k in range(len(first))]
    found = [[_number(row[k], said[k], Position(file, line, 1)) for k in chosen] for line, row in body]
    array = np.array(found)
    return array[:, 0] if len(chosen) == 1 else array


def _rows(content: bytes, file: str) -> list[tuple[int, list[str]]]:
    """The lines that are neither empty nor comments, split, each with its number."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise WrongFile(f"`{file}` is not UTF-8 text", Position(file), "save it with the encoding UTF-8") from None
    begin = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    separator = next((sign for sign in _SEPARATORS if sign in begin), ",")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
    try:
        rows = [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise WrongFile(f"`{file}`: {error}", Position(file, reader.line_num, 1), "correct this line") from None
    return [(line, row) for line, row in rows if any(cell.strip() for cell in row) and not row[0].startswith("#")]


def _column(name: str, names: list[str] | None, file: str) -> int:
    if names is None:
        message = f"`{file}` has no line with names of columns, so there is no column `{name}`"
        fix = "add one as its first line (of numpy.savetxt, with comments=''), or leave `column` out for all columns"
        raise WrongValue(message, fix=fix)
    if names.count(name) > 1:
        raise WrongValue(f"`{file}` has several columns `{name}`", fix="rename one of them")
    if name not in names:
        raise WrongValue(f"`{file}` has no column `{name}`", fix=nearest(name, names))
    return names.index(name)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str, column: str, place: Position) -> float:
    """Raises: WrongValue for what is no number, NaN, or beyond all numbers."""
    where = f"column `{column}`"
    try:
        number = math.nan if "_" in text else float(text)
    except ValueError:
        said = f"`{text.strip()}` is no number" if text.strip() else "there is no number"
        fix = "write decimals with a point, not a comma" if "," in text else "give a number"
        raise WrongValue(f"{where}: {said}", place, fix) from None
    if math.isnan(number):
        raise WrongValue(f"{where}: `{text.strip()}` is no value to calculate with", place, "give a number")
    if math.isinf(number) and "inf" not in text.lower():
        raise WrongValue(f"{where}: `{text.strip()}` is beyond the range of numbers", place, "up to 1.7e308")
    return number


# ---- arrays ----


@lru_cache(maxsize=8)
def _array(content: bytes, file: str, name: str | None) -> np.ndarray:
    """The array of a NPY file, or that of a name in an NPZ file; the only one needs no name."""
    if not content.startswith(b"PK"):
        if name is not None:
            raise WrongValue(f"`{file}` holds one array, which has no name", fix="leave `array` out")
        return _checked(content, file, "the array")
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
        if name is None and len(entries) > 1:
            raise WrongValue(f"`{file}` has several arrays", fix=f"write array: {nearest('', entries, 'such as')}")
        wanted = next(iter(entries), "") if name is None else name
        if wanted not in entries:
            raise WrongValue(f"`{file}` has no array `{wanted}`", fix=nearest(wanted, entries) or "write one into it")
        if entries[wanted].file_size > MOST_FILE_BYTES:
            message = f"`{wanted}` in `{file}` has more than {MOST_FILE_BYTES >> 20} MiB"
            raise TooLarge(message, fix="keep what the block needs, in a smaller one")
        data = archive.read(entries[wanted])
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError, OSError, EOFError, ValueError) as error:
        raise _damaged(file, error) from None
    return _checked(data, file, f"`{wanted}`")


def _checked(data: bytes, file: str, what: str) -> np.ndarray:
    """The array that a NPY file is, after a look at its header, as that may ask for any memory."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        headers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, _, dtype = headers[version](stream)
        if dtype.kind not in "fiub":
            message = f"{what} in `{file}` is of type {dtype}"
            raise WrongValue(message, fix="save numbers: numpy.savez(file, A=array.astype(float))")
        if math.prod(shape) * dtype.itemsize > len(data):
            raise ValueError("it ends too early")
        array: np.ndarray = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, KeyError, OSError, EOFError, SyntaxError, TypeError) as error:
        raise _damaged(file, error) from None
    if array.dtype.kind == "f" and np.isnan(array).any():
        first = ", ".join(str(int(k)) for k in np.argwhere(np.isnan(array))[0])
        raise WrongValue(f"{what} in `{file}` is NaN at [{first}], no value to calculate with", fix="give a number")
    return array


def _damaged(file: str, error: Exception) -> WrongFile:
    return WrongFile(f"`{file}` is no readable NPZ or NPY file: {error}", fix="write it anew, with numpy.savez")
