"""From an FMU that a diagram names to a block type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cosim.authoring.block import Block
from cosim.errors import CosimError, FmuError
from cosim.fmu import (
    adapter,
    archive,
    binary_data,
    c_sources,
    declared,
    fields,
    instance,
    isolation,
    log_file,
    mailbox,
    port_names,
    saved_states,
    settings,
    structural,
    structure,
    tangent_table,
)
from cosim.fmu.description import read_description
from cosim.fmu.imported import Fmu
from cosim.fmu.ports import hidden
from cosim.fmu.ports import ports as read_ports
from cosim.language.entry import BlockEntry


class ForeignFmu(Fmu):
    """With what the loop needs; a `cosim.authoring.foreign.Foreign`."""

    frame_words = fields.FIRST - fields.LINK

    @property
    def kernel(self) -> Callable[[float, int, int], int]:
        """What does the FMU's functions in the loop."""
        return mailbox.remote if self.settings.isolated else adapter.adapt

    def library(self) -> bytes:
        """The content of the shared library for this machine. Raises: FmuError."""
        return archive.binary(self.folder, self.interface.modelIdentifier, self.version, self.name).read_bytes()

    def derives(self, component: Any, function: Any) -> bool:
        """Whether it gives directional derivatives of what a function computes; see `cosim.fmu.tangent_table`."""
        return tangent_table.derives(self, component, function)

    def unsaved(self, component: Any) -> CosimError | None:
        """Why instances cannot be saved; see `cosim.fmu.saved_states`."""
        return saved_states.refusal(self, component)

    def parts(self, component: Any, *arguments: Any) -> Any:
        """The instances of one run, by process; see `cosim.fmu.instance` and `cosim.fmu.isolation`."""
        isolated = self.settings.isolated
        made: Any = (isolation.parts if isolated else instance.parts)(self, component, *arguments)
        if node := self.settings.log_file:
            log_file.attach(component, node, [part.trace for part in made])
        return made


def block(entry: BlockEntry) -> type[Block]:
    """The block type that a diagram's entry of kind `fmu` names.

    Raises: MissingFile, ArchiveError, CompilerMissing, BuildFailed, FmuError, UnknownPort, WrongShape, WrongType,
    WrongValue, ExpressionError.
    """
    folder, description = read_description(entry.path, entry.type.position)
    fmu = ForeignFmu(entry.path, folder, description, settings.read(entry, description), {})
    binary = folder, fmu.interface.modelIdentifier, fmu.version, fmu.name, entry.type.position
    c_sources.provide(*binary)
    archive.binary(*binary)
    try:
        ports = read_ports(description, structural.sizes(entry, description))
        fmu.hidden = hidden(description, ports)
        fmu.ports = port_names.named(ports, entry, fmu.hidden)
        binary_data.check(entry, fmu.ports)
        structure.read_structure(fmu)
        declaration = declared.declaration(fmu, entry)
    except FmuError as error:
        raise FmuError(f"`{fmu.name}`: {error.message}", entry.type.position, error.fix) from None
    made: type[Block] = type(description.modelName, (Block,), {"__doc__": description.description})
    made.declaration = declaration
    declaration.foreign = fmu
    declaration.elsewhere = {**fmu.hidden, **port_names.elsewhere(fmu.ports, description)}
    return made
