"""What is installed, and what it offers: read from the folders that installers leave beside packages.

importlib.metadata knows the same. To import it takes a start more time than all that is asked of it here.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple


class EntryPoint(NamedTuple):
    """What a distribution offers under a name: `module` or `module:attribute`."""

    name: str
    value: str

    @property
    def module(self) -> str:
        """The module, of a package the whole road to it."""
        return re.split(r"[:\[]", self.value)[0].strip()


class Installed(NamedTuple):
    """A package, or several, that were installed together. name: in lower case, with `_` for `-` and `.`."""

    name: str
    folder: Any

    def text(self, file: str) -> str:
        """A file of its folder; "" where there is none that can be read."""
        with suppress(OSError, KeyError):
            text: str = (self.folder / file).read_text(encoding="utf-8")
            return text
        return ""

    @property
    def version(self) -> str:
        """Its version; "" where nothing tells it."""
        head = (self.text("METADATA") or self.text("PKG-INFO")).partition("\n\n")[0]
        found = re.search(r"^Version:(.*)$", head, re.MULTILINE)
        return found[1].strip() if found else ""

    def entry_points(self, group: str) -> Iterator[EntryPoint]:
        """What it offers to a group."""
        section = ""
        for line in map(str.strip, self.text("entry_points.txt").splitlines()):
            if line.startswith("["):
                section = line.strip("[]")
            elif section == group and "=" in line and not line.startswith(("#", ";")):
                name, _, value = line.partition("=")
                yield EntryPoint(name.strip(), value.strip())


def installed_in(folder: str) -> list[Installed]:
    """What is installed in a folder, or an archive, of `sys.path`."""
    with suppress(OSError):
        root: Any = Path(folder)
        if root.is_file():
            from zipfile import BadZipFile
            from zipfile import Path as Archive

            with suppress(BadZipFile):
                root = Archive(folder)
        return [
            Installed(_normalized(place.name.rpartition(".")[0].partition("-")[0]), place)
            for place in root.iterdir()
            if place.name.endswith((".dist-info", ".egg-info"))
        ]
    return []


def everywhere() -> dict[str, Installed]:
    """All that can be imported, by name: of several of one name, what stands first in `sys.path`."""
    found: dict[str, Installed] = {}
    for folder in sys.path:
        for distribution in installed_in(folder):
            found.setdefault(distribution.name, distribution)
    return found


def entry_points(group: str) -> list[EntryPoint]:
    """What all that is installed offers to a group."""
    return [point for distribution in everywhere().values() for point in distribution.entry_points(group)]


def versions(*names: str) -> dict[str, str]:
    """The version of what is installed under each of some names; "" where there is none."""
    there = everywhere()
    found = {name: there.get(_normalized(name)) for name in names}
    return {name: one.version if one else "" for name, one in found.items()}


def _normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "_", name).lower()
