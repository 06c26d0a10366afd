"""Compiles authors' functions, each behind one C ABI, and caches the object code in the user's cache folder.

Every kernel is ``int32 kernel(double time, uint8 *base, int64 *frame)`` and returns an FMI status. What lies in a frame
says `cosim.compiling.frame`; a function that fails leaves there what is to be told of it.

A source is compiled once: the cache is keyed by the functions and all that they reach, the shapes, the versions of the
compilers, and the processor. What cannot be followed to its end is compiled at every run. A warm start imports neither
numba nor anything of it.
"""

from __future__ import annotations

import hashlib
import json
import re
import time as clock
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock

from cosim.authoring.declaration import Declaration
from cosim.compiling.adapters import KernelSource, block_source, raw_source
from cosim.compiling.fingerprint.text import obstacle
from cosim.machine import cache, notices, object_code


@dataclass
class Module:
    """The compiled functions of one block type or of the engine."""

    name: str
    code: bytes
    key: str
    compiled_now: bool
    sources: tuple[KernelSource, ...]
    seconds: float = 0.0  # that it took to compile, of wall-clock time

    @cached_property
    def meaning(self) -> str:
        """As `key`, but of what the functions compute, whatever lines they stand in."""
        return _key([s.symbol + s.meaning() for s in self.sources])

    def load(self) -> object_code.Library:
        """Load into this process; one copy for all users of the same code."""
        with _loading:
            if self.key not in _loaded:
                _loaded[self.key] = object_code.Library(self.code)
            return _loaded[self.key]


_loading = Lock()
_loaded: dict[str, object_code.Library] = {}


@dataclass
class Kernels:
    """The modules that a program calls, by component, and the loop's; None for a component that stays Python."""

    modules: dict[str, Module | None] = field(default_factory=dict)
    loop: Module | None = None

    @property
    def compiled(self) -> int:
        """How many modules had to be compiled rather than found in the cache."""
        found = {m.key: m for m in (*self.modules.values(), self.loop) if m is not None}
        return sum(m.compiled_now for m in found.values())

    def address(self, component: str, symbol: str) -> int:
        """Where a function of a component is that is compiled. Raises: KeyError."""
        if (component, symbol) not in self._addresses:
            module = self.modules[component]
            assert module
            self._addresses[component, symbol] = module.load().address(symbol)
        return self._addresses[component, symbol]

    @cached_property
    def _addresses(self) -> dict[tuple[str, str], int]:
        """Those that a run has asked for: many runs ask for the same."""
        return {}

    def load(self) -> None:
        """Load all of it, where no other thread is loading."""
        for module in (*self.modules.values(), self.loop):
            if module:
                module.load()


def module(name: str, sources: Iterable[KernelSource]) -> Module:
    """The compiled sources, from the cache or compiled now.

    Raises: KernelError, naming the function that the compiler cannot take.
    """
    sources = tuple(sources)
    if found := kept(name, sources):
        return found
    once = _obstacle(sources)
    _say(name.partition("-")[0], once)
    from cosim.compiling import compiler

    began = clock.perf_counter()
    code, key = compiler.compile_object(name, sources), _key(s.symbol + s.fingerprint for s in sources)
    if not once:
        cache.write(_entry(name, key), code)
    return Module(name, code, key, True, sources, clock.perf_counter() - began)


def kept(name: str, sources: Sequence[KernelSource]) -> Module | None:
    """The compiled sources from the cache; None where they are not in it."""
    key = _key(s.symbol + s.fingerprint for s in sources)
    code = None if _obstacle(sources) else cache.read(_entry(name, key))
    return None if code is None else Module(name, code, key, False, tuple(sources))


def _obstacle(sources: Iterable[KernelSource]) -> str:
    """What keeps the sources from being kept, if anything."""
    return next((reason for s in sources if (reason := obstacle(s.fingerprint))), "")


def _entry(name: str, key: str) -> str:
    return f"{re.sub(r'[^A-Za-z0-9_-]', '_', name)[:80]}-{key}"


def _say(name: str, obstacle: str) -> None:
    """Tell who waits at a terminal what for."""
    why = f"anew at every run, as it depends on {obstacle}, which cannot be followed" if obstacle else "once"
    notices.progress(f"compiling {name}, {why}…")


def _key(parts: Iterable[str]) -> str:
    machine = (*object_code.host(), *cache.toolchain())
    return hashlib.sha256(json.dumps([*parts, *machine]).encode()).hexdigest()[:24]


def block_module(declaration: Declaration, constants: dict[str, int], fleet: bool = False) -> Module:
    """The kernels of a block type, one symbol a function. constants: the dimensions that are part of the code.

    fleet: of members that are worth a tile, see `cosim.compiling.tiles`.
    """
    name = f"{declaration.name}-" + "-".join(f"{k}{v}" for k, v in constants.items())
    sources = [block_source(declaration, function, constants, fleet) for function in declaration.functions]
    return module(name.rstrip("-"), sources)


def raw_module(name: str, functions: Iterable[Callable[[float, int, int], int]]) -> Module:
    """Compiled functions of a time and two addresses, each behind the kernel ABI under its own name."""
    return module(name, raw_sources(name, functions))


def raw_sources(name: str, functions: Iterable[Callable[[float, int, int], int]]) -> tuple[KernelSource, ...]:
    """What `raw_module` compiles."""
    return tuple(raw_source(name, function) for function in functions)
