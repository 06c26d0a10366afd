"""Diagrams as blocks of a diagram: unfolded while reading, so that only blocks and wires between them remain.

The blocks of a diagram that is the block `outer` are called `outer/inner`. Its `inputs:` name the inner ports that each
input drives, its `outputs:` the inner port that each output shows. What the outer diagram says of `outer/inner` lies
over what the inner diagram says of `inner`, so that any block can be swapped.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosim.errors import (
    CircularExtends,
    Problems,
    TooLarge,
    TwoDrivers,
    UnknownParameter,
    UnknownPort,
    WrongValue,
    nearest,
)
from cosim.language import grammar
from cosim.language.entry import BlockEntry, read_entry
from cosim.language.keys import TYPES
from cosim.language.overlay import merge, read_layers
from cosim.language.reader import Reader, endpoint
from cosim.language.source import Node
from cosim.language.swaps import Swap, settle_diagram

MOST_DIAGRAMS, MOST_BLOCKS, MOST_LEVELS = 1000, 100_000, 50
"""Inside one diagram; each diagram in it is read and merged anew, in a few milliseconds."""
_HANDED = ("parameters", "start", "dimensions")
"""What a diagram that is a block hands on to the blocks inside it, by `inner.name`."""


@dataclass
class Unfolded:
    """The blocks of a diagram, those of diagrams inside it among them, and its own ports.

    shown: the outputs of each diagram that was unfolded. unread: the blocks that could not be understood.
    swaps: of blocks that are diagrams. diagrams: how many were unfolded.
    """

    blocks: dict[str, BlockEntry] = field(default_factory=dict)
    inputs: dict[str, list[Node]] = field(default_factory=dict)
    outputs: dict[str, Node] = field(default_factory=dict)
    shown: dict[str, dict[str, Node]] = field(default_factory=dict)
    unread: set[str] = field(default_factory=set)
    swaps: list[Swap] = field(default_factory=list)
    diagrams: int = 0

    def rewired(self, node: Node, problems: Problems) -> Node:
        """A source, or a list of them, with an output of an unfolded diagram replaced by the inner port."""
        if isinstance(node.value, list):
            return replace(node, value=[self.rewired(child, problems) for child in node.value])
        block, port = endpoint(node.value) if isinstance(node.value, str) else ("", "")
        if block not in self.shown or not port:
            return node
        outputs = self.shown[block]
        port, bracket, rest = port.partition("[")
        taken = bracket + rest
        if port in outputs and taken and "[" in str(outputs[port].value):
            message = f"`{node.value}`: `{port}` is {outputs[port].value}, some members only"
            problems.add(UnknownPort(message, node.position, "declare an output with the members that are wanted"))
            return node
        if port not in outputs:
            message = f"block `{block}`: the diagram has no output `{port}`"
            problems.add(UnknownPort(message, node.position, nearest(port, outputs) or "declare it below `outputs:`"))
            return node
        return replace(node, value=f"{outputs[port].value}{taken}" if taken else outputs[port].value)


def unfold(tree: Node, path: Path, files: list[Path], reader: Reader, chain: tuple[str, ...] = ()) -> Unfolded:
    """What a tree that conforms to the grammar unfolds to; mistakes go to the reader's problems.

    files: gains those that are read. chain: the real paths of the diagrams that this one is inside of.
    """
    problems, written = reader.problems, _section(tree, "blocks")
    if not written:
        reader.missing(
            tree.value.get("blocks", tree), "the diagram has no `blocks`", "write `blocks:` and one below it"
        )
    unfolded = Unfolded()
    chain = (*chain, os.path.realpath(path))
    overlays = _overlays(written)
    typed = [name for name, node in written.items() if set(TYPES) & set(_mapping(node))]
    for name, node in written.items():
        if node.value is None and not any(name in below for below in overlays.values()):
            message = f"`{name}: ~` takes away a block inside a diagram, and there is no such diagram"
            reader.problems.add(WrongValue(message, node.place, "remove this line"))
            continue
        if any(name in below for below in overlays.values()):
            continue
        entry = read_entry(name, node, reader, typed)
        if entry and entry.kind == "diagram":
            below = {key.removeprefix(f"{name}/"): value for key, value in overlays.get(name, {}).items()}
            _add_diagram(unfolded, entry, below, files, reader, chain)
        elif entry:
            unfolded.blocks[name] = entry
        else:
            unfolded.unread.add(name)
    for block in unfolded.blocks.values():
        block.inputs = {port: unfolded.rewired(node, problems) for port, node in block.inputs.items()}
    for name, node in _section(tree, "inputs").items():
        unfolded.inputs[name] = reader.endpoints(node, f"inputs.{name}")
    for name, node in _section(tree, "outputs").items():
        if reader.endpoint(node, f"outputs.{name}"):
            unfolded.outputs[name] = unfolded.rewired(node, problems)
    return unfolded


def _mapping(node: Node) -> dict[str, Node]:
    return node.value if isinstance(node.value, dict) else {}


def _section(tree: Node, key: str) -> dict[str, Node]:
    return tree.value[key].value if key in tree.value else {}


def _overlays(written: Mapping[str, Node]) -> dict[str, dict[str, Node]]:
    """For each diagram among the blocks, what stands beside it about blocks inside it."""
    diagrams = [name for name, node in written.items() if "diagram" in _mapping(node)]
    return {d: {name: node for name, node in written.items() if name.startswith(f"{d}/")} for d in diagrams}


def _add_diagram(
    unfolded: Unfolded,
    outer: BlockEntry,
    overlay: dict[str, Node],
    files: list[Path],
    reader: Reader,
    chain: tuple[str, ...],
) -> None:
    """Add the blocks of the diagram that `outer` is, with what `outer` says of them."""
    inner = None if _are_too_many(reader) else reader.problems.attempt(_read, outer, overlay, files, reader, chain)
    if inner is None or _are_too_many(reader):  # nothing else is worth reading then
        unfolded.unread.add(outer.name)
        return
    unfolded.diagrams += 1 + inner.diagrams
    if unfolded.diagrams > MOST_DIAGRAMS or len(unfolded.blocks) + len(inner.blocks) > MOST_BLOCKS:
        message = f"block `{outer.name}`: more than {MOST_DIAGRAMS} diagrams or {MOST_BLOCKS} blocks unfold"
        reader.problems.add(TooLarge(message, outer.type.position, "write `per: fleet` for many of one kind"))
        unfolded.unread.add(outer.name)
        return
    names = {name: f"{outer.name}/{name}" for name in inner.blocks}
    blocks = {name: _renamed(entry, names, outer, reader.problems) for name, entry in inner.blocks.items()}
    handed = {s: {k for k in getattr(outer, s) if endpoint(k)[0] in blocks} for s in _HANDED}
    swap = settle_diagram(outer, {**handed, "inputs": inner.inputs}, reader.problems)
    unfolded.swaps += [*inner.swaps, *([swap] if swap else [])]
    _hand_values(outer, blocks, reader.problems)
    _hand_wires(outer, inner, blocks, reader.problems)
    unfolded.shown[outer.name] = {port: _moved(node, names) for port, node in inner.outputs.items()}
    unfolded.unread |= {f"{outer.name}/{name}" for name in inner.unread}
    unfolded.blocks.update({entry.name: entry for entry in blocks.values()})


def _are_too_many(reader: Reader) -> bool:
    return any(isinstance(error, TooLarge) for error in reader.problems.errors)


def _read(
    outer: BlockEntry, overlay: dict[str, Node], files: list[Path], reader: Reader, chain: tuple[str, ...]
) -> Unfolded:
    """What the diagram that a block is unfolds to.

    Raises: CircularExtends, MissingFile, TooLarge, YamlSyntaxError, WrongType.
    """
    path, place = outer.path, outer.type.position
    if len(chain) > MOST_LEVELS:
        message = f"block `{outer.name}`: diagrams in diagrams are more than {MOST_LEVELS} levels deep"
        raise TooLarge(message, place, "use fewer levels")
    if os.path.realpath(path) in chain:
        message = f"block `{outer.name}`: the diagram `{path}` contains itself"
        raise CircularExtends(message, place, "name another diagram here")
    tree, read = read_layers(path, reader.problems, place)
    files += [file for file in read if file not in files]
    if overlay:
        tree = merge(tree, Node({"blocks": Node(overlay, outer.position)}, outer.position))
    return unfold(grammar.conform(tree, reader.problems), path, files, reader, chain)


def _renamed(entry: BlockEntry, names: Mapping[str, str], outer: BlockEntry, problems: Problems) -> BlockEntry:
    """An inner block as a block of the outer diagram, for each member of the outer block's fleet."""
    per, own = outer.settings.get("per"), entry.settings.get("per")
    if per and own:
        message = f"block `{outer.name}`: its block `{entry.name}` has a `per` of its own"
        problems.add(WrongValue(message, own.place, f"remove it here, or in `{outer.name}`"))
    inputs = {port: _moved(node, names) for port, node in entry.inputs.items()}
    settings = {**entry.settings, "per": per} if per else entry.settings
    return replace(entry, name=names[entry.name], settings=settings, inputs=inputs)


def _moved(node: Node, names: Mapping[str, str]) -> Node:
    """A source, or a list of them, with the blocks renamed."""
    if isinstance(node.value, list):
        return replace(node, value=[_moved(child, names) for child in node.value])
    block, port = endpoint(node.value) if isinstance(node.value, str) else ("", "")
    return replace(node, value=f"{names[block]}.{port}") if port and block in names else node


def _hand_values(outer: BlockEntry, blocks: dict[str, BlockEntry], problems: Problems) -> None:
    """Give each `inner.name: value` of the outer block to the inner block."""
    for section in _HANDED:
        for key, node in getattr(outer, section).items():
            inner, name = endpoint(key)
            if inner in blocks and name:
                block = blocks[inner]
                setattr(block, section, {**getattr(block, section), name: node})
            else:
                fix = nearest(inner, blocks) if name else f"write inner.{key}, where inner is a block of the diagram"
                message = f"block `{outer.name}`: the diagram has no block `{inner}`"
                problems.add(UnknownParameter(message if name else f"{message[:-1]}.…` in `{key}`", node.place, fix))


def _hand_wires(outer: BlockEntry, inner: Unfolded, blocks: dict[str, BlockEntry], problems: Problems) -> None:
    """Let each wire to an input of the outer block end at the inner ports that the input drives."""
    for name, targets in inner.inputs.items():
        for target in targets:
            block, port = endpoint(target.value)
            if block not in blocks:
                message = f"input `{name}`: the diagram has no block `{block}`"
                problems.add(UnknownPort(message, target.position, nearest(block, blocks)))
            elif name in outer.inputs and port in blocks[block].inputs:
                other = blocks[block].inputs[port].place
                message = f"`{blocks[block].name}.{port}` has two drivers: input `{name}` and the wire at {other}"
                problems.add(TwoDrivers(message, target.position, "remove one of them"))
            elif name in outer.inputs:
                blocks[block].inputs = {**blocks[block].inputs, port: outer.inputs[name]}
    for name, node in outer.inputs.items():
        if name not in inner.inputs:
            message = f"block `{outer.name}`: the diagram has no input `{name}`"
            problems.add(UnknownPort(message, node.place, nearest(name, inner.inputs) or "declare it below `inputs:`"))
