"""FMU files, which are zip archives from anywhere: unpacked so that they cannot do harm, and asked for their binary.

No member leaves its folder, links are refused, sizes, counts and compression are bounded whatever the archive says of
itself, and a model description with a document type (which is where entities come from) is refused.
"""

from __future__ import annotations

import platform
import re
import stat
import sys
import tempfile
import threading
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from cosim.errors import ArchiveError, FmuError, MissingFile, Position
from cosim.fmu.fmi import Version
from cosim.machine import files

MOST_MEMBERS = 20_000
MOST_BYTES = 4 << 30
MOST_XML_BYTES = 256 << 20
SUSPICIOUS_RATIO = 200  # of an archive that unpacks to more than SUSPICIOUS_BYTES
SUSPICIOUS_BYTES = 256 << 20
DESCRIPTION = "modelDescription.xml"

_IDENTIFIER = re.compile(r"[^\W\d][\w-]*")  # a C identifier, and the hyphens that some tools write

_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_unpacked: dict[tuple[str, int, int], tempfile.TemporaryDirectory[str]] = {}
_lock = threading.Lock()


def unpack(path: Path, position: Position | None = None) -> Path:
    """The folder with the content of an FMU; unpacked once a process, removed at its end.

    Raises: MissingFile, ArchiveError.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise MissingFile(f"cannot read `{path}`: {error.strerror}", position, "check the path") from None
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise MissingFile(f"`{path}` is a pipe or a device, not a file", position, "name a file")
    key = (str(path.resolve()), status.st_mtime_ns, status.st_size)
    with _lock:
        if key not in _unpacked:
            folder = tempfile.TemporaryDirectory(prefix=f"{path.stem}-", ignore_cleanup_errors=True)
            _extract(path, Path(folder.name), position)
            _unpacked[key] = folder
        return Path(_unpacked[key].name)


def _extract(path: Path, folder: Path, position: Position | None) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _check(path, members, position)
            for member in members:
                _extract_member(archive, member, folder)
    except OSError as error:
        if error.errno in files.FULL:
            fix = "free some space, or have the environment variable TMPDIR name another folder"
            message = f"cannot unpack `{path}` into {folder.parent}: {error.strerror}"
            raise ArchiveError(message, position, fix) from None
        raise _unsound(path, error, position) from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
        raise _unsound(path, error, position) from None
    if not (folder / DESCRIPTION).is_file():
        raise ArchiveError(f"`{path}` has no {DESCRIPTION}", position, "name a file that is an FMU")
    _refuse_entities(path, folder / DESCRIPTION, position)
    build = folder / "sources" / "buildDescription.xml"
    if build.is_file():
        _refuse_entities(path, build, position)


def _unsound(path: Path, error: Exception, position: Position | None) -> ArchiveError:
    return ArchiveError(f"`{path}` is no sound FMU archive: {error}", position, "copy or export the FMU again")


def _check(path: Path, members: list[zipfile.ZipInfo], position: Position | None) -> None:
    """Everything that can be told from the archive's directory. Raises: ArchiveError."""
    for member in members:
        if reason := _harm(member):
            message = f"`{path}` is refused: its member `{member.orig_filename}` {reason}"
            raise ArchiveError(message, position, "do not use this FMU")
    size = sum(member.file_size for member in members)
    packed = max(1, path.stat().st_size)
    if len(members) > MOST_MEMBERS:
        raise ArchiveError(f"`{path}` is refused: it has {len(members)} members", position, "do not use this FMU")
    if size > MOST_BYTES or (size > SUSPICIOUS_BYTES and size > SUSPICIOUS_RATIO * packed):
        message = f"`{path}` is refused: {packed} bytes unpack to {size}"
        raise ArchiveError(message, position, "do not use this FMU")


def _harm(member: zipfile.ZipInfo) -> str:
    """What is wrong with one member, or nothing."""
    name = member.orig_filename
    pure = PurePosixPath(name)
    if "\\" in name or "\0" in name or ":" in name:
        return "has a name that not every system can have"
    if pure.is_absolute() or ".." in pure.parts:
        return "would be written outside of its folder"
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device"
    if member.flag_bits & 1:
        return "is encrypted"
    if pure.name == DESCRIPTION and member.file_size > MOST_XML_BYTES:
        return f"has {member.file_size} bytes"
    return ""


def _extract_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    """Write one member, no more of it than its size says."""
    target = folder.joinpath(*PurePosixPath(member.orig_filename).parts)
    if member.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    left = member.file_size
    with archive.open(member) as source, target.open("wb") as sink:
        while chunk := source.read(1 << 20):
            left -= len(chunk)
            if left < 0:
                raise ValueError(f"`{member.filename}` is larger than it says")
            sink.write(chunk)
    if left:
        raise ValueError(f"`{member.filename}` is smaller than it says")


def _refuse_entities(path: Path, xml: Path, position: Position | None) -> None:
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        tree = etree.parse(str(xml), parser)
    except etree.XMLSyntaxError as error:
        raise ArchiveError(
            f"`{path}`: {xml.name} is not well-formed: {error}", position, "export the FMU again"
        ) from None
    if tree.docinfo.internalDTD is not None or tree.docinfo.externalDTD is not None:
        message = f"`{path}` is refused: {xml.name} declares a document type, where only entities could come from"
        raise ArchiveError(message, position, "do not use this FMU")


# ---- binaries ----


def suffix() -> str:
    """What the name of a shared library ends with on this machine."""
    return _SYSTEMS[sys.platform][1]


def platforms(version: Version) -> list[str]:
    """The folders below `binaries` that fit this machine, the FMI version's own name first."""
    system = _SYSTEMS[sys.platform][0]
    machine = platform.machine().lower()
    wide = sys.maxsize > 2**32
    architecture = "aarch64" if machine in ("arm64", "aarch64") else "x86_64" if wide else "x86"
    return version.folders(system, architecture)


def binaries(folder: Path) -> list[str]:
    """The platforms that an unpacked FMU has binaries for."""
    root = folder / "binaries"
    return sorted(p.name for p in root.iterdir() if p.is_dir() and any(p.iterdir())) if root.is_dir() else []


def check_identifier(identifier: str, name: str, position: Position | None = None) -> None:
    """See that the name of an FMU's library leads to no file elsewhere. Raises: FmuError."""
    if not _IDENTIFIER.fullmatch(identifier):
        message = f"`{name}` is refused: its modelIdentifier `{identifier}` is no name of a file in it"
        raise FmuError(message, position, "do not use this FMU")


def found_binary(folder: Path, identifier: str, version: Version) -> Path | None:
    """The shared library for this machine, if there is one."""
    paths = (folder / "binaries" / system / f"{identifier}{suffix()}" for system in platforms(version))
    return next((path for path in paths if path.is_file()), None)


def binary(folder: Path, identifier: str, version: Version, name: str, position: Position | None = None) -> Path:
    """The shared library for this machine. Raises: FmuError, with the platforms that there are."""
    path = found_binary(folder, identifier, version)
    if path is not None:
        return path
    found = binaries(folder)
    has = f"it has {', '.join(found)}" if found else "it has none at all"
    if (folder / "sources").is_dir():
        has += ", and C sources of which it does not say how to compile them"
    message = f"`{name}` has no binary `{identifier}{suffix()}` for {platforms(version)[0]}; {has}"
    raise FmuError(message, position, "export the FMU for this platform too")
