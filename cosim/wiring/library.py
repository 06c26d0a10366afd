"""Finds block classes by name: in the installed libraries, and in Python files next to a diagram.

A library is an entry point of the group `cosim.blocks` whose value is a package (or a module): all its public modules
are imported, and the block classes that they define are known by their names.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import linecache
import os
import pkgutil
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from cosim.authoring.author_source import place_of, shown
from cosim.authoring.block import Block, mistakes_wait
from cosim.errors import (
    AmbiguousBlock,
    BlockImportError,
    CosimError,
    DeclarationError,
    DiagramErrors,
    Position,
    Problems,
    UnknownBlock,
    WrongValue,
    nearest,
)
from cosim.language import source
from cosim.language.entry import BlockEntry
from cosim.machine import importing, installed

GROUP = "cosim.blocks"


def find(entry: BlockEntry) -> type[Block]:
    """The class that a diagram's entry names, or the one made from an FMU.

    Raises: UnknownBlock, AmbiguousBlock, BlockImportError, DeclarationError, MissingFile, WrongValue,
    and for an FMU ArchiveError, FmuError, UnknownPort.
    """
    if entry.kind == "fmu":
        from cosim.fmu import importer

        return importer.block(entry)
    return _from_file(entry) if entry.kind == "python" else _from_libraries(entry)


def all_blocks() -> dict[str, type[Block]]:
    """The block classes of all installed libraries by name, modules with mistakes left out: see `broken`."""
    return {name: classes[0] for name, classes in sorted(_libraries()[0].items())}


def broken() -> list[CosimError]:
    """What keeps modules of the installed libraries from being imported."""
    return list(_libraries()[1])


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
    name = f"cosim_file_{real.stem}_{hashlib.sha256(str(real).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, real)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    linecache.checkcache(str(real))
    previous = sys.modules.get(name)
    sys.modules[name] = module
    before, beside = set(sys.modules), {}
    problems = Problems()
    try:
        with _siblings(real.parent):
            try:
                tree = ast.parse(content, str(real))
                with importing.guarded(f"`{path}`"), mistakes_wait():
                    exec(compile(tree, str(real), "exec", dont_inherit=True), module.__dict__)
            except (Exception, SystemExit, importing.Stuck) as error:
                problems.add(_import_error(error, path, str(real.parent)))
            else:
                for twice in _classes_twice(tree, str(real)):
                    problems.add(twice)
            for mistake in _mistakes(module, real.parent):
                problems.add(mistake)
            _imported.update(n for n in set(sys.modules) - before if installed.package(n) != "cosim")
            beside = _beside(real.parent)
        problems.raise_one_or_all()
    except BaseException:
        if previous:
            sys.modules[name] = previous
        else:
            del sys.modules[name]
        raise
    _files[real] = ({**beside, real: content}, module)
    return module


_imported: set[str] = set()
"""The names of all modules that were imported for block files."""
_files: dict[Path, tuple[dict[Path, bytes], ModuleType]] = {}
"""The modules that Python files are, each with the content of all files of its folder that were imported for it."""


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

    for block in _block_classes(module):
        home = sys.modules.get(block.__module__)
        if home is module or (home and _is_inside(home, folder)):
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


def _from_libraries(entry: BlockEntry) -> type[Block]:
    name, place = entry.type.value, entry.type.position
    known, errors = _libraries()
    classes = known.get(name, [])
    if len(classes) > 1:
        modules = " and ".join(block.__module__ for block in classes)
        message = f"block `{entry.name}`: `{name}` is both in {modules}"
        raise AmbiguousBlock(message, place, "rename one of the classes, or name its file with `python:`")
    if classes:
        if not classes[0].declaration.compiled:  # else it is checked before it is compiled
            from cosim.authoring import authors

            authors.check([classes[0].declaration])
        return classes[0]
    unknown = UnknownBlock(f"block `{entry.name}`: there is no block type `{name}`", place, nearest(name, known))
    if errors:
        raise DiagramErrors([unknown, *errors])
    raise unknown


def _from_file(entry: BlockEntry) -> type[Block]:
    place = entry.type.position
    _, _, name = entry.type.value.rpartition(":")
    if not entry.type.value.endswith(f".py:{name}") or not name:
        message = f"block `{entry.name}`: `python: {entry.type.value}` does not name a file and a class"
        raise WrongValue(message, place, "write python: file.py:ClassName")
    source.read_bytes(entry.path, place)
    known = {block.__name__: block for block in _classes(import_file(entry.path), "")}
    if name not in known:
        message = f"block `{entry.name}`: {entry.path} has no block class `{name}`"
        raise UnknownBlock(message, place, nearest(name, known) or "derive a class from cosim.authoring.block.Block")
    return known[name]


@cache
def _libraries() -> tuple[dict[str, list[type[Block]]], list[CosimError]]:
    """All classes by name (several, if modules disagree), and the errors of modules that cannot be imported."""
    found: dict[str, list[type[Block]]] = {}
    errors: list[CosimError] = []
    for point in sorted(entry_points(group=GROUP)):
        for module in _modules(point.module, errors):
            for block in _classes(module, point.module):
                if block not in found.setdefault(block.__name__, []):
                    found[block.__name__].append(block)
    return found, errors


def _modules(name: str, errors: list[CosimError]) -> Iterator[ModuleType]:
    """A package's public modules, and it itself."""
    try:
        with importing.guarded(f"`{name}`"), mistakes_wait():
            module = importlib.import_module(name)
    except (Exception, SystemExit, importing.Stuck) as error:
        spec = _spec(name)
        file = Path(os.path.relpath(spec.origin)) if spec and spec.origin else Path(name)
        errors.append(_import_error(error, file, str(file.resolve().parent)))
        return
    own = [block for block in _block_classes(module) if block.__module__ == name]
    wrong = [mistake for block in own for mistake in block.declaration.mistakes]
    errors.extend(wrong)
    if not wrong:
        yield module
    for child in pkgutil.iter_modules(getattr(module, "__path__", ())):
        if not child.name.startswith("_"):
            yield from _modules(f"{name}.{child.name}", errors)


def _classes(module: ModuleType, package: str) -> Iterator[type[Block]]:
    """A module's public block classes; with a package, those only that are defined in it."""
    inside = f"{package}." if package else ""
    known = [block for block in _block_classes(module) if f"{block.__module__}.".startswith(inside)]
    for name, member in vars(module).items():
        if isinstance(member, type) and member in known and not name.startswith("_"):
            yield member


def _block_classes(module: ModuleType) -> list[type[Block]]:
    """All block classes that a module knows, private ones too."""
    members = [m for m in vars(module).values() if isinstance(m, type) and issubclass(m, Block)]
    return [m for m in dict.fromkeys(members) if m.__module__ != Block.__module__]


def _import_error(error: BaseException, path: Path, folder: str) -> CosimError:
    """The error at the innermost line that stands in the file's folder."""
    if isinstance(error, SyntaxError) and error.filename and error.filename.startswith(folder):
        line, column, file = error.lineno or 0, error.offset or 0, Path(error.filename)
        text = error.msg
    else:
        frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename.startswith(folder)]
        line, column = (frames[-1].lineno or 0, (frames[-1].colno or 0) + 1) if frames else (0, 0)
        file = Path(frames[-1].filename) if frames else path
        text = str(error) if isinstance(error, importing.Stuck) else f"{type(error).__name__}: {error}"
    place = Position(shown(str(file.resolve())), line, column)
    if isinstance(error, CosimError):
        error.position = error.position or place
        return error
    return BlockImportError(f"`{path}` cannot be imported: {text}", place, "correct the Python file")


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
        inside = [name for name in set(sys.modules) - before if _is_inside(sys.modules[name], folder)]
        found = {name: sys.modules.pop(name) for name in inside}
        for name, module in found.items():
            if _spec(name.partition(".")[0]):
                sys.modules[name] = module


def _is_inside(module: ModuleType, folder: Path) -> bool:
    spec = getattr(module, "__spec__", None)
    file = spec.origin if spec else None
    return bool(file) and not module.__name__.startswith("cosim_file_") and folder in Path(str(file)).resolve().parents


def _spec(name: str) -> importlib.machinery.ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None
