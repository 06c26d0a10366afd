"""Finds block classes by name: in the installed libraries, and in Python files next to a diagram.

A library, a pack, is an entry point of the group `cosim.blocks` whose value is a package (or a module): all its public
modules are imported, and the block classes that they define are known by their names, `Servo`. Where packs have one
name each, `acme.motors:Servo` says which: what stands before the colon is the name of the entry point, or a module.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType

from cosim.authoring.author_source import function_text
from cosim.authoring.block import Block, mistakes_wait
from cosim.errors import (
    AmbiguousBlock,
    CosimError,
    DeclarationError,
    DiagramErrors,
    UnknownBlock,
    WrongType,
    WrongValue,
    nearest,
)
from cosim.language import source
from cosim.language.entry import BlockEntry
from cosim.machine import distributions, importing
from cosim.wiring.block_files import import_file
from cosim.wiring.block_modules import block_classes, find_spec, import_error

GROUP = "cosim.blocks"
_given: ContextVar[Mapping[str, type[Block]]] = ContextVar("given", default=MappingProxyType({}))


@contextmanager
def offering(classes: Mapping[str, type[Block]]) -> Iterator[None]:
    """Inside, these classes of a program's are found by their names, before those of the libraries."""
    token = _given.set(classes)
    try:
        yield
    finally:
        _given.reset(token)


def find(entry: BlockEntry) -> type[Block]:
    """The class that a diagram's entry names, or the one made from an FMU or an expression.

    Raises: UnknownBlock, AmbiguousBlock, BlockImportError, DeclarationError, MissingFile, WrongValue,
    for an FMU ArchiveError, FmuError, UnknownPort, and for an expression ExpressionError, DiagramErrors with several.
    """
    if entry.type.made or (entry.kind == "block" and entry.type.value in _given.get()):
        return _from_program(entry, entry.type.made or _given.get()[entry.type.value])
    if entry.kind == "fmu":
        from cosim.fmu import importer

        return importer.block(entry)
    if entry.kind == "expression":
        from cosim.wiring import expression_blocks

        return expression_blocks.block(entry)
    return _from_file(entry) if entry.kind == "python" else _from_libraries(entry)


def all_blocks() -> dict[str, type[Block]]:
    """The block classes of all installed libraries by name, modules with mistakes left out: see `broken`."""
    return {name: classes[0] for name, classes in sorted(_libraries()[0].items())}


def packs() -> dict[str, list[type[Block]]]:
    """The block classes of each installed library, by the name of its entry point, in the order of their modules."""
    found: dict[str, list[type[Block]]] = {}
    for classes in _libraries()[0].values():
        for block in classes:
            found.setdefault(_libraries()[2][block], []).append(block)
    return found


def files() -> set[Path]:
    """Where the installed block types stand."""
    modules = {block.__module__ for block in all_blocks().values()}
    return {Path(file).resolve() for name in modules if (file := getattr(sys.modules.get(name), "__file__", None))}


def broken() -> list[CosimError]:
    """What keeps modules of the installed libraries from being imported."""
    return list(_libraries()[1])


def _from_program(entry: BlockEntry, made: type) -> type[Block]:
    """A class that a program gives, such as one of a notebook's cell. Raises: WrongType, DeclarationError."""
    from cosim.authoring import authors

    if not issubclass(made, Block) or entry.kind != "block":
        message = f"block `{entry.name}`: the class {made.__qualname__} is no type of block behind `{entry.kind}:`"
        raise WrongType(message, entry.type.position, "give a class that is derived from cosim.Block, as `block:`")
    for function in made.declaration.functions:
        if function_text(function.python) is None:
            message = f"block `{entry.name}`: the source of {made.__qualname__}.{function.name}() cannot be found"
            fix = "write the class in a file or a notebook's cell; where its file has changed, import it again"
            raise DeclarationError(message, entry.type.position, fix)
    authors.check([made.declaration])
    return made


def _from_libraries(entry: BlockEntry) -> type[Block]:
    pack, _, name = entry.type.value.rpartition(":")
    place = entry.type.position
    known, errors, home = _libraries(name)
    if name not in known:
        known, errors, home = _libraries()
    classes = [block for block in known.get(name, []) if not pack or pack in _qualifiers(block, home[block])]
    if len(classes) > 1:
        modules = " and ".join(block.__module__ for block in classes)
        message = f"block `{entry.name}`: `{entry.type.value}` is both in {modules}"
        names = [home[b] if sum(home[c] == home[b] for c in classes) == 1 else b.__module__ for b in classes]
        raise AmbiguousBlock(message, place, f"write {' or '.join(f'{one}:{name}' for one in names)}")
    if classes:
        if not classes[0].declaration.compiled:  # else it is checked before it is compiled
            from cosim.authoring import authors

            authors.check([classes[0].declaration])
        return classes[0]
    unknown = UnknownBlock(
        f"block `{entry.name}`: there is no block type `{entry.type.value}`", place, _meant(pack, name)
    )
    if errors:
        raise DiagramErrors([unknown, *errors])
    raise unknown


def _qualifiers(block: type[Block], pack: str) -> set[str]:
    """What may stand before the colon for a block: its pack, its module and the packages that this is in."""
    parts = block.__module__.split(".")
    return {pack, *(".".join(parts[:end]) for end in range(1, len(parts) + 1))}


def _meant(pack: str, name: str) -> str:
    """The usual fix for a name that no library has, perhaps in one pack only."""
    known, _, home = _libraries()
    found = None if pack else vars(sys.modules["__main__"]).get(name)
    if isinstance(found, type) and issubclass(found, Block):
        return f"hand the class over: cosim.load(…, blocks=[{name}])"
    if pack.endswith((".py", ".fmu", ".yaml", ".yml")):
        return f"write `python: {pack}:{name}`" if pack.endswith(".py") else ""
    blocks = {block: _qualifiers(block, home[block]) for classes in known.values() for block in classes}
    inside = [block.__name__ for block, qualifiers in blocks.items() if not pack or pack in qualifiers]
    if inside:
        meant = nearest(name, inside)
        return meant.replace("`", f"`{pack}:", 1) if pack else meant
    elsewhere = [f"{home[block]}:{name}" for block in known.get(name, [])]
    installed = f"no installed pack is called `{pack}`"
    return (
        f"{installed}; write {' or '.join(elsewhere)}"
        if elsewhere
        else f"{installed}: {nearest(pack, {*home.values()})}"
    )


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
def _libraries(name: str = "") -> tuple[dict[str, list[type[Block]]], list[CosimError], dict[type[Block], str]]:
    """All classes by name (several, if modules disagree), the errors of modules that cannot be imported, and packs.

    name: of a class; then modules whose text does not have it are left out, as importing all of them takes a while.
    """
    found: dict[str, list[type[Block]]] = {}
    home: dict[type[Block], str] = {}
    errors: list[CosimError] = []
    for point in _points():
        for module in _modules(point.module, errors, name.encode()):
            for block in _classes(module, point.module):
                if block not in found.setdefault(block.__name__, []):
                    found[block.__name__].append(block)
                    home[block] = point.name
    return found, errors, home


@cache
def _points() -> list[distributions.EntryPoint]:
    """The entry points of all installed libraries, for which all that is installed is looked through."""
    return sorted(distributions.entry_points(GROUP))


def _modules(name: str, errors: list[CosimError], wanted: bytes) -> Iterator[ModuleType]:
    """A package's public modules whose text has what is wanted, and it itself."""
    try:
        with importing.guarded(f"`{name}`"), mistakes_wait():
            module = importlib.import_module(name)
    except (Exception, SystemExit, importing.Stuck) as error:  # noqa: BLE001  # whatever a package raises
        spec = find_spec(name)
        file = Path(os.path.relpath(spec.origin)) if spec and spec.origin else Path(name)
        errors.append(import_error(error, file, str(file.resolve().parent)))
        return
    own = [block for block in block_classes(module) if block.__module__ == name]
    wrong = [mistake for block in own for mistake in block.declaration.mistakes]
    errors.extend(wrong)
    if not wrong:
        yield module
    for child, text in _children(module):
        if text is None or wanted in text:
            yield from _modules(child, errors, wanted)


@cache
def _children(package: ModuleType) -> list[tuple[str, bytes | None]]:
    """The public modules of a package, each with its text; None where that does not say what it has."""
    found = []
    for child in pkgutil.iter_modules(getattr(package, "__path__", ())):
        if not child.name.startswith("_"):
            folder = getattr(child.module_finder, "path", None)  # of an archive there is none
            file = Path(folder or "", f"{child.name}.py")
            text = file.read_bytes() if folder and not child.ispkg and file.is_file() else b"import *"
            found.append((f"{package.__name__}.{child.name}", None if b"import *" in text else text))
    return found


def _classes(module: ModuleType, package: str) -> Iterator[type[Block]]:
    """A module's public block classes; with a package, those only that are defined in it."""
    inside = f"{package}." if package else ""
    known = [block for block in block_classes(module) if f"{block.__module__}.".startswith(inside)]
    for name, member in vars(module).items():
        if isinstance(member, type) and member in known and not name.startswith("_"):
            yield member
