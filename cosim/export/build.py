"""Object code and shared libraries of an exported model, for any of the platforms that FMI names.

Kernels and the loop come from `cosim.compiling.compiler`; the wrapper and the model's constants are C, compiled and
linked by the machine's C compiler, or by `ziglang`, which also serves all other platforms.
"""

from __future__ import annotations

import hashlib
import platform as machine
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from cosim.compiling.adapters import KernelSource, block_source, raw_source
from cosim.compiling.fingerprint.text import obstacle
from cosim.errors import BuildFailed, CompilerMissing, NotExportable, nearest
from cosim.export import sources
from cosim.export.c_code.c_translation import translate
from cosim.export.c_code.llvm_reader import Untranslatable
from cosim.export.model import Model
from cosim.export.model_description import ModelDescription
from cosim.fmu.c_sources import headers
from cosim.fmu.fmi import Version
from cosim.machine import c_compiler, cache
from cosim.master import loop
from cosim.wiring.network import Component

_HERE = Path(__file__).parent
# Kernels and the loop are optimised already; of what is around them -O2 makes a few per cent, in twice the time.
_FLAGS = ["-std=c11", "-O1", "-ffp-contract=off", "-fvisibility=hidden", "-Wall", "-Wextra", "-Wno-unused-parameter"]


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
    functions = tuple(
        replace(raw_source("engine", f), symbol=f"engine_{f.__name__}") for f in (loop.run, loop.execute, loop.begin)
    )
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


class KernelCode:
    """The code of units, from the cache or compiled now; the IR of a unit is made once for all that comes of it."""

    def __init__(self, model: Model) -> None:
        self.units, self.symbols = code_units(model)
        self._ir: dict[str, str] = {}

    def objects(self, platform: Platform) -> dict[str, bytes]:
        """Object code, by unit. Raises: KernelError."""
        return {unit.name: self._object(unit, platform) for unit in self.units}

    def texts(self) -> dict[str, str]:
        """C, by unit. Raises: KernelError, NotExportable where there is no C for a kernel."""
        return {unit.name: self._text(unit) for unit in self.units}

    def _object(self, unit: CodeUnit, platform: Platform) -> bytes:
        def made() -> bytes:
            from cosim.compiling import emission

            ir, symbols = self._ir_of(unit), [s.symbol for s in unit.sources]
            for symbol in symbols:
                ir = ir.replace(f"define i32 @{symbol}(", f"define hidden i32 @{symbol}(")
            return emission.emit(ir, platform.triple, platform.cpu, "", symbols, unit.name)

        return _cached(unit, f"fmu-{platform.name}", [platform.triple, platform.cpu], made)

    def _text(self, unit: CodeUnit) -> str:
        def made() -> bytes:
            from cosim.compiling import emission

            symbols = [s.symbol for s in unit.sources]
            platform = PLATFORMS["linux-x86_64"]  # of its properties, byte order and the size of addresses come in
            try:
                ir = emission.plain_ir(self._ir_of(unit), platform.triple, platform.cpu, symbols, unit.name)
                return translate(ir, unit.name, symbols).encode()
            except Untranslatable as error:
                message = f"there is no C for {unit.sources[0].who or unit.name}: {error}"
                raise NotExportable(message, fix="leave out --sources") from None

        translator = [path.read_text(encoding="utf-8") for path in sorted((_HERE / "c_code").glob("*.py"))]
        return _cached(unit, "fmu-c", translator, made).decode()

    def _ir_of(self, unit: CodeUnit) -> str:
        if unit.name not in self._ir:
            from cosim.compiling import compiler

            self._ir[unit.name] = compiler.compile_ir(unit.name, unit.sources)
        return self._ir[unit.name]


def _cached(unit: CodeUnit, kind: str, facts: Sequence[str], made: Callable[[], bytes]) -> bytes:
    """What is made of a unit and some facts, once."""
    parts = [Path(__file__).read_text(encoding="utf-8"), *cache.toolchain(), *facts]
    parts += [source.symbol + source.fingerprint for source in unit.sources]
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()
    entry = f"{kind}-{digest[:24]}"
    code = cache.read(entry)
    if code is None:
        code = made()
        if not any(obstacle(source.fingerprint) for source in unit.sources):
            cache.write(entry, code)
    return code


# ---- linking ----------------------------------------------------------------------------------------------------


def library(description: ModelDescription, token: str, platform: Platform, kernels: KernelCode, folder: Path) -> Path:
    """The shared library of a model in a work folder. Raises: KernelError, CompilerMissing, BuildFailed."""
    for name, text in sources.files(description, token, kernels.symbols, {}).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    files = [str(folder / sources.main_file(description))]
    for unit, code in kernels.objects(platform).items():
        path = folder / f"{unit}.o"
        path.write_bytes(code)
        files.append(str(path))
    path = folder / f"{description.model.identifier}{platform.suffix}"
    command = [*compiler(platform), *_FLAGS, *_link_flags(platform, path), f"-I{headers()}"]
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
