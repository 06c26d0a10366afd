"""FMUs that come as C sources: compiled for this machine once, and kept where object code is kept.

What is compiled and how says FMI 3's `sources/buildDescription.xml`, or else FMI 2's list of source files.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from cosim.errors import BuildFailed, CompilerMissing, CosimError, FmuError, Position
from cosim.fmu import archive
from cosim.fmu.fmi import Version
from cosim.machine import c_compiler, cache

_FLAGS = ["-O2", "-ffp-contract=off", "-w"]
_STANDARDS = {
    "C89": "gnu89",
    "C90": "gnu90",
    "C99": "gnu99",
    "C11": "gnu11",
    "C17": "gnu17",
    "C18": "gnu17",
    "C23": "gnu2x",
}
_PLUS_PLUS = re.compile(r"C\+\+(\d\d)?")
_NAME = re.compile(r"[A-Za-z_]\w*")
_SHOWN = 3


@dataclass(frozen=True)
class SourceSet:
    """Files that are compiled in the same way; all paths below `sources`."""

    language: str
    files: tuple[str, ...]
    definitions: tuple[str, ...] = ()
    includes: tuple[str, ...] = ()


def headers() -> Path:
    """FMI's own C headers, which FMPy has with it. Raises: CompilerMissing."""
    found = importlib.util.find_spec("fmpy")
    if found is None or found.origin is None:
        raise CompilerMissing("FMI's C headers come with FMPy, which is not installed", fix="pip install fmpy")
    return Path(found.origin).parent / "c-code"


def provide(folder: Path, identifier: str, version: Version, name: str, position: Position | None = None) -> None:
    """See to the binary of an unpacked FMU, if it has none for this machine and comes with sources.

    Raises: CompilerMissing, BuildFailed, FmuError.
    """
    if archive.found_binary(folder, identifier, version) is not None:
        return
    try:
        sets, libraries = build_description(folder, identifier, version)
        if not sets:
            return
        code = _code(folder / "sources", sets, libraries)
    except CosimError as error:
        place = archive.platforms(version)[0]
        message = f"`{name}` has C sources and no binary for {place}: {error.message}"
        raise type(error)(message, position, error.fix) from None
    target = folder / "binaries" / archive.platforms(version)[0] / f"{identifier}{archive.suffix()}"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(code)


# ---- what is to be compiled ----


def build_description(folder: Path, identifier: str, version: Version) -> tuple[list[SourceSet], list[str]]:
    """The sources of an unpacked FMU and the libraries that they need, if it tells. Raises: FmuError."""
    from lxml import etree

    sources = folder / "sources"
    if (sources / "buildDescription.xml").is_file():
        root = etree.parse(str(sources / "buildDescription.xml")).getroot()
        chosen = _chosen(root.findall("BuildConfiguration"), identifier, archive.platforms(version))
        if chosen is None:
            return [], []
        sets = [_source_set(element) for element in chosen.findall("SourceFileSet")]
        libraries = [str(library.get("name")) for library in chosen.findall("Library")]
    else:
        root = etree.parse(str(folder / archive.DESCRIPTION)).getroot()
        interfaces = [e for e in root.iter("ModelExchange", "CoSimulation") if e.get("modelIdentifier") == identifier]
        files = tuple(file.get("name") for e in interfaces[:1] for file in e.findall("SourceFiles/File"))
        sets, libraries = [SourceSet("", files)] if files else [], []
    _check(sources, sets, libraries)
    return sets, libraries


def _chosen(configurations: Sequence[Any], identifier: str, platforms: Sequence[str]) -> Any:
    """The one for this FMU and machine; one that names no platform serves all."""
    named = [c for c in configurations if c.get("modelIdentifier") == identifier] or configurations
    fitting = [c for c in named if c.get("platform") in platforms]
    return next(iter([*fitting, *(c for c in named if c.get("platform") is None)]), None)


def _source_set(element: Any) -> SourceSet:
    definitions = [
        f"{d.get('name')}={d.get('value')}" if d.get("value") is not None else str(d.get("name"))
        for d in element.findall("PreprocessorDefinition")
        if d.get("optional") not in ("true", "1")
    ]
    return SourceSet(
        language=element.get("language") or "",
        files=tuple(str(file.get("name")) for file in element.findall("SourceFile")),
        definitions=tuple(definitions),
        includes=tuple(str(directory.get("name")) for directory in element.findall("IncludeDirectory")),
    )


def _check(sources: Path, sets: Sequence[SourceSet], libraries: Sequence[str]) -> None:
    """Raises: FmuError for what leads out of the FMU, is not there, or cannot be compiled here."""
    for one in sets:
        for path in (*one.files, *one.includes):
            pure = PurePosixPath(path)
            if pure.is_absolute() or ".." in pure.parts or "\\" in path:
                raise FmuError(f"its source `{path}` lies outside of it", fix="do not use this FMU")
            if not (sources / pure).exists():
                raise FmuError(f"its source `{path}` is missing", fix="export the FMU again")
        if one.language and one.language not in _STANDARDS and not _PLUS_PLUS.fullmatch(one.language):
            raise FmuError(f"it is written in {one.language}; C and C++ can be compiled", fix="export it with a binary")
        for definition in one.definitions:
            if not _NAME.fullmatch(definition.partition("=")[0]):
                raise FmuError(f"`{definition}` is no definition for a compiler", fix="export the FMU again")
    for library in libraries:
        if not re.fullmatch(r"[\w.+-]+", library) or library.startswith("-"):
            raise FmuError(f"`{library}` is no name of a library", fix="export the FMU again")


# ---- compiling ----


def _code(sources: Path, sets: Sequence[SourceSet], libraries: Sequence[str]) -> bytes:
    """The shared library, from the cache or compiled now. Raises: CompilerMissing, BuildFailed."""
    compiler = c_compiler.native() or c_compiler.zig()
    if not compiler:
        raise CompilerMissing("there is no C compiler", fix="install gcc, or `pip install ziglang`")
    entry = f"fmusource-{_key(sources, sets, libraries, compiler)}"
    code = cache.read(entry)
    if code is None:
        with tempfile.TemporaryDirectory(prefix="cosim-") as work:
            code = _compiled(sources, sets, libraries, compiler, Path(work)).read_bytes()
        cache.write(entry, code)
    return code


def _key(sources: Path, sets: Sequence[SourceSet], libraries: Sequence[str], compiler: Sequence[str]) -> str:
    """A digest of all that the library follows from."""
    tool = Path(compiler[0]).resolve()
    digest = hashlib.sha256(repr([sets, libraries, compiler, _FLAGS, tool.stat().st_mtime_ns]).encode())
    for root in (sources, headers()):
        for path in sorted(root.rglob("*")):
            if path.is_file():
                digest.update(f"{path.relative_to(root)} {path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:32]


def _compiled(
    sources: Path, sets: Sequence[SourceSet], libraries: Sequence[str], compiler: Sequence[str], work: Path
) -> Path:
    """The library in a work folder. Raises: BuildFailed."""
    objects: list[str] = []
    for flags, file in _files(sources, sets):
        objects.append(str(work / f"{len(objects)}.o"))
        _run(
            [*compiler, *_FLAGS, *_position_independent(), *flags, "-c", str(sources / file), "-o", objects[-1]],
            sources,
        )
    library = work / f"library{archive.suffix()}"
    plus = ["-lstdc++"] if any(_PLUS_PLUS.fullmatch(one.language) for one in sets) else []
    needed = [f"-l{name}" for name in libraries] + plus + ([] if archive.suffix() == ".dll" else ["-lm"])
    _run([*compiler, "-shared", *_position_independent(), "-o", str(library), *objects, *needed], sources)
    return library


def _files(sources: Path, sets: Sequence[SourceSet]) -> Iterator[tuple[list[str], str]]:
    """The source files, each with its own flags."""
    for one in sets:
        plus = _PLUS_PLUS.fullmatch(one.language)
        standard = f"gnu++{plus[1]}" if plus and plus[1] else _STANDARDS.get(one.language, "")
        flags = [f"-std={standard}"] if standard else []
        flags += [f"-D{definition}" for definition in one.definitions]
        flags += [f"-I{sources / directory}" for directory in (".", *one.includes)] + [f"-I{headers()}"]
        for file in one.files:
            yield [*flags, *(["-x", "c++"] if plus else [])], file


def _position_independent() -> list[str]:
    return [] if archive.suffix() == ".dll" else ["-fPIC"]


def _run(command: Sequence[str], sources: Path) -> None:
    lines = c_compiler.complaints(command)
    if lines:
        shown = [line.replace(f"{sources}/", "sources/") for line in lines[:_SHOWN]]
        more = f"\n    and {len(lines) - _SHOWN} more lines" if len(lines) > _SHOWN else ""
        said = "".join(f"\n    it says {line}" for line in shown)
        raise BuildFailed(f"{Path(command[0]).name} cannot compile them{said}{more}", fix="export it with a binary")
