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
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from threading import Lock

from cosim.authoring.declaration import Declaration
from cosim.compiling.adapters import KernelSource, block_source, raw_source
from cosim.compiling.amount import bytes_reached
from cosim.compiling.fingerprint.text import obstacle
from cosim.machine import cache, notices, object_code, parallel, siblings, supervision


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


@dataclass(frozen=True)
class ModuleSources:
    """A module that is needed: its name, and what it is made of."""

    name: str
    sources: tuple[KernelSource, ...]

    @cached_property
    def key(self) -> str:
        """What the code depends on."""
        return _key(s.symbol + s.fingerprint for s in self.sources)

    @property
    def obstacle(self) -> str:
        """What keeps the code from being kept, if anything."""
        return next((reason for s in self.sources if (reason := obstacle(s.fingerprint))), "")

    @property
    def work(self) -> int:
        """Roughly how long it takes to compile, in bytes of bytecode."""
        return sum(bytes_reached(s.python, s.absent) * (2 if s.lanes else 1) for s in self.sources)


def module(wanted: ModuleSources) -> Module:
    """A module, from the cache or compiled now.

    Raises: KernelError, naming the function that the compiler cannot take.
    """
    if found := kept(wanted):
        return found
    once = wanted.obstacle
    _say(wanted.name.partition("-")[0], once)
    from cosim.compiling import compiler

    began = clock.perf_counter()
    code = compiler.compile_object(wanted.name, wanted.sources)
    if not once:
        cache.write(_entry(wanted), code)
    return Module(wanted.name, code, wanted.key, True, wanted.sources, clock.perf_counter() - began)


def kept(wanted: ModuleSources) -> Module | None:
    """A module from the cache; None where it is not there."""
    code = None if wanted.obstacle else cache.read(_entry(wanted))
    return None if code is None else Module(wanted.name, code, wanted.key, False, wanted.sources)


def side_by_side(wanted: Sequence[ModuleSources]) -> list[Module | None]:
    """Those of the modules that are in the cache, or that several processes can bring there now.

    None where a module must be compiled by itself: it is the only one, cannot be kept, or there is something wrong
    with it, which `module` tells.
    """
    found = [kept(each) for each in wanted]
    missing = {each.key: each for each, there in zip(wanted, found, strict=True) if not there and not each.obstacle}
    processes = min(len(missing), parallel.processors())
    if processes < 2 or not supervision.AVAILABLE or not cache.is_usable():
        return found
    notices.progress(f"compiling {len(missing)} modules in {processes} processes, once…")
    from cosim.compiling import compiler, helpers

    helpers.target()  # so that not every process has to make it
    ordered = sorted(missing.values(), key=lambda each: each.work, reverse=True)
    done = siblings.shared_out([partial(module, each) for each in ordered], processes, compiler.LOCKS)
    seconds = {ordered[number].key: took for number, took in done.items()}
    again = [there or (kept(each) if each.key in seconds else None) for each, there in zip(wanted, found, strict=True)]
    return [replace(m, compiled_now=True, seconds=seconds[m.key]) if m and m.key in seconds else m for m in again]


def _entry(wanted: ModuleSources) -> str:
    return f"{re.sub(r'[^A-Za-z0-9_-]', '_', wanted.name)[:80]}-{wanted.key}"


def _say(name: str, obstacle: str) -> None:
    """Tell who waits at a terminal what for."""
    why = f"anew at every run, as it depends on {obstacle}, which cannot be followed" if obstacle else "once"
    notices.progress(f"compiling {name}, {why}…")


def _key(parts: Iterable[str]) -> str:
    machine = (*object_code.host(), *cache.toolchain())
    return hashlib.sha256(json.dumps([*parts, *machine]).encode()).hexdigest()[:24]


def block_sources(declaration: Declaration, constants: dict[str, int], fleet: bool = False) -> ModuleSources:
    """The kernels of a block type, one symbol a function. constants: the dimensions that are part of the code.

    fleet: of members that are worth a tile, see `cosim.compiling.tiles`.
    """
    name = f"{declaration.name}-" + "-".join(f"{k}{v}" for k, v in constants.items())
    sources = tuple(block_source(declaration, function, constants, fleet) for function in declaration.functions)
    return ModuleSources(name.rstrip("-"), sources)


def raw_sources(name: str, functions: Iterable[Callable[[float, int, int], int]]) -> ModuleSources:
    """Compiled functions of a time and two addresses, each behind the kernel ABI under its own name."""
    return ModuleSources(name, tuple(raw_source(name, function) for function in functions))
