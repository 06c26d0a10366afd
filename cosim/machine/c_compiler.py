"""The C compiler that is at hand: the machine's own, or that of the package `ziglang`, which serves all platforms."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence


def native() -> list[str]:
    """The command of the machine's own compiler; empty where it has none."""
    return next(([path] for path in map(shutil.which, ("gcc", "cc", "clang")) if path), [])


def zig(target: str = "") -> list[str]:
    """The command of ziglang's, for a platform by zig's name, or for this machine; empty where it is not installed."""
    if importlib.util.find_spec("ziglang") is None:
        return []
    return [sys.executable, "-m", "ziglang", "cc", *(["-target", target] if target else [])]


def complaints(words: Sequence[str]) -> list[str]:
    """The lines that say why a compiler or linker failed; none if it did not."""
    environment = os.environ | {"LC_ALL": "C"}
    done = subprocess.run(words, capture_output=True, text=True, errors="replace", env=environment, check=False)  # noqa: S603  # ours
    if not done.returncode:
        return []
    lines = done.stderr.splitlines()
    telling = [line.strip() for line in lines if any(word in line for word in ("error", "undefined", "cannot find"))]
    return telling or [line.strip() for line in lines[-3:]] or [f"exit code {done.returncode}"]
