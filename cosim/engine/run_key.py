"""What a run's figures depend on, as a digest: a member of a study whose key is known needs no run.

Nothing is picked: everything that a run is handed is walked, field by field, so that a field that somebody adds is in
the key. What is left out is named in `IGNORED`, with the reason; a value of an unknown kind is an error.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Dimension, Variable
from cosim.compiling.fingerprint.text import fingerprint
from cosim.compiling.kernels import Kernels
from cosim.engine.program import Program
from cosim.errors import Position
from cosim.integrators import REFERENCES
from cosim.language.diagram import Diagram, RunSettings
from cosim.language.entry import BlockEntry
from cosim.language.keys import INTEGRATION
from cosim.language.source import Node
from cosim.machine.content import content_digest
from cosim.wiring import conditions
from cosim.wiring.network import Component, Network, Signal

IGNORED: dict[type, set[str]] = {
    Program: {"network", "image"}  # walked beside it; the arena is each member's own
    | {"layout"},  # where things lie, which frames in the arena say
    Network: {"swaps"},  # what `cosim check` says
    Diagram: {"title", "path", "files", "extended", "unread", "swaps"}  # names and words
    | {"blocks", "inputs", "outputs"},  # what they are resolved to is in the components
    RunSettings: {"nodes"},  # what YAML says of the other fields
    Component: {"values"},  # each member's own
    BlockEntry: {"type"}  # a name; what stands behind it is fed instead
    | {"parameters", "start", "inputs", "dimensions"}  # in the component
    | {"dropped", "unfit"},  # what is not there
    Declaration: {"doc", "foreign"}  # words; an FMU is fed by its content
    | {"home", "mistakes"}  # the class, whose functions are fed; with mistakes nothing runs
    | {"rules"},  # a member that breaks them before it runs has no row; those that are judged along it are fed
    Dimension: {"description"},
}
"""For each class the fields on which no figure depends, or that are in the key by another way."""
IN_COMPONENT = {"per", "period", "offset", *INTEGRATION}
"""The settings of a block that are in the component, where it does not matter who said so."""

_NO_FIGURES = ("plot", "report", "terminal")
"""The parts of this package that compute nothing of a row."""


def structure(network: Network, program: Program, kernels: Kernels) -> bytes:
    """The digest of all that members of one template share: the files, the network, its program, the kernels."""
    digest = hashlib.sha256(own_files())
    for part in (network, program):
        _feed(digest, part)
    _feed(digest, kernels.loop.meaning if kernels.loop else "python")
    for component, rule, _ in conditions.along(network):
        _feed(digest, [component.name, rule.text, rule.source, fingerprint(rule.function)])
    _feed(digest, code(network, kernels))
    return digest.digest()


def code(network: Network, kernels: Kernels) -> dict[str, str]:
    """By block, the digest of what computes it: its kernels, its FMU's content, its plain Python."""
    found = {}
    for name, component in network.components.items():
        module = kernels.modules.get(name)
        digest = hashlib.sha256((module.meaning if module else "python").encode())
        if foreign := component.declaration.foreign:
            digest.update(content_digest(component.entry.path))
            digest.update(foreign.library())  # which may be compiled from its sources
        elif not component.declaration.compiled:
            _feed(digest, [fingerprint(f.python, interpreted=True) for f in component.declaration.functions])
        found[name] = digest.hexdigest()
    return found


def values(network: Network, signals: Iterable[Signal]) -> dict[Signal, bytes]:
    """The digests of some of a network's values."""
    found = {}
    for signal in signals:
        digest = hashlib.sha256()
        _feed(digest, [str(signal), network.components[signal.component].values[signal.variable]])
        found[signal] = digest.digest()
    return found


def all_values(network: Network) -> dict[Signal, bytes]:
    """The digests of all of a network's values, in one order however they came there."""
    return values(
        network, (Signal(c, name) for c, component in network.components.items() for name in component.values)
    )


def key(shared: bytes, program: Program, digests: Mapping[Signal, bytes]) -> str:
    """The key of one member: what it shares with others (`structure`), and the digests of all its values."""
    digest = hashlib.sha256(shared)
    if program.network.diagram.run.integrator in REFERENCES:
        import scipy  # which it imports anyway

        digest.update(scipy.__version__.encode())
    digest.update(program.arena.data)
    digest.update(b"".join(digests.values()))
    return digest.hexdigest()[:32]


@cache
def own_files() -> bytes:
    """The digest of this package itself, as its files are now: it may be edited where it is installed."""
    digest = hashlib.sha256(json.dumps([sys.version_info[:3], np.__version__]).encode())
    root = Path(__file__).parents[1]
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in _NO_FIGURES:
            digest.update(path.read_bytes())
    return digest.digest()


def _feed(digest: Any, value: Any) -> None:
    """Add a value to a digest, in a form in which no two values are the same. Raises: TypeError for unknown kinds."""
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        digest.update(f"array {value.dtype.str} {value.shape} ".encode() + value.tobytes())
    elif isinstance(value, np.ndarray):
        _feed(digest, [*value.shape, *value.reshape(-1).tolist()])
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))
    elif isinstance(value, list | tuple):
        digest.update(f"list {len(value)} ".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, set | frozenset):
        _feed(digest, sorted(value))
    elif isinstance(value, FunctionType):
        digest.update(f"function {fingerprint(value)} ".encode())
    elif isinstance(value, Position):
        pass  # where something is written changes no figure
    elif isinstance(value, Node):
        _feed(digest, value.plain())
    elif isinstance(value, Variable):
        _feed(digest, [type(value).__name__, {k: v for k, v in vars(value).items() if k != "description"}])
    elif is_dataclass(value) and not isinstance(value, type):
        known = [field.name for field in fields(value) if field.name not in IGNORED.get(type(value), ())]
        if isinstance(value, BlockEntry):
            known.remove("settings")
            _feed(digest, {name: node for name, node in value.settings.items() if name not in IN_COMPONENT})
        _feed(digest, [type(value).__name__, {name: getattr(value, name) for name in known}])
    elif value is None or isinstance(value, str | bool | int | float | Fraction | np.generic | np.dtype):
        digest.update(f"{type(value).__name__} {value!r} ".encode())
    else:
        raise TypeError(f"a {type(value).__name__} cannot be part of a member's key")
