"""Compiles authors' functions, each behind one C ABI, and caches the object code in the user's cache folder.

Every kernel is ``int32 kernel(double time, uint8 *base, int64 *frame)`` and returns an FMI status. The frame is
``[fault, instances, sizes of run-time dimensions…, (offset, stride) per argument…]`` in words of 64 bits; offsets
are bytes from `base`, strides are bytes between two instances (0: all instances share the value). On an exception
`fault` receives the address of numba's record of it.

A source is compiled once: the cache is keyed by the bytecode of the functions and all that they reach, the shapes,
the versions of the compilers, and the processor. A warm start imports neither numba nor anything of it.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import types
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from cosim import native
from cosim.block import Declaration, Function, Variable

FIRST_ARGUMENT = 2  # words of a frame before the sizes of the run-time dimensions


@dataclass(frozen=True)
class Source:
    """A function to be compiled: its symbol, how to get it as Python `(time, base, frame)`, what it depends on.

    disjoint: base and frame, and the arrays that it makes of them, are reached in no other way while it runs, so that
    what is written to one of them changes no other.
    """

    symbol: str
    build: Callable[[], Callable[..., int]]
    fingerprint: str
    disjoint: bool = False


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


def cache_folder() -> Path:
    """Where object code is kept: $COSIM_CACHE, else the user's cache folder of this operating system."""
    if chosen := os.environ.get("COSIM_CACHE"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "cosim" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "cosim"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "cosim"


def module(name: str, sources: Iterable[Source]) -> Module:
    """The compiled sources, from the cache or compiled now.

    Raises: KernelError, naming the function that the compiler cannot take.
    """
    sources = tuple(sources)
    key = _key([s.symbol + s.fingerprint for s in sources])
    path = cache_folder() / f"{name}-{key}.o"
    if path.exists():
        return Module(name, path.read_bytes(), key, compiled_now=False)
    if sys.stderr.isatty():
        print(f"compiling {name.partition('-')[0]}, once…", file=sys.stderr)
    from cosim import compiler

    code = compiler.compile_object(name, sources)
    _write(path, code)
    return Module(name, code, key, compiled_now=True)


def _key(parts: Iterable[str]) -> str:
    machine = (*native.host(), *_compilers())
    return hashlib.sha256(json.dumps([*parts, *machine]).encode()).hexdigest()[:24]


@cache
def _compilers() -> tuple[str, ...]:
    """The versions of all that turns a function into code, our own part of it included."""
    own = b"".join(
        Path(__file__).with_name(f"{name}.py").read_bytes() for name in ("compiler", "helpers", "intrinsics")
    )
    versions = (version("numba"), version("llvmlite"), f"{sys.version_info[:2]}")
    return (*versions, hashlib.sha256(own).hexdigest())


def _write(path: Path, code: bytes) -> None:
    """Write so that another process sees the whole file or none. A read-only cache costs time, not the run."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".tmp", delete=False) as file:
            file.write(code)
        os.replace(file.name, path)
    except OSError:
        return


# ---- authors' functions ----------------------------------------------------------------------------------------


def is_scalar(variable: Variable, function: Function, argument: str) -> bool:
    """Whether an argument comes as a number: a scalar that the function only reads."""
    return variable.shape == () and argument not in function.writes


def variable_of(declaration: Declaration, argument: str) -> Variable:
    """The variable behind an argument; ``d_x`` and ``next_x`` have the shape of ``x``."""
    if argument in declaration.variables:
        return declaration.variables[argument]
    return declaration.variables[argument.partition("_")[2]]


def run_time_dimensions(declaration: Declaration, constants: dict[str, int]) -> list[str]:
    """The named dimensions that kernels of this type read from the frame, in order."""
    names = dict.fromkeys(d for v in declaration.variables.values() for d in v.shape if isinstance(d, str))
    return [name for name in names if name not in constants]


def block_module(declaration: Declaration, constants: dict[str, int]) -> Module:
    """The kernels of a block type, one symbol a function. constants: the dimensions that are part of the code."""
    name = f"{declaration.name}-" + "-".join(f"{k}{v}" for k, v in constants.items())
    sources = [_block_source(declaration, function, constants) for function in declaration.functions]
    return module(name.rstrip("-"), sources)


def _block_source(declaration: Declaration, function: Function, constants: dict[str, int]) -> Source:
    text = adapter_text(declaration, function, constants)
    digest = fingerprint(function.python)

    def build() -> Callable[..., int]:
        from cosim import intrinsics

        scope: dict[str, Any] = {**vars(intrinsics), "function": function.python}
        exec(compile(text, f"<adapter of {declaration.name}.{function.name}>", "exec"), scope)
        return scope["adapter"]

    # A block never reads what it writes in the same call: that would be an algebraic loop, which wiring refuses.
    return Source(function.name, build, digest + text, disjoint=True)


def adapter_text(declaration: Declaration, function: Function, constants: dict[str, int]) -> str:
    """Source of the kernel around one function: frame -> arrays -> the author's function, for each instance."""
    dims = run_time_dimensions(declaration, constants)
    lines = ["def adapter(time, base, frame):"]
    lines += [f"    {name}_size = frame[{FIRST_ARGUMENT + k}]" for k, name in enumerate(dims)]
    lines += ["    for k in range(frame[1]):"]
    slot = FIRST_ARGUMENT + len(dims)
    for argument in function.arguments:
        if argument == "time":
            continue
        variable = variable_of(declaration, argument)
        place = f"base, frame[{slot}] + k * frame[{slot + 1}]"
        kind = variable.dtype.name
        if is_scalar(variable, function, argument):
            lines.append(f"        {argument}_ = load_{kind}({place})")
        else:
            sizes = [str(constants.get(d, f"{d}_size")) if isinstance(d, str) else str(d) for d in variable.shape]
            lines.append(f"        {argument}_ = array(pointer_{kind}({place}), ({', '.join(sizes or ['1'])},))")
        slot += 2
    call = ", ".join("time" if a == "time" else f"{a}_" for a in function.arguments)
    lines += [f"        function({call})", "    return 0", ""]
    return "\n".join(lines)


def fingerprint(function: Any) -> str:
    """A text that changes whenever compiling the function could give other code: bytecode and all that it reaches."""
    digest = hashlib.sha256()
    _feed(digest, function, set())
    return digest.hexdigest()


def _feed(digest: Any, value: Any, seen: set[int]) -> None:
    if isinstance(value, types.FunctionType):
        if id(value) in seen:
            return
        seen.add(id(value))
        digest.update(repr(value.__defaults__).encode())
        _feed_code(digest, value.__code__, value.__globals__, seen)
        for cell in value.__closure__ or ():
            _feed(digest, cell.cell_contents, seen)
    elif isinstance(value, types.ModuleType):
        digest.update(value.__name__.encode())
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    else:
        digest.update(repr(value).encode())


def _feed_code(digest: Any, code: types.CodeType, scope: dict[str, Any], seen: set[int]) -> None:
    digest.update(code.co_code)
    digest.update(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _feed_code(digest, constant, scope, seen)
        else:
            digest.update(repr(constant).encode())
    for name in code.co_names:
        if name in scope:
            digest.update(name.encode())
            _feed(digest, scope[name], seen)


def engine_module() -> Module:
    """The compiled loop: symbols `run` and `execute` of `cosim.engine`, behind the kernel ABI."""
    from cosim import engine

    return raw_module("engine", (engine.run, engine.execute))


def raw_module(name: str, functions: Iterable[Callable[[float, int, int], int]]) -> Module:
    """Compiled functions of a time and two addresses, each behind the kernel ABI under its own name."""
    return module(name, [_raw_source(name, function) for function in functions])


def _raw_source(module: str, entry: Callable[[float, int, int], int]) -> Source:
    name = entry.__name__
    text = f"def adapter(time, base, frame):\n    return {name}(time, address_of(base), address_of(frame))\n"

    def build() -> Callable[..., int]:
        from cosim import intrinsics

        scope: dict[str, Any] = {**vars(intrinsics), name: entry}
        exec(compile(text, f"<adapter of {module}.{name}>", "exec"), scope)
        return scope["adapter"]

    return Source(name, build, fingerprint(entry) + text)
