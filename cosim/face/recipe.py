"""What a diagram of a program's is made from: its file or mapping, the changes on top, the classes that it gives.

It holds no network, so it is small, can be pickled, and is followed anew whenever a network is needed. What a file was
when it was first read is kept as a digest: one that has changed since is an error, never another diagram in silence.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cosim.authoring.block import Block
from cosim.errors import ChangedFile, CosimError, Problems
from cosim.language import diagram as diagrams
from cosim.language.overlay import Change
from cosim.language.source import Node
from cosim.machine import importing
from cosim.machine.content import content_digest
from cosim.wiring import block_files, library, resolution
from cosim.wiring.network import Network

UNNAMED = "diagram"
"""What a diagram that is no file counts as, in the folder that its paths are relative to."""


@dataclass(frozen=True)
class Recipe:
    """file: as it was named, from the working folder of then; None for a mapping, whose tree is `written`.

    files: the digests of what has been read so far.
    """

    file: Path | None
    folder: Path
    written: Node | None = None
    changes: tuple[Change, ...] = ()
    classes: Mapping[str, type[Block]] = field(default_factory=dict)
    files: dict[Path, bytes] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """Where the diagram is, in the terms of the working folder of now."""
        if self.file is None:
            return self.folder / UNNAMED
        return self.file if Path.cwd() == self.folder else self.folder / self.file

    def read(self, problems: Problems) -> tuple[Node, list[Path]]:
        """The tree with all layers merged, and the files that it was read from. Raises: DiagramErrors."""
        if self.path.suffix.lower() == ".fmu" and self.file:
            from cosim.wiring import fmu_alone

            return fmu_alone.read(self.path, self.changes, (), problems), [self.path]
        written = self.written
        return diagrams.read(self.path, self.changes, (), problems, (lambda: written) if written else None)

    def look(self) -> None:
        """Read all layers once, and note what the files are. Raises: DiagramErrors."""
        problems = Problems()
        _, files = self.read(problems)
        problems.raise_if_any()
        self.note({path.absolute(): digest for path in files if (digest := _digest(path))})

    def wire(self) -> Network:
        """The network. Raises: DiagramErrors, ChangedFile."""
        problems = Problems()
        with importing.LOADING, library.offering(self.classes):
            self.see_unchanged()
            tree, files = self.read(problems)
            network = resolution.wire(diagrams.build(tree, files, problems), problems)
            self.note(_contents(network))
        return network

    def note(self, found: Mapping[Path, bytes]) -> None:
        """Note what files are. Raises: ChangedFile for one that was another before."""
        for path, digest in found.items():
            if self.files.setdefault(path, digest) != digest:
                raise _changed(path)

    def see_unchanged(self) -> None:
        """Raises: ChangedFile where a file is no longer what it was when it was read."""
        for path, digest in self.files.items():
            if _digest(path) != digest:
                raise _changed(path)


def _changed(path: Path) -> CosimError:
    shown = os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path)
    return ChangedFile(f"`{shown}` is not what it was when this diagram was loaded", fix="load the diagram again")


def _contents(network: Network) -> dict[Path, bytes]:
    """The digests of all files that a network is made from, as they were read; of a Python file, of all it imports."""
    found = {path.absolute(): digest for path in network.diagram.files if (digest := _digest(path))}
    for entry in network.diagram.blocks.values():
        if entry.kind == "python":
            imported = block_files.contents(entry.path)
            found |= {path: hashlib.sha256(content).digest() for path, content in imported.items()}
        elif entry.kind == "fmu" and (digest := _digest(entry.path)):
            found[entry.path.absolute()] = digest
        for data in entry.data_files:
            found[data.path.absolute()] = bytes.fromhex(data.digest)
    return found


def _digest(path: Path) -> bytes:
    """Of a file's content; nothing where there is none."""
    try:
        return content_digest(path)
    except OSError:
        return b""
