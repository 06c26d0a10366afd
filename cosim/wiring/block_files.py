"""Python files of blocks next to a diagram, each imported as a module that may import others of its folder."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import linecache
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from cosim.authoring.author_source import place_of
from cosim.authoring.block import mistakes_wait
from cosim.errors import CosimError, DeclarationError, Problems
from cosim.language import source
from cosim.machine import importing, installed
from cosim.wiring.block_modules import FILE_PREFIX, block_classes, find_spec, import_error, is_inside

_imported: set[str] = set()
"""The names of all modules that were imported for block files."""
_files: dict[Path, tuple[dict[Path, bytes], ModuleType]] = {}
"""The modules that Python files are, each with the content of all files of its folder that were imported for it."""


def import_file(path: Path) -> ModuleType:
    """The module that a Python file is; imported once, and again if it or a file that it imports changes.

    It may import modules of its own folder, which other files do not see.
    Raises: MissingFile, BlockImportError, DeclarationError (both at the line of the Python file).
    """
    content = source.read_bytes(path)
    real = path.resolve()
    known = _files.get(real)
    if known and all(_has_content(file, before) for file, before in known[0].items()):
        return known[1]
    _forget_changed(known[0] if known else {})
    module = _new_module(real)
    with _registered(module):
        before = set(sys.modules)
        with _siblings(real.parent):
            problems = _execute(module, content, real, path)
            _imported.update(n for n in set(sys.modules) - before if installed.package(n) != "cosim")
            beside = _beside(real.parent)
        problems.raise_one_or_all()
    _files[real] = ({**beside, real: content}, module)
    return module


def contents(path: Path) -> dict[Path, bytes]:
    """A Python file that has been imported, and the files of its folder that it imports, as they were then."""
    known = _files.get(path.resolve())
    return dict(known[0]) if known else {}


def _new_module(file: Path) -> ModuleType:
    name = f"{FILE_PREFIX}{file.stem}_{hashlib.sha256(os.fsencode(file)).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec
    linecache.checkcache(str(file))
    return importlib.util.module_from_spec(spec)


@contextmanager
def _registered(module: ModuleType) -> Iterator[None]:
    """Have a module known by its name, and the one before again if it fails."""
    name = module.__name__
    previous = sys.modules.get(name)
    sys.modules[name] = module
    try:
        yield
    except BaseException:
        if previous:
            sys.modules[name] = previous
        else:
            del sys.modules[name]
        raise


def _execute(module: ModuleType, content: bytes, file: Path, path: Path) -> Problems:
    """Run a file's code as a module's; what is wrong with it. path: what the user calls the file."""
    problems = Problems()
    try:
        tree = ast.parse(content, str(file))
        with importing.guarded(f"`{path}`"), mistakes_wait():
            exec(compile(tree, str(file), "exec", dont_inherit=True), module.__dict__)  # noqa: S102  # as `import` does
    except (Exception, SystemExit, importing.Stuck) as error:  # noqa: BLE001  # whatever an author's file raises
        problems.add(import_error(error, path, str(file.parent)))
    else:
        for twice in _classes_twice(tree, str(file)):
            problems.add(twice)
    for mistake in _mistakes(module, file.parent):
        problems.add(mistake)
    return problems


@contextmanager
def _siblings(folder: Path) -> Iterator[None]:
    """Let imports find modules in a folder; afterwards forget those that nothing else could have found.

    Their bytecode is not kept: Python would take it for that of a file changed within the same second.
    """
    before, writes = set(sys.modules), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes
        sys.path.remove(str(folder))
        inside = [name for name in set(sys.modules) - before if is_inside(sys.modules[name], folder)]
        found = {name: sys.modules.pop(name) for name in inside}
        for name, module in found.items():
            if find_spec(name.partition(".")[0]):
                sys.modules[name] = module


def _beside(folder: Path) -> dict[Path, bytes]:
    """The authors' own modules in a folder that block files have imported, with their content."""
    files = {name: Path(getattr(sys.modules.get(name), "__file__", None) or "") for name in _imported}
    own = (
        f for name, f in files.items() if folder in f.parents and not installed.text(installed.package(name), str(f))
    )
    return {file: file.read_bytes() for file in own if file.is_file()}


def _has_content(file: Path, content: bytes) -> bool:
    try:
        return file.read_bytes() == content
    except OSError:
        return False


def _forget_changed(files: Mapping[Path, bytes]) -> None:
    """Have those files imported anew that block files imported with another content."""
    changed = {str(file) for file, content in files.items() if not _has_content(file, content)}
    for name in _imported & set(sys.modules):
        if getattr(sys.modules[name], "__file__", None) in changed:
            del sys.modules[name]


def _mistakes(module: ModuleType, folder: Path) -> Iterator[CosimError]:
    """Every mistake in the blocks of a file and of those of its folder that it uses."""
    from cosim.authoring import authors

    for block in block_classes(module):
        home = sys.modules.get(block.__module__)
        if home is module or (home and is_inside(home, folder)):
            yield from block.declaration.mistakes
            yield from authors.mistakes(block.declaration)


def _classes_twice(tree: ast.Module, file: str) -> Iterator[DeclarationError]:
    """Classes of a file that a later one of the same name replaces."""
    first: set[str] = set()
    for statement in tree.body:
        if not isinstance(statement, ast.ClassDef):
            continue
        if statement.name in first:
            what = f"class {statement.name} is defined twice, and the first definition is lost"
            yield DeclarationError(what, place_of(file, statement), "give one of them another name")
        first.add(statement.name)
