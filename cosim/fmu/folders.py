"""The names that platforms have as folders below `binaries`: `x86_64-linux` in FMI 3, `linux64` in FMI 2.

Archives of either version have been seen with either name.
"""

from __future__ import annotations

_BITS = {"x86_64": "64", "x86": "32"}


def long(system: str, architecture: str) -> str:
    """FMI 3's name."""
    return f"{architecture}-{system}"


def short(system: str, architecture: str) -> str | None:
    """FMI 2's name; None for ARM, which has none."""
    bits = _BITS.get(architecture)
    return {"windows": "win"}.get(system, system) + bits if bits else None


def both(system: str, architecture: str) -> list[str]:
    """FMI 3's name, and FMI 2's where it may be meant: that of Macs is for both of their architectures."""
    mac = (system, architecture) == ("darwin", "aarch64")
    other = short(system, "x86_64" if mac else architecture)
    return [long(system, architecture), *([other] if other else [])]
