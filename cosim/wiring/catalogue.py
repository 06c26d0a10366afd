"""Which block types there are, in groups as people look for them: of the library, of packs, of a project's own files.

Own files are only read for it, none is run.
"""

from __future__ import annotations

import ast
import os
import re
import sys
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from cosim.authoring.block import Block
from cosim.errors import CosimError, MissingFile, Position, Problems, WrongFile
from cosim.language import diagram, source
from cosim.wiring import library

OWN_LIBRARY = "cosim.blocks"
MOST_FILES, MOST_FOLDERS = 1000, 300
"""That are looked at in a folder and those inside it."""
_DEEPEST = 3
_BASES = ("Block", "Measure")
_SKIPPED = ("__pycache__", "node_modules", "site-packages", "build", "dist", "tests")


@dataclass(frozen=True)
class Listed:
    """A block type: how a diagram names it, the first paragraph of its text, and all words by which it is found."""

    name: str
    written: str
    summary: str
    words: str


@dataclass(frozen=True)
class Group:
    """Block types that belong together; key: what a diagram writes before them."""

    title: str
    summary: str
    blocks: tuple[Listed, ...]
    key: str = "block"


def installed() -> list[Group]:
    """Those of the library, by file, and those of every other pack; files with a block each are one group."""
    groups: list[Group] = []
    for pack, blocks in sorted(library.packs().items(), key=lambda item: (not _is_ours(item[1]), item[0])):
        homes: dict[str, list[type[Block]]] = {}
        for block in blocks:
            homes.setdefault(block.__module__, []).append(block)
        own = _is_ours(blocks)
        several = {module: found for module, found in sorted(homes.items()) if own and len(found) > 1}
        rest = [block for module, found in homes.items() if module not in several for block in found]
        groups += [_group(module, found, module.rpartition(".")[2], pack) for module, found in several.items()]
        if rest:
            title, module = ("further blocks, a file each", "") if own else (pack, _common(homes))
            groups.append(_group(module, rest, title, pack))
    return groups


def _is_ours(blocks: Iterable[type[Block]]) -> bool:
    return all(block.__module__.startswith(f"{OWN_LIBRARY}.") for block in blocks)


def _common(modules: Iterable[str]) -> str:
    """The package that several modules are in."""
    parts = [module.split(".") for module in modules]
    same = [names[0] for names in zip(*parts, strict=False) if len(set(names)) == 1]
    return ".".join(same)


def _group(module: str, blocks: list[type[Block]], title: str, pack: str) -> Group:
    doc = getattr(sys.modules.get(module), "__doc__", "") or ""
    return Group(title, first_paragraph(doc), tuple(_listed(block, pack) for block in sorted(blocks, key=_name)))


def _name(block: type[Block]) -> str:
    return block.__name__


def _listed(block: type[Block], pack: str) -> Listed:
    doc, name = block.declaration.doc, block.__name__
    unique = sum(other.__name__ == name for blocks in library.packs().values() for other in blocks) == 1
    written = name if unique else f"{pack}:{name}"
    return Listed(name, written, first_paragraph(doc), f"{name} {doc} {block.__module__}")


def first_paragraph(doc: str) -> str:
    """The first paragraph of a text, in one line."""
    return " ".join(re.split(r"\n\s*\n", doc.strip())[0].split())


def own(path: Path, known: Collection[Path] = ()) -> list[Group]:
    """Those of a Python file, of the files of a folder but those that are known, or of those that a diagram names.

    Raises: MissingFile, WrongFile, DiagramErrors, YamlSyntaxError.
    """
    if path.is_dir():
        others = (file for file in _files(path) if file.resolve() not in known)
        return [group for file in islice(others, MOST_FILES) for group in _in_file(file)]
    if path.suffix == ".py":
        source.read_bytes(path)
        return list(_in_file(path))
    if path.suffix.lower() in (".yaml", ".yml"):
        problems = Problems()
        entries = diagram.load(path, problems=problems).blocks.values()
        files = dict.fromkeys(entry.path for entry in entries if entry.kind == "python")
        return [group for file in files for group in own(file)]
    if not path.exists():
        raise MissingFile(f"there is no file `{path}`", Position(str(path)), "check the name and the folder")
    raise WrongFile(f"`{path}` holds no blocks", Position(str(path)), "name a Python file, a folder or a diagram")


def _files(folder: Path) -> Iterator[Path]:
    """The Python files of a folder and of those inside it; environments and what is hidden left out."""
    waiting, seen = deque([(folder, 0)]), 0
    while waiting and seen < MOST_FOLDERS:
        inside, depth = waiting.popleft()
        seen += 1
        try:
            with os.scandir(inside) as entries:
                found = sorted(entries, key=lambda entry: entry.name)
        except OSError:
            continue
        names = {entry.name for entry in found}
        shown = [e for e in found if not e.name.startswith((".", "_")) and e.name not in _SKIPPED]
        yield from (inside / e.name for e in shown if e.name.endswith(".py") and e.is_file(follow_symlinks=False))
        if depth < _DEEPEST and "pyvenv.cfg" not in names:
            folders = [inside / e.name for e in shown if e.is_dir(follow_symlinks=False)]
            waiting += [(path, depth + 1) for path in folders]


def _in_file(path: Path) -> Iterator[Group]:
    """The block classes that a file declares, as its text says; none where it cannot be read."""
    try:
        content = source.read_bytes(path)
        tree = ast.parse(content) if b"cosim" in content else ast.Module([], [])
    except (CosimError, SyntaxError, ValueError, RecursionError, MemoryError):
        return
    blocks = tuple(_declared(tree, path))
    if blocks:
        yield Group(str(path), first_paragraph(ast.get_docstring(tree) or ""), blocks, "python")


def _declared(tree: ast.Module, path: Path) -> Iterator[Listed]:
    """The public classes of a file that derive, perhaps by one another, from a base that `cosim` gives."""
    bases = {"cosim.Block", "cosim.Measure"}
    for statement in tree.body:
        if isinstance(statement, ast.ImportFrom) and (statement.module or "").partition(".")[0] == "cosim":
            bases |= {alias.asname or alias.name for alias in statement.names if alias.name in _BASES}
        if isinstance(statement, ast.ClassDef) and any(ast.unparse(base) in bases for base in statement.bases):
            bases.add(statement.name)
            if not statement.name.startswith("_"):
                doc, name = ast.get_docstring(statement) or "", statement.name
                yield Listed(name, f"{path}:{name}", first_paragraph(doc), f"{name} {doc} {path}")


def matching(groups: Iterable[Group], words: str) -> list[Group]:
    """What has all these words in its name or its text, whatever their case; best by its name."""
    wanted = words.lower().split()
    found = []
    for group in groups:
        blocks = [b for b in group.blocks if all(word in b.words.lower() for word in wanted)]
        blocks.sort(key=lambda block: not all(word in block.name.lower() for word in wanted))
        if blocks:
            found.append(replace(group, blocks=tuple(blocks)))
    return found
