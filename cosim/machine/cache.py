"""Object code on disk, in the user's cache folder: keyed by all that it depends on, written whole or not at all.

What is read will be run, so it is looked at first. An entry is a line with the digest of its name and its code, and the
code. The folder and the file must be the user's own (or the system's), and nobody else's to write. What is damaged or
foreign is not read and what cannot be written is not kept: that costs time and a word on stderr, not the run.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

from cosim.machine import distributions, notices

_FORMAT = b"cosim object code 1 "
_FLAGS = sum(getattr(os, name, 0) for name in ("O_BINARY", "O_NOFOLLOW", "O_NONBLOCK"))

#: The files of this package that say what code a function becomes, or that it may become none: `compiler` and
#: `adapters`, and what they import.
COMPILING = (
    "authoring/author_source",
    "authoring/authors",
    "authoring/dataflow/array_operations",
    "authoring/dataflow/bindings",
    "authoring/dataflow/counting",
    "authoring/dataflow/effects",
    "authoring/dataflow/expressions",
    "authoring/dataflow/extents",
    "authoring/dataflow/following",
    "authoring/dataflow/indices",
    "authoring/dataflow/left_out",
    "authoring/dataflow/paths",
    "authoring/dataflow/record",
    "authoring/dataflow/statements",
    "authoring/dataflow/symbols",
    "authoring/dataflow/turns",
    "authoring/dataflow/views",
    "authoring/dataflow/written",
    "authoring/declaration",
    "authoring/foreign",
    "authoring/lowering/array_expressions",
    "authoring/lowering/array_names",
    "authoring/lowering/array_statements",
    "authoring/lowering/array_sums",
    "authoring/lowering/axis_sizes",
    "authoring/lowering/block_functions",
    "authoring/lowering/linear_calls",
    "authoring/lowering/loop_targets",
    "authoring/lowering/lowered_functions",
    "authoring/lowering/lowered_values",
    "authoring/lowering/names",
    "authoring/lowering/new_arrays",
    "authoring/lowering/numpy_calls",
    "authoring/lowering/plain_functions",
    "authoring/lowering/returning",
    "authoring/lowering/routines",
    "authoring/lowering/slicing",
    "authoring/lowering/syntax",
    "authoring/lowering/work",
    "authoring/naming",
    "authoring/quantities",
    "authoring/rules",
    "authoring/scope",
    "authoring/shared_operations",
    "authoring/variables",
    "compiling/adapters",
    "compiling/arithmetic",
    "compiling/checks",
    "compiling/compiler",
    "compiling/diagnosis",
    "compiling/emission",
    "compiling/fingerprint/bytecode",
    "compiling/fingerprint/feed",
    "compiling/fingerprint/jitted",
    "compiling/fingerprint/objects",
    "compiling/fingerprint/own_files",
    "compiling/fingerprint/packages",
    "compiling/fingerprint/roads",
    "compiling/fingerprint/text",
    "compiling/frame",
    "compiling/helpers",
    "compiling/intrinsics",
    "compiling/known_calls",
    "compiling/linking",
    "compiling/mixed_numbers",
    "compiling/tiles/kernel_ir",
    "compiling/tiles/moving",
    "compiling/tiles/parts",
    "compiling/tiles/tiling",
    "compiling/tiles/worthwhile",
    "errors",
    "language/elementary",
    "language/expression",
    "language/expression_tree",
    "language/misreadings",
    "language/units",
    "machine/distributions",
    "machine/floating",
    "machine/installed",
    "machine/memory",
    "machine/object_code",
    "plain_math/arctangent",
    "plain_math/circular",
    "plain_math/definitions",
    "plain_math/evaluation",
    "plain_math/exponential",
    "plain_math/hyperbolic",
    "plain_math/logarithm",
    "plain_math/operations",
    "plain_math/pairs",
    "plain_math/power",
    "plain_math/traced",
    "plain_math/wide_angles",
)


def folder() -> Path:
    """Where object code is kept: $COSIM_CACHE, else the user's cache folder of this operating system.

    Raises: RuntimeError where the user has no home.
    """
    if chosen := os.environ.get("COSIM_CACHE"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "cosim" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "cosim"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "cosim"


def toolchain() -> tuple[str, ...]:
    """All that turns a function into code: versions, our own part of it, and numba's settings."""
    settings = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith("NUMBA_")]
    with suppress(OSError):
        settings.append(Path(".numba_config.yaml").read_text(errors="replace"))
    return (*_versions(), *settings)


@cache
def _versions() -> tuple[str, ...]:
    own = b"".join((Path(__file__).parents[1] / f"{name}.py").read_bytes() for name in COMPILING)
    compilers = distributions.versions("numba", "llvmlite", "numpy")
    return (*compilers.values(), sys.version, hashlib.sha256(own).hexdigest())


def read(name: str) -> bytes | None:
    """The code of an entry; None where there is none that may be used."""
    place = _place()
    if place is None:
        return None
    path = place / f"{name}.o"
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb") as file:
            status = os.fstat(file.fileno())
            found = "" if stat.S_ISREG(status.st_mode) else "is no file"
            content = b"" if found else file.read()
    except FileNotFoundError:
        return None
    except OSError as error:
        _say(f"{path} cannot be read ({error.strerror}); compiled anew")
        return None
    line, _, code = content.partition(b"\n")
    found = found or _distrust(status) or ("" if line == _heading(name, code) else "was damaged")
    if found:
        _say(f"{path} {found}; compiled anew")
    return None if found else code


def write(name: str, code: bytes) -> None:
    """Keep code under a name, so that another process sees the whole entry or none."""
    place = _place(create=True)
    if place is None:
        return
    made = ""
    try:
        descriptor, made = tempfile.mkstemp(dir=place, prefix=name, suffix=".tmp")
        with os.fdopen(descriptor, "wb") as file:
            file.write(_heading(name, code) + b"\n" + code)
        Path(made).replace(place / f"{name}.o")
    except OSError as error:
        _say(f"the cache {place} cannot be written ({error.strerror}); kernels are compiled anew at every run")
    finally:
        with suppress(OSError):  # it is there no more if all went well
            Path(made).unlink()


def is_usable() -> bool:
    """Whether there is a folder for what is kept, made now if need be."""
    return _place(create=True) is not None


def _heading(name: str, code: bytes) -> bytes:
    return _FORMAT + hashlib.sha256(name.encode() + b"\0" + code).hexdigest().encode()


def _place(create: bool = False) -> Path | None:
    """The cache folder; None where it may not be used, or (without `create`) where there is none yet."""
    place = None
    try:
        place = folder()
        if create and not place.exists():
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = place.stat()
        found = _distrust(status) if stat.S_ISDIR(status.st_mode) else "is no folder"
    except FileNotFoundError as error:
        if not create:
            return None
        found = str(error.strerror)
    except (OSError, RuntimeError) as error:
        found = getattr(error, "strerror", None) or "there is no home: set COSIM_CACHE"
    if found:
        _say(f"the cache {place or 'folder'} is not used ({found}); kernels are compiled anew at every run")
    return None if found else place


def _distrust(status: os.stat_result) -> str:
    """Why code that lies in a file or folder may not be run; "" if it may."""
    if not hasattr(os, "geteuid"):
        return ""
    if status.st_uid not in (0, os.geteuid()):
        return "belongs to another user"
    return "can be written by others: chmod go-w" if status.st_mode & 0o022 else ""


@cache
def _say(text: str) -> None:
    """A word to the user, once."""
    notices.warn(text)
