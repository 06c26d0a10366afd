"""Compiles authors' functions, each behind one C ABI, and caches the object code in the user's cache folder.

Every kernel is ``int32 kernel(double time, uint8 *base, int64 *frame)`` and returns an FMI status. The frame is
``[fault…, instances, sizes of run-time dimensions…, (offset, stride) per argument…]`` in words of 64 bits (see
`cosim.adapters`); offsets are bytes from `base`, strides are bytes between two instances (0: all instances share the
value). A function that fails writes to `fault` what is to be told of it.

A source is compiled once: the cache is keyed by the bytecode of the functions and all that they reach, the shapes,
the versions of the compilers, and the processor. A warm start imports neither numba nor anything of it.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cosim import cache, native
from cosim.adapters import Source, block_source, raw_source
from cosim.block import Declaration


@dataclass
class Module:
    """The compiled functions of one block type or of the engine."""

    name: str
    code: bytes
    key: str
    compiled_now: bool

    def load(self) -> native.Library:
        """Load into this process; one copy for all users of the same code."""
        if self.key not in _loaded:
            _loaded[self.key] = native.Library(self.code)
        return _loaded[self.key]


_loaded: dict[str, native.Library] = {}


def module(name: str, sources: Iterable[Source]) -> Module:
    """The compiled sources, from the cache or compiled now.

    Raises: KernelError, naming the function that the compiler cannot take.
    """
    sources = tuple(sources)
    key = _key([s.symbol + s.fingerprint for s in sources])
    path = cache.folder() / f"{name}-{key}.o"
    if path.exists():
        return Module(name, path.read_bytes(), key, compiled_now=False)
    if sys.stderr.isatty():
        print(f"compiling {name.partition('-')[0]}, once…", file=sys.stderr)
    from cosim import compiler

    code = compiler.compile_object(name, sources)
    cache.write(path, code)
    return Module(name, code, key, compiled_now=True)


def _key(parts: Iterable[str]) -> str:
    machine = (*native.host(), *cache.toolchain())
    return hashlib.sha256(json.dumps([*parts, *machine]).encode()).hexdigest()[:24]


def block_module(declaration: Declaration, constants: dict[str, int]) -> Module:
    """The kernels of a block type, one symbol a function. constants: the dimensions that are part of the code."""
    name = f"{declaration.name}-" + "-".join(f"{k}{v}" for k, v in constants.items())
    sources = [block_source(declaration, function, constants) for function in declaration.functions]
    return module(name.rstrip("-"), sources)


def engine_module() -> Module:
    """The compiled loop: symbols `run` and `execute` of `cosim.engine`, behind the kernel ABI."""
    from cosim import engine

    return raw_module("engine", (engine.run, engine.execute))


def raw_module(name: str, functions: Iterable[Callable[[float, int, int], int]]) -> Module:
    """Compiled functions of a time and two addresses, each behind the kernel ABI under its own name."""
    return module(name, [raw_source(name, function) for function in functions])
