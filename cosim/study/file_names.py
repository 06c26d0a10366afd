"""Names that people give, as names of files: on every system, in the folder that they are meant for, each its own."""

from __future__ import annotations

import unicodedata

LONGEST = 100
"""Bytes of a variant's name; the numbers of grid and draw, and the file's ending, come behind it."""
_FORBIDDEN = set('/\\:*?"<>|')
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(10))}


def flaw(name: str) -> str:
    """Why a name cannot be a file's name as it stands, in words; "" if it can."""
    if not name.strip():
        return "it is empty"
    if not name.isprintable():
        return "it contains characters that are not printable"
    if found := sorted(_FORBIDDEN & set(name)):
        return f"it contains `{found[0]}`"
    if name[0] in ". -" or name[-1] in ". ":
        return "it begins with a dot, a dash or a space, or ends with a dot or a space"
    if name.split(".", maxsplit=1)[0].strip().lower() in _DEVICES:
        return "it is the name of a device on Windows"
    if name.lower().endswith(".previous"):
        return "its ending marks the file of the run before"
    if len(name.encode()) > LONGEST:
        return f"it is longer than {LONGEST} bytes"
    return ""


def folded(name: str) -> str:
    """What two names have in common that some file system takes for the same."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def stem(title: str) -> str:
    """The name of a file for something with a title, without its ending: lower case, letters and digits."""
    text = "".join(c if c.isalnum() else "_" for c in folded(title)) or "_"
    return text.encode()[:LONGEST].decode(errors="ignore") + ("_" if text in _DEVICES else "")
