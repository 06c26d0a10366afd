"""The layers of a diagram, from the bottom up: the file it extends, the file, --swap, --set; merged by key.

Mappings merge, everything else replaces, `name+: […]` adds to a list, and `~` takes away. A layer
that changes a block's type makes what the layers below say of that block's parameters, starts, inputs and the like
`inherited`: the new type declares it too, or it is dropped, which `cosim.language.swaps` lets nobody do in silence.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from cosim.errors import (
    CircularExtends,
    CosimError,
    Position,
    Problems,
    TooLarge,
    UnknownSetting,
    WrongType,
    WrongValue,
    nearest,
)
from cosim.language import source
from cosim.language.keys import ADDS, ANY, DIAGRAM, TYPES, Key
from cosim.language.source import Node, describe

MOST_LAYERS = 100
_VALUES = ("parameters", "start")
_NAMED = re.compile(r".*:.*|[^\W\d][\w.]*")
"""How a block type is named, rightly or not: its class, perhaps with its pack or module."""
_RIVALS = {"file": ("sha256",), "column": ("array",), "array": ("column",)}
"""What a value in a file loses as a layer says that it is another one."""


def read_layers(path: Path, problems: Problems, named_at: Position | None = None) -> tuple[Node, list[Path]]:
    """The tree of a file over those that it extends, and the files in the order of reading.

    Raises: MissingFile, TooLarge, YamlSyntaxError, WrongType, CircularExtends.
    """
    return layered(lambda: source.read(path, problems, named_at), path, problems, named_at)


def layered(
    read: Callable[[], Node], path: Path, problems: Problems, named_at: Position | None = None
) -> tuple[Node, list[Path]]:
    """As `read_layers`; read: gives the uppermost layer, which counts as the file `path`."""
    layers: list[Node] = []
    files: list[Path] = []
    while True:
        if any(os.path.realpath(path) == os.path.realpath(file) for file in files):
            chain = " → ".join(str(file) for file in [*files, path])
            raise CircularExtends(f"the diagram extends itself: {chain}", named_at, "remove this `extends`")
        if len(files) >= MOST_LAYERS:
            raise TooLarge(f"more than {MOST_LAYERS} diagrams extend each other", named_at, "use fewer layers")
        layer = source.read(path, problems, named_at) if files else read()
        files.append(path)
        layers.append(replace(layer, value={key: node for key, node in layer.value.items() if key != "extends"}))
        extends = layer.value.get("extends")
        if extends is None or extends.value is None:
            break
        if not isinstance(extends.value, str):
            message = f"`extends` must name a file, not {describe(extends)}"
            raise WrongType(message, extends.position, "such as extends: formation.yaml")
        named_at = extends.position
        path = Path(os.path.normpath(path.parent / extends.value))
    tree = layers.pop()
    for layer in reversed(layers):
        tree = merge(tree, layer)
    return tree, files


def merge(base: Node, over: Node, path: tuple[str, ...] = ()) -> Node:
    """One layer over another. A merged mapping keeps the lower one's place, a block that of its type."""
    if isinstance(base.value, dict) and over.blank:
        return base
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    is_block = len(path) == 2 and path[0] == "blocks"
    over = _with_outputs(base.value, over) if is_block else over
    retyped = is_block and _changes_type(base.value, over.value)
    entries = _inherited(base.value) if retyped else dict(base.value)
    for key, node in sorted(over.value.items(), key=lambda entry: entry[0].endswith(ADDS)):
        if node.value is None and not node.blank and key in base.value:
            entries.pop(key, None)
        elif before := _before(entries, key, node):
            entries[before] = replace(entries[before], value=[*entries[before].value, *node.value])
        else:
            entries.pop(f"{key}{ADDS}", None)  # what was to be added to what this replaces
            entries[key] = merge(entries[key], node, (*path, key)) if key in entries else node
    for key in over.value if path[2:] and path[2] in _VALUES else ():
        for rival in _RIVALS.get(key, ()):
            if rival not in over.value:
                entries.pop(rival, None)
    if retyped:
        _note_replaced(base.value, entries)
    return replace(over if retyped and over.position.line else base, value=entries)


def _before(entries: dict[str, Node], key: str, node: Node) -> str:
    """The key of the list to which a layer adds another by `name+`, perhaps an addition itself; "" if there is none."""
    name = key.removesuffix(ADDS)
    if name == key or not isinstance(node.value, list):
        return ""
    return next((known for known in (name, key) if known in entries and isinstance(entries[known].value, list)), "")


def _with_outputs(base: dict[str, Node], over: Node) -> Node:
    """A layer of a block that says another expression for some outputs of several, with the others."""
    key = "expression"
    if key in base and key in over.value and isinstance(base[key].value, dict):
        node = over.value[key]
        whole = replace(merge(base[key], node), position=node.position, key_position=node.key_position)
        return replace(over, value={**over.value, key: whole})
    return over


def _changes_type(base: dict[str, Node], over: dict[str, Node]) -> bool:
    types = [(key, over[key].plain()) for key in TYPES if key in over and over[key].value is not None]
    return bool(types) and types != [(key, base[key].plain()) for key in TYPES if key in base]


def _inherited(block: dict[str, Node]) -> dict[str, Node]:
    """What remains of a block whose type is replaced: all but the type and what it drops, marked as for another."""
    names = dropped_names(block.get("drop"))
    remains = {}
    for key, entry in block.items():
        if key in TYPES or key == "drop" or (key in names and entry.inherited):
            continue
        node = entry
        if isinstance(node.value, dict):
            kept = {n: v for n, v in node.value.items() if not (v.inherited and {n, f"{key}.{n}"} & names)}
            node = replace(node, value=kept)
        remains[key] = node if key == "per" else _marked(node)
    return remains


def dropped_names(drop: Node | None) -> set[str]:
    """What a block's `drop:` names; one name or a list of them."""
    if drop is None:
        return set()
    nodes = drop.value if isinstance(drop.value, list) else [drop]
    return {node.value for node in nodes if isinstance(node.value, str)}


def _note_replaced(base: dict[str, Node], entries: dict[str, Node]) -> None:
    """Let the new type say which it replaces."""
    before = next(((key, base[key]) for key in TYPES if key in base), None)
    for key in TYPES:
        if key in entries:
            entries[key] = replace(entries[key], replaces=before)


def _marked(node: Node) -> Node:
    if isinstance(node.value, dict):
        return replace(node, inherited=True, value={k: replace(n, inherited=True) for k, n in node.value.items()})
    return replace(node, inherited=True)


@dataclass(frozen=True)
class Change:
    """What one layer changes: the value at a dotted path or, as a swap, the type of a block."""

    name: str
    node: Node
    is_swap: bool = False

    def applied(self, tree: Node) -> Node:
        """The tree with it. Raises: UnknownSetting."""
        if self.is_swap:
            return swap_type(tree, self.name, self.node)
        return set_value(tree, self.name, self.node, self.node.position)


def apply_swaps(tree: Node, swaps: Iterable[str], problems: Problems) -> Node:
    """The tree with each `block=Type` of --swap applied."""
    for swap in swaps:
        position = Position(f"--swap {swap}")
        name, _, new = (part.strip() for part in swap.partition("="))
        try:
            if not (name and new):
                raise UnknownSetting(f"`{swap}` is no swap", position, "write --swap block=Type")
            tree = swap_type(tree, name, Node(new, position, position))
        except CosimError as error:
            problems.add(error)
    return tree


def swap_type(tree: Node, name: str, new: Node) -> Node:
    """The tree with another type for a block: a class, `file.py:Class`, an FMU, a diagram or an expression.

    Raises: UnknownSetting.
    """
    blocks = _child(tree, "blocks")
    if not _has_block(blocks, name):
        raise UnknownSetting(f"there is no block `{name}` to swap", new.place, nearest(name, blocks))
    block = Node({_kind(new.value): new}, new.place, new.place)
    return merge(tree, _nested(["blocks", name], block, new.place))


def _kind(written: Any) -> str:
    """Which kind of type somebody names who says no kind: what is no name of a block or a file is an expression."""
    text = str(written)
    if isinstance(written, dict):
        return "expression"
    if ".py:" in text:
        return "python"
    if kind := {".fmu": "fmu", ".yaml": "diagram", ".yml": "diagram"}.get(Path(text).suffix.lower()):
        return kind
    return "block" if _NAMED.fullmatch(text) else "expression"


def apply_settings(tree: Node, settings: Iterable[str | Change], problems: Problems) -> Node:
    """The tree with each `a.b.c=value` of --set applied, and each change that a program makes."""
    for setting in settings:
        try:
            tree = (_read_setting(setting) if isinstance(setting, str) else setting).applied(tree)
        except CosimError as error:
            problems.add(error)
    return tree


def _read_setting(text: str) -> Change:
    """What `a.b.c=value` of --set says. Raises: UnknownSetting, WrongValue, and as `parse_value`."""
    position = Position(f"--set {text}")
    path, equals, value = text.partition("=")
    if not equals:
        raise UnknownSetting(f"`{text}` is no setting", position, "write --set run.stop=10")
    if not value.strip():
        message = f"`{path.strip()}` is set to nothing"
        raise WrongValue(message, position, f"write --set {path.strip()}=VALUE, or =~ to take it away")
    return Change(path.strip(), source.parse_value(value, position))


def set_value(tree: Node, path: str, value: Node, position: Position) -> Node:
    """The tree with another value at a dotted path.

    Raises: UnknownSetting.
    """
    return merge(tree, _overlay(tree, path.split("."), value, DIAGRAM, position))


def _overlay(
    node: Node, path: list[str], value: Node, grammar: Mapping[str, Key], position: Position, done: tuple[str, ...] = ()
) -> Node:
    """The layer that changes only what stands at the path below a node.

    Raises: UnknownSetting.
    """
    if not path:
        return replace(value, key_position=position)
    if isinstance(node.value, list):
        return _element(node, path, value, position, done)
    if path[-1].endswith(ADDS) and (longer := _addition(node, path, value, grammar, position, done)):
        return longer
    key, rest = _match(node, path, grammar, position, done)
    declared = grammar.get(ANY) or grammar.get(key)
    below = declared.below if declared else {}
    child = node.value.get(key) if isinstance(node.value, dict) else None
    child = child or Node({} if below else None, position)
    return _nested([key], _overlay(child, rest, value, below, position, (*done, key)), position)


def _addition(
    node: Node, path: list[str], value: Node, grammar: Mapping[str, Key], position: Position, done: tuple[str, ...]
) -> Node | None:
    """The layer that adds to a list at the path, whose last key ends with `+`; None where it leads on.

    Raises: UnknownSetting.
    """
    key, rest = _match(node, [*path[:-1], path[-1].removesuffix(ADDS)], grammar, position, done)
    if rest:
        return None
    there = _child_mapping(node).get(key)
    if there is None or not isinstance(there.value, list):
        said = f"is {describe(there)}" if there else "is not there"
        where = ".".join((*done, key))
        raise UnknownSetting(f"`{where}` {said}, so nothing is added to it", position, f"set `{where}` as a whole")
    if not isinstance(value.value, list):
        message = f"a list is added to a list, not {describe(value)}"
        raise UnknownSetting(message, position, f"write {key}+=[{value.plain()}]")
    return _nested([f"{key}{ADDS}"], value, position)


def _match(
    node: Node, path: list[str], grammar: Mapping[str, Key], position: Position, done: tuple[str, ...]
) -> tuple[str, list[str]]:
    """The key that the path's beginning names, and the rest of the path. Keys may contain dots.

    Raises: UnknownSetting.
    """
    where = ".".join(done) or "the diagram"
    known = node.value if isinstance(node.value, dict) else {}
    for end in range(len(path), 0, -1):
        key = ".".join(path[:end])
        if key in known or (key in grammar and key not in (ANY, "extends")):
            return key, path[end:]
    if not grammar:
        value = "nothing" if node.value is None else describe(node)
        raise UnknownSetting(f"`{where}` is {value} and has no `{path[0]}`", position, f"set `{where}` as a whole")
    is_value_list = ANY in grammar and (grammar[ANY].type or not grammar[ANY].below) and done[0] != "fleets"
    if is_value_list and not path[-1].isdecimal():
        return ".".join(path), []
    if ANY in grammar and len(path) == 1 and done[0] in ("blocks", "metrics"):
        return path[0], []
    if done == ("blocks",) and _has_block(known, path[0]):
        return path[0], path[1:]
    if len(done) == 2 and done[0] == "blocks" and (section := _section_of(known, path[0], grammar)):
        return section, path
    message = f"`{where}` has no `{'.'.join(path) if is_value_list else path[0]}`"
    fix = nearest(path[0], {*known, *grammar} - {ANY, "extends"})
    if not done and len(path) > 1 and "blocks" in known and path[0] in _child_mapping(known["blocks"]):
        fix = f"write blocks.{path[0]}.parameters.{'.'.join(path[1:])}, or .start. for a state"
    raise UnknownSetting(message, position, fix)


def _section_of(block: Mapping[str, Node], name: str, grammar: Mapping[str, Key]) -> str:
    """Of a block's value that is named alone, `blocks.plant.mass`, the section: its start values, else its parameters.

    None where a key of the block's is rather meant, misspelt.
    """
    if name in _child(Node(dict(block), Position("")), "start"):
        return "start"
    given = name in _child(Node(dict(block), Position("")), "parameters")
    return "parameters" if given or not get_close_matches(name, {*grammar} - {ANY}, n=1, cutoff=0.75) else ""


def _element(node: Node, path: list[str], value: Node, position: Position, done: tuple[str, ...]) -> Node:
    """The list with one element changed.

    Raises: UnknownSetting.
    """
    items = list(node.value)
    where = ".".join(done)
    if not (path[0].isdecimal() and int(path[0]) < len(items)):
        fix = f"its elements are 0 to {len(items) - 1}" if items else "it is empty"
        raise UnknownSetting(f"`{where}` has no element `{path[0]}`", position, fix)
    index = int(path[0])
    change = _overlay(items[index], path[1:], value, {}, position, (*done, path[0]))
    items[index] = replace(merge(items[index], change), key_position=None)
    return Node(items, node.position, node.key_position)


def _has_block(blocks: dict[str, Node], name: str) -> bool:
    """Whether a block is there, or a diagram that it may be inside of."""
    outers = (outer for outer in blocks if name.startswith(f"{outer}/"))
    return name in blocks or any("diagram" in _child_mapping(blocks[outer]) for outer in outers)


def _child(node: Node, key: str) -> dict[str, Node]:
    child = _child_mapping(node).get(key)
    return _child_mapping(child) if child else {}


def _child_mapping(node: Node) -> dict[str, Node]:
    return node.value if isinstance(node.value, dict) else {}


def _nested(path: list[str], value: Node, position: Position) -> Node:
    for key in reversed(path):
        value = Node({key: replace(value, key_position=value.key_position or position)}, position)
    return value
