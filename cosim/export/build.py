"""Object code and shared libraries of an exported model, for any of the platforms that FMI names.

Kernels and the loop come from `cosim.compiling.compiler`; the wrapper and the model's constants are C, compiled and
linked by the machine's C compiler, or by `ziglang`, which also serves all other platforms.
"""

from __future__ import annotations

import hashlib
import platform as machine
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from cosim.compiling.adapters import KernelSource, block_source, raw_source
from cosim.compiling.fingerprint.text import obstacle
from cosim.engine import loop
from cosim.errors import BuildFailed, CompilerMissing, NotExportable, nearest
from cosim.export import c_source
from cosim.export.model import Model
from cosim.export.model_description import ModelDescription
from cosim.fmu.c_sources import headers
from cosim.fmu.fmi import Version
from cosim.machine import c_compiler, cache
from cosim.wiring.network import Component

WRAPPER = Path(__file__).parent / "wrapper"
_FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-Wall", "-Wextra", "-Wno-unused-parameter"]


@dataclass(frozen=True)
class Platform:
    """A platform, with the names that LLVM and zig have for it; cpu: the least that it has."""

    name: str
    system: Literal["linux", "windows", "darwin"]
    triple: str
    zig: str
    cpu: str
    suffix: str

    def folder(self, version: Version) -> str:
        """Where the library lies in the archive, below `binaries`."""
        return version.folder(self.system, self.name.partition("-")[2])


_X86, _ARM, _APPLE = "x86_64", "aarch64", "apple-macosx11.0.0"
_GNU = "linux-gnu"
PLATFORMS = {
    p.name: p
    for p in (
        Platform("linux-x86_64", "linux", f"{_X86}-unknown-{_GNU}", f"{_X86}-{_GNU}.2.17", "x86-64", ".so"),
        Platform("linux-aarch64", "linux", f"{_ARM}-unknown-{_GNU}", f"{_ARM}-{_GNU}.2.17", "generic", ".so"),
        Platform("windows-x86_64", "windows", f"{_X86}-w64-windows-gnu", f"{_X86}-windows-gnu", "x86-64", ".dll"),
        Platform("darwin-x86_64", "darwin", f"{_X86}-{_APPLE}", f"{_X86}-macos.11.0", "x86-64", ".dylib"),
        Platform("darwin-aarch64", "darwin", f"arm64-{_APPLE}", f"{_ARM}-macos.11.0", "apple-m1", ".dylib"),
    )
}


def host() -> Platform:
    """The platform of this machine. Raises: CompilerMissing where it is none of those that FMUs are built for."""
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine.machine().lower(), machine.machine().lower())
    name = f"{machine.system().lower()}-{architecture}"
    if name not in PLATFORMS:
        raise CompilerMissing(f"no FMU can be built for this machine ({name})", fix=f"choose {', '.join(PLATFORMS)}")
    return PLATFORMS[name]


def find(names: Sequence[str] | None) -> list[Platform]:
    """The platforms of these names; this machine's, if none are given. Raises: NotExportable, CompilerMissing."""
    for name in names or ():
        if name not in PLATFORMS:
            raise NotExportable(f"there is no platform `{name}`", fix=nearest(name, PLATFORMS))
    return [PLATFORMS[name] for name in dict.fromkeys(names)] if names else [host()]


# ---- object code ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CodeUnit:
    """One block type's kernels, or the loop, as it goes into one object file."""

    name: str
    sources: tuple[KernelSource, ...]


def code_units(model: Model) -> tuple[list[CodeUnit], list[str]]:
    """The loop and the block types of a model, and the symbol of each call's function."""
    functions = tuple(replace(raw_source("engine", f), symbol=f"engine_{f.__name__}") for f in (loop.run, loop.execute))
    found: dict[tuple[object, ...], CodeUnit] = {}
    owner: dict[str, str] = {}
    for name, component in model.network.components.items():
        key = (id(component.declaration), *component.constants().items())
        if key not in found:
            found[key] = _unit(component, f"block{len(found)}")
        owner[name] = found[key].name
    symbols = [f"{owner[call.component]}_{call.function.name}" for call in model.program.calls]
    return [CodeUnit("engine", functions), *found.values()], symbols


def _unit(component: Component, name: str) -> CodeUnit:
    sources = [block_source(component.declaration, f, component.constants()) for f in component.declaration.functions]
    return CodeUnit(name, tuple(replace(s, symbol=f"{name}_{s.symbol}") for s in sources))


class Objects:
    """Object code of units, from the cache or compiled now; the IR of a unit is made once for all platforms."""

    def __init__(self) -> None:
        self._ir: dict[str, str] = {}

    def of(self, unit: CodeUnit, platform: Platform) -> bytes:
        """The object code of a unit. Raises: KernelError."""
        entry = f"fmu-{platform.name}-{self._key(unit, platform)}"
        code = cache.read(entry)
        if code is not None:
            return code
        from cosim.compiling import compiler

        if unit.name not in self._ir:
            ir = compiler.compile_ir(unit.name, unit.sources)
            for symbol in (s.symbol for s in unit.sources):
                ir = ir.replace(f"define i32 @{symbol}(", f"define hidden i32 @{symbol}(")
            self._ir[unit.name] = ir
        symbols = [s.symbol for s in unit.sources]
        code = compiler.emit(self._ir[unit.name], platform.triple, platform.cpu, "", symbols, unit.name)
        if not any(obstacle(source.fingerprint) for source in unit.sources):
            cache.write(entry, code)
        return code

    def _key(self, unit: CodeUnit, platform: Platform) -> str:
        parts = [Path(__file__).read_text(), *cache.toolchain(), platform.triple, platform.cpu]
        parts += [source.symbol + source.fingerprint for source in unit.sources]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


# ---- linking ----------------------------------------------------------------------------------------------------


def library(description: ModelDescription, token: str, platform: Platform, objects: Objects, folder: Path) -> Path:
    """The shared library of a model in a work folder. Raises: KernelError, CompilerMissing, BuildFailed."""
    folder.mkdir(parents=True)
    parts, symbols = code_units(description.model)
    (folder / "layout.h").write_text(c_source.layout())
    (folder / "model.c").write_text(c_source.model(description, token, symbols))
    wrapper = ("instance.c", "evaluation.c", "snapshot.c", f"{description.version.prefix}.c")
    files = [str(folder / "model.c"), *(str(WRAPPER / name) for name in wrapper)]
    for unit in parts:
        path = folder / f"{unit.name}.o"
        path.write_bytes(objects.of(unit, platform))
        files.append(str(path))
    path = folder / f"{description.model.identifier}{platform.suffix}"
    command = [
        *compiler(platform),
        *_FLAGS,
        *_link_flags(platform, path),
        f"-I{folder}",
        f"-I{WRAPPER}",
        f"-I{headers()}",
    ]
    _run([*command, "-o", str(path), *files, *(["-lm"] if platform.system == "linux" else [])], platform)
    return path


def compiler(platform: Platform) -> list[str]:
    """The command of a C compiler for a platform. Raises: CompilerMissing."""
    own = c_compiler.native() if platform.name == _host_name() else []
    if found := own or c_compiler.zig(platform.zig):
        return found
    message = f"there is no C compiler for {platform.name}"
    fix = "`pip install ziglang`, which builds for all platforms"
    if platform.name == _host_name():
        fix = f"install gcc, or {fix}"
    raise CompilerMissing(message, fix=fix)


def _host_name() -> str:
    try:
        return host().name
    except CompilerMissing:
        return ""


def _link_flags(platform: Platform, path: Path) -> list[str]:
    """Nothing undefined, nothing of others bound, nothing exported but FMI's functions."""
    if platform.system == "linux":
        return ["-shared", "-fPIC", "-s", "-Wl,-Bsymbolic", "-Wl,-z,defs"]
    if platform.system == "windows":
        return ["-shared", "-s"]
    # A library's name for itself is by default the path at which it is written, on the machine of who exports it.
    return ["-shared", "-fPIC", f"-Wl,-install_name,@rpath/{path.name}"]


def _run(command: list[str], platform: Platform) -> None:
    if lines := c_compiler.complaints(command):
        raise BuildFailed(f"{Path(command[0]).name} cannot build the FMU for {platform.name}: {lines[0]}")
