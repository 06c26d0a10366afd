"""What may come next on a command line: commands, options, files, blocks, keys.

It answers the Tab key, so nothing slow is imported.

Which commands and options there are stands in a table in the cache folder, made anew when this package changes.
"""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from cosim.machine import cache

#: By how the names of arguments end, or their placeholders: which files they are.
FILES = {
    "diagram": (".yaml", ".yml", ".fmu"),
    "study": (".yaml", ".yml"),
    "first": (".nc",),
    "second": (".nc",),
    "results": (".nc",),
    "file": (".fmu",),
    "folder": (),
}
ANY_FILE = ("",)
MOST_FILES, MOST_LAYERS = 300, 20
_CLASS = re.compile(r"^class (\w+)\((?:\w+\.)?(?:Block|Measure)\)", re.MULTILINE)

Found = dict[str, str]
"""Words that may stand there, with a line of help each."""


def candidates(line: str) -> tuple[str, Found]:
    """The word that is being typed at the end of a line that begins with the program, and what it may become."""
    words = _split(line)
    done, typed = words[1:-1], words[-1]
    table = _table()
    command = next((word for word in done if not word.startswith("-")), "")
    known: dict[str, Any] = table["commands"].get(command, {"options": table["options"], "arguments": []})
    option = known["options"].get(done[-1]) if done else None
    if option and option["takes"]:
        found = _values(done[-1], option, words, typed, table)
    elif typed.startswith("-"):
        found = {name: option["help"] for name, option in known["options"].items()}
    elif not command:
        found = {name: entry["help"] for name, entry in table["commands"].items()}
    else:
        found = _arguments(command, known, done, typed, table)
    return typed, {word: help_ for word, help_ in found.items() if word.startswith(typed)}


def _split(line: str) -> list[str]:
    """The words of a line, the last one as far as it is typed; quotation marks may be open."""
    for end in ("", '"', "'"):
        with suppress(ValueError):
            words = shlex.split(line + end)
            return words if words and (end or not line[-1:].isspace()) else [*words, ""]
    return ["", ""]


def _values(name: str, option: dict[str, Any], words: list[str], typed: str, table: dict[str, Any]) -> Found:
    if option["choices"]:
        return dict.fromkeys(option["choices"], "")
    if name == "--set":
        return _keys(_paths(words, table), typed)
    if name == "--swap":
        block, equals, _ = typed.partition("=")
        if not equals:
            return {f"{name.split('.')[1]}=": "" for name in _paths(words, table) if name.startswith("blocks.")}
        types = dict.fromkeys(_blocks(), "") | _files(typed.partition("=")[2], (".fmu", ".yaml"))
        return {f"{block}={type_}": help_ for type_, help_ in types.items()}
    return _files(typed, ANY_FILE)


def _arguments(command: str, known: dict[str, Any], done: list[str], typed: str, table: dict[str, Any]) -> Found:
    """What may be an argument without a name; of the one that is due."""
    given = done[done.index(command) + 1 :]
    count = 0
    for before, word in zip([command, *given], given, strict=False):
        takes = known["options"].get(before, {}).get("takes")
        count += not word.startswith("-") and not takes
    arguments = known["arguments"]
    if not arguments:
        return {}
    due = arguments[min(count, len(arguments) - 1)]
    if count >= len(arguments) and not due["several"]:
        return {}
    if due["choices"]:
        return dict.fromkeys(due["choices"], "")
    if command == "keys":
        return dict.fromkeys(table["sections"], "")
    if command == "blocks":
        return dict.fromkeys(_blocks(), "") | _files(typed, (".py", ".yaml"))
    if command == "export" and due["name"] == "blocks":
        return {path.split(".")[1]: "" for path in _paths(done, table) if path.startswith("blocks.")}
    return _files(typed, FILES[due["name"]]) if due["name"] in FILES else {}


def _files(typed: str, endings: tuple[str, ...]) -> Found:
    """Files that end so, and folders, which end with a slash."""
    folder = typed.rpartition("/")[0] + "/" if "/" in typed else ""
    found: Found = {}
    with suppress(OSError), os.scandir(Path(folder or ".").expanduser()) as entries:
        for entry in entries:
            if entry.name.startswith(".") and not typed[len(folder) :].startswith("."):
                continue
            if entry.is_dir():
                found[f"{folder}{entry.name}/"] = ""
            elif entry.name.lower().endswith(endings):
                found[f"{folder}{entry.name}"] = ""
    return dict(sorted(found.items()))


def _keys(paths: list[str], typed: str) -> Found:
    """The dotted paths, up to the next dot; a whole one is followed by its value."""
    found: Found = {}
    for path in paths:
        if path.startswith(typed):
            dot = path.find(".", len(typed))
            found[path[: dot + 1] if dot >= 0 else f"{path}="] = ""
    return found


def _paths(words: list[str], table: dict[str, Any]) -> list[str]:
    """The paths to all values of the diagram that a line names, and those that any has."""
    found = dict.fromkeys(table["paths"])
    for word in words:
        if word.endswith((".yaml", ".yml")):
            for tree in _layers(Path(word).expanduser()):
                found |= dict.fromkeys(_leaves(tree, ""))
    return list(found)


def _layers(path: Path) -> Iterator[Any]:
    """A diagram and those that it extends, as far as they can be read."""
    from cosim.errors import CosimError, Problems
    from cosim.language import source

    for _ in range(MOST_LAYERS):
        try:
            tree = source.read(path, Problems())
        except (CosimError, OSError):
            return
        yield tree
        extends = tree.value.get("extends")
        if extends is None or not isinstance(extends.value, str):
            return
        path = path.parent / extends.value


def _leaves(node: Any, path: str) -> Iterator[str]:
    if isinstance(node.value, dict) and node.value:
        for key, child in node.value.items():
            yield from _leaves(child, f"{path}.{key}".strip("."))
    elif path:
        yield path


def _blocks() -> Iterator[str]:
    """Block types by the text of the files of the library, and of those here."""
    package = Path(__file__).parents[1]
    home = package / "blocks" if (package / "blocks").is_dir() else package.parent / "blocks"
    for file in sorted(home.glob("*.py"))[:MOST_FILES]:
        yield from _CLASS.findall(file.read_text(encoding="utf-8", errors="replace"))
    for file in [*sorted(Path().glob("*.py")), *sorted(Path().glob("*/*.py"))][:MOST_FILES]:
        with suppress(OSError):
            yield from (f"{file.as_posix()}:{name}" for name in _CLASS.findall(file.read_text(errors="replace")))


def _table() -> dict[str, Any]:
    """Commands, options and keys: from the cache folder where it is of these very files."""
    folder = Path(__file__).parents[1]
    files = sorted([*folder.glob("terminal/**/*.py"), *folder.glob("language/keys.py"), *folder.glob("study/*keys.py")])
    key = " ".join(f"{file.name}:{found.st_mtime_ns}:{found.st_size}" for file in files for found in [file.stat()])
    path = cache.folder() / "completion.json"
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["key"] == key:
            return dict(kept["table"])
    from cosim.machine import files as whole_files
    from cosim.terminal import command_table

    table = command_table.build()
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_files.fresh(path) as new:
            new.write_text(json.dumps({"key": key, "table": table}), encoding="utf-8")
    return table
