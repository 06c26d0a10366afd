"""A diagram or a study as it stands in an editor: what is wrong with it, and what its blocks are, as far as it goes."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from cosim.authoring.declaration import Declaration
from cosim.authoring.leaving import left
from cosim.errors import CosimError, DiagramErrors, Problems, WrongFile
from cosim.language import diagram as diagrams
from cosim.language import source
from cosim.language.diagram import Diagram
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.study import study_file
from cosim.wiring import library, overview, resolution
from cosim.wiring.network import Network


@dataclass
class Reading:
    """What a text says. errors: each with its own place, as of `cosim check`; of a study, as it is read.

    diagram: as far as it can be understood, None where the YAML is broken; of a study, the one that it is about.
    declarations: of its blocks, by name. network: where nothing is wrong with the diagram.
    inner: of blocks that are diagrams, those.
    """

    path: Path
    errors: list[CosimError] = field(default_factory=list)
    warnings: list[CosimError] = field(default_factory=list)
    is_study: bool = False
    diagram: Diagram | None = None
    declarations: dict[str, Declaration] = field(default_factory=dict)
    network: Network | None = None
    inner: dict[str, Diagram] = field(default_factory=dict)

    @property
    def files(self) -> list[Path]:
        """The files that it depends on, diagrams and studies."""
        return [self.path, *(self.diagram.files if self.diagram else ())]

    def after(self, last: Reading | None) -> Reading:
        """The same, with what only the last one knew of that file."""
        if last is None:
            return self
        if self.diagram is None:
            self.diagram, self.declarations, self.inner = last.diagram, last.declarations, last.inner
            self.is_study = last.is_study
        elif self.network is None:  # a type that is half written, or whose file is
            named = {name: known for name, known in last.declarations.items() if name in self.diagram.blocks}
            self.declarations = {**named, **self.declarations}
        self.network = self.network or last.network
        return self


def read(path: Path) -> Reading:
    """Read, wire and judge what stands in a file, or in `unsaved` texts. Nothing is compiled, nothing is run."""
    try:
        return _read(path)
    except SystemExit as leaving:  # of a rule's function, which would end the server
        return Reading(path, [left(leaving)])


def _read(path: Path) -> Reading:
    problems, found = Problems(), Reading(path)
    try:
        tree, files = diagrams.read(path, (), (), problems)
    except DiagramErrors as error:
        if any(isinstance(one, WrongFile) for one in error.errors):
            return _study(path)
        found.errors = error.errors
        return found
    found.diagram = diagrams.build(tree, files, problems)
    found.inner = _inner(tree)
    with suppress(CosimError):  # which are among the problems
        found.network = resolution.wire(found.diagram, problems)
    found.errors = problems.errors
    if found.network:
        found.declarations = {name: part.declaration for name, part in found.network.components.items()}
        try:
            found.warnings = list(overview.describe(found.network).warnings)
        except CosimError as error:
            found.errors = error.each
    else:
        found.declarations = _declarations(found.diagram.blocks.values())
    return found


def _study(path: Path) -> Reading:
    found = Reading(path, is_study=True)
    try:
        study_file.load(path)
    except CosimError as error:
        found.errors = error.each
    with suppress(CosimError):
        named = source.read(path, Problems()).value["diagram"].value
        of_diagram = read(Path(os.path.normpath(path.parent / str(named))))
        found.diagram, found.declarations = of_diagram.diagram, of_diagram.declarations
        found.network, found.inner = of_diagram.network, of_diagram.inner
    return found


def _declarations(entries: Iterable[BlockEntry]) -> dict[str, Declaration]:
    """Of the blocks whose types can be found."""
    found = {}
    for entry in entries:
        with suppress(CosimError):
            found[entry.name] = library.find(entry).declaration
    return found


def _inner(tree: Node) -> dict[str, Diagram]:
    """The diagrams that blocks are, by the blocks' names, as far as they can be read."""
    found: dict[str, Diagram] = {}
    blocks = tree.value.get("blocks")
    for name, node in blocks.value.items() if blocks and isinstance(blocks.value, dict) else ():
        named = node.value.get("diagram") if isinstance(node.value, dict) else None
        if named and isinstance(named.value, str):
            with suppress(CosimError):
                inner = Path(os.path.normpath(named.position.folder / named.value))
                found[name] = diagrams.load(inner, problems=Problems())
    return found
