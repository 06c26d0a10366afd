"""Why two runs part: what is told of a block otherwise in the two diagrams, and how that goes along the wires."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cosim.authoring.variables import Input, Parameter, State, Variable
from cosim.compiling.fingerprint.text import fingerprint
from cosim.tracing.forks import Fork
from cosim.wiring.network import Component, Loop, Network, Signal

_GIVEN: dict[type[Variable], str] = {State: "start of", Parameter: "parameter", Input: "constant input"}


@dataclass(frozen=True)
class Cause:
    """A signal that differs first of its block, where that is told otherwise; else, where nothing that it reads does.

    changes: what is told of the block otherwise, in words.
    """

    signal: Signal
    changes: tuple[str, ...]


@dataclass(frozen=True)
class Trail:
    """causes: where the difference comes from. carried: what differs at the same time by a wire, and through which."""

    causes: tuple[Cause, ...]
    carried: tuple[tuple[Signal, tuple[Signal, ...]], ...]


def trail(a: Network, b: Network, fork: Fork) -> Trail:
    """From the signals that differ first back to what they come from."""
    reads = _reads(b, initial=fork.step == 0)
    carried = {s: tuple(r for r in reads.get(s, ()) if r in fork.branches and r != s) for s in fork.branches}
    first = [s for s, sources in carried.items() if not sources]
    changes = {name: tuple(_changes(a.components[name], b.components[name])) for name in _both(a, b)}
    told = [s for s in carried if changes.get(s.component) and not any(r.component == s.component for r in carried[s])]
    told = told or first or [*carried][:1]
    causes = tuple(Cause(s, changes.get(s.component, ())) for s in told)
    return Trail(causes, tuple((s, sources) for s, sources in carried.items() if sources and s not in told))


def _both(a: Network, b: Network) -> list[str]:
    return [name for name in b.components if name in a.components]


def _reads(network: Network, initial: bool) -> dict[Signal, list[Signal]]:
    """What each signal is computed from at one instant, by what is done there in order; through inputs their sources.

    What is read late is not of that instant.
    """
    found: dict[Signal, list[Signal]] = {}
    inputs: dict[Signal, list[Signal]] = {}  # those that are joined, or copied
    for step in network.initial if initial else network.evaluation:
        for task in step.tasks if isinstance(step, Loop) else (step,):
            read = [source for signal in network.read(task) for source in inputs.get(signal, [signal])]
            late = not task.function and network.components[task.component].is_late(task.port)
            for signal in network.written(task):
                (found if task.function else inputs).setdefault(signal, []).extend([] if late else read)
    return found


def _changes(a: Component, b: Component) -> Iterator[str]:
    """What is told of a block otherwise, in words."""
    if a.declaration.name != b.declaration.name:
        yield f"its type: {a.declaration.name} → {b.declaration.name}"
        return
    for name, variable in b.declaration.variables.items():
        one, other = a.values.get(name), b.values.get(name)
        kind = next((word for type_, word in _GIVEN.items() if isinstance(variable, type_)), "")
        if kind and one is not None and other is not None and not _same(one, other):
            yield f"{kind} {name}: {_value(one, other)}"
    functions = {f.name: f.python for f in a.declaration.functions}
    for function in b.declaration.functions:
        before = functions.get(function.name)
        if before is not function.python and (before is None or fingerprint(before) != fingerprint(function.python)):
            yield f"the code of {function.name}()"
    for port, sources in b.wires.items():
        if a.wires.get(port) != sources or a.couplings.get(port) != b.couplings.get(port):
            yield f"input {port}: {_wired(a, port)} → {_wired(b, port)}"
    own_times = {"period", "offset"} & (a.entry.settings.keys() | b.entry.settings.keys())
    if own_times and a.clock != b.clock:
        yield "when it is due"
    if a.integration != b.integration:
        yield "its integration"


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    try:
        one, other = np.broadcast_arrays(one, other)
    except ValueError:  # of other dimensions, which is told as such
        return True
    return bool(np.all((one == other) | ((one != one) & (other != other))))  # noqa: PLR0124


def _wired(component: Component, port: str) -> str:
    sources = ", ".join(map(str, component.wires.get(port, ()))) or "nothing"
    coupling = component.couplings.get(port)
    return f"{sources} (late or extrapolated)" if coupling else sources


def _value(one: np.ndarray, other: np.ndarray) -> str:
    """Two values that differ, with all digits; of arrays, the first elements that do."""
    one, other = np.broadcast_arrays(one, other)  # members of a fleet may share one value
    element = tuple(int(k) for k in np.argwhere((one != other) & ~((one != one) & (other != other)))[0])  # noqa: PLR0124
    where = "" if one.size == 1 else f"[{', '.join(str(k + 1) for k in element)}] "
    return f"{where}{one[element].item()!r} → {other[element].item()!r}"
