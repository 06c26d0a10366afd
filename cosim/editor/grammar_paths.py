"""What may stand at a path of keys: of which key it is, and whether it names signals."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.language.keys import ANY, DIAGRAM, FORMULA, SIGNAL, SOURCES, Key
from cosim.study.study_keys import STUDY

_SIGNALS = (("record", "signals"), ("requirements", ANY, "formula"), ("outputs", ANY))


def grammar(is_study: bool) -> Mapping[str, Key]:
    """The keys of a kind of file."""
    return STUDY if is_study else DIAGRAM


def declared(path: tuple[str, ...], is_study: bool) -> Key | None:
    """The key at a path, that of the whole file for none; None where the grammar has none."""
    found = Key("", below=grammar(is_study))
    for name in path:
        below = found.below.get(name) or found.below.get(ANY)
        if below is None:
            return None
        found = below
    return found


def in_diagram(path: tuple[str, ...], is_study: bool) -> tuple[str, ...]:
    """A path as a diagram has it; what stands below a study's variant lies over a diagram."""
    return path[2:] if is_study and path[:1] == ("variants",) else path


def names_signals(path: tuple[str, ...], is_study: bool) -> bool:
    """Whether `block.port` is read from what stands at a path."""
    key = declared(path, is_study)
    if key and key.type in (SIGNAL, SOURCES, FORMULA):
        return True
    place = in_diagram(path, is_study)
    return any(
        len(place) == len(known) and all(k in (ANY, p) for k, p in zip(known, place, strict=True)) for known in _SIGNALS
    )
