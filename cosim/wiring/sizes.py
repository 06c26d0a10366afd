"""How much memory a run needs and how much there is, judged before anything is allocated."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Container, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from cosim.authoring.variables import CalculatedParameter, Local, Output, State, Variable
from cosim.errors import Position, Problems, TooLarge
from cosim.wiring.jumps import room
from cosim.wiring.loops import systems
from cosim.wiring.network import Component, Loop, Network

COPIES = 2
"""Of the arena: the table's, from which each run begins, and the run's own."""


def fit(components: Iterable[Component], problems: Problems) -> bool:
    """Whether the variables of all components, as far as their dimensions are known, fit into memory; else a report."""
    sizes = {
        (component.name, variable.name): (_bytes(component, variable, continuous), component, variable)
        for component in components
        for continuous in (set(component.declaration.continuous()),)
        for variable in component.declaration.variables.values()
    }
    if not sizes:
        return True
    needed, there = COPIES * sum(size for size, _, _ in sizes.values()), memory()
    if needed <= there:
        return True
    size, component, variable = max(sizes.values(), key=lambda entry: entry[0])
    shape = " × ".join(map(str, ((component.count,) if component.fleet else ()) + component.shape(variable)))
    message = (
        f"the run needs {text(needed)} of memory, and there are {text(there)}; "
        f"block {component.name}: `{variable.name}` ({shape}) alone takes {text(COPIES * size)}"
    )
    place = component.entry.settings.get("per", component.entry.type).position
    fix = f"a smaller fleet `{component.fleet}`" if component.fleet else "smaller dimensions"
    problems.add(TooLarge(message, place, fix))
    return False


def require_of_loops(network: Network) -> None:
    """Raises: TooLarge for an algebraic loop of so many unknowns that there is no memory for its matrix."""
    for loop in {item: None for item in (*network.initial, *network.evaluation) if isinstance(item, Loop)}:
        members, unknowns = systems(network, loop)
        parts = ", ".join(dict.fromkeys(task.component for task in loop.tasks))
        what = f"the {members * unknowns} unknowns of the algebraic loop of {parts}"
        place = network.components[loop.torn[0].component].entry.position
        fix = "let one of these blocks read a state instead, or sample it"
        require(COPIES * 8 * members * unknowns**2, what, place, fix)


def require_of_delays(network: Network) -> None:
    """Raises: TooLarge for an input that is read so late that there is no memory for the samples until then."""
    late = [(c, port, coupling) for c in network.components.values() for port, coupling in c.couplings.items()]
    for component, port, coupling in late:
        if component.is_late(port):
            samples, size = room(network, coupling), component.nbytes(component.declaration.variables[port])
            read = f"`{port}`, which is read {float(coupling.delay):g} s late"
            what = f"block {component.name}: the {samples} samples of {read},"
            fix = "a longer step" if network.smallest_step is None else "a longer run.smallest_step"
            place = component.entry.inputs[port].beside["delay"].place
            require(COPIES * samples * component.count * size, what, place, fix)


def _bytes(component: Component, variable: Variable, continuous: Container[Variable]) -> int:
    """What a variable takes at least: what is given or wired may be shared, what is computed is not."""
    if not isinstance(variable, (State, Output, Local, CalculatedParameter)) or component.signal_axes(variable) is None:
        return 0
    copies = 3 if variable in continuous else 2 if isinstance(variable, State) else 1
    return copies * component.count * component.nbytes(variable)


LITTLE = 1 << 16
"""Bytes that are always there: to ask how many there are takes a while."""


def require(needed: int, what: str, position: Position | None, fix: str) -> None:
    """Raises: TooLarge where so many bytes are not there."""
    if needed > LITTLE and needed > (there := memory()):
        raise TooLarge(f"{what} need {text(needed)} of memory, and there are {text(there)}", position, fix)


def text(size: float) -> str:
    """A number of bytes as people read it."""
    power = min(5, int(math.log2(max(size, 1)) // 10))
    return f"{size / 1024**power:.3g} {('bytes', 'KiB', 'MiB', 'GiB', 'TiB', 'PiB')[power]}"


def memory() -> int:
    """The bytes that this process may have at most: of the machine, of its container, of its own limits."""
    return min((*_physical(), *_of_container(), *_of_process()), default=sys.maxsize)


def _physical() -> Iterator[int]:
    if sys.platform == "win32":
        import ctypes

        class Status(ctypes.Structure):
            _fields_ = (
                *((name, ctypes.c_ulong) for name in ("size", "load")),
                *(
                    (name, ctypes.c_ulonglong)
                    for name in ("total", "free", "all", "all_free", "space", "left", "extended")
                ),
            )

        status = Status(ctypes.sizeof(Status))
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            yield status.total
        return
    with suppress(ValueError, OSError):
        yield os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _of_container(root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")) -> Iterator[int]:
    """The limits of this process's control groups, of version 1 or 2, and of all that these are in."""
    with suppress(OSError):
        for line in own.read_text().splitlines():
            _, kind, name = line.split(":", 2)
            base, file = {"": (root, "memory.max"), "memory": (root / "memory", "memory.limit_in_bytes")}.get(
                kind, (root, "")
            )
            path = base / name.strip("/")
            for folder in (path, *path.parents) if file else ():
                with suppress(OSError, ValueError):  # the root has none, and "max" is no number
                    yield int((folder / file).read_text())


def _of_process() -> Iterator[int]:
    with suppress(ImportError):
        import resource

        for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA):
            limit = resource.getrlimit(kind)[0]
            if limit != resource.RLIM_INFINITY:
                yield limit
