"""What has changed from one run to another, in words: of their identities, as of `cosim.engine.identity`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from cosim.errors import CosimError, Position
from cosim.language import source

MOST_NAMED = 5
_LONGEST = 40  # characters of a value that is shown


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What has changed from one identity to another, as far as it is known; nothing where they are one."""
    if (before["key"], before["software"]) == (now["key"], now["software"]):
        return []
    try:
        told = list(_changed(_flat(before["diagram"]), _flat(now["diagram"])))
    except CosimError:  # names that YAML has no words for
        told = []
    replaced = {text.removeprefix("`blocks.").partition(".")[0] for text in told}
    for name, digest in now["code"].items():
        if before["code"].get(name) != digest and name not in replaced:
            told.append(f"the code of block {name} is another")
    told += _changed(before["software"], now["software"])
    more = [f"and {len(told) - MOST_NAMED} more"] if len(told) > MOST_NAMED else []
    return [*told[:MOST_NAMED], *more] or ["something that its figures depend on is another"]


def _changed(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for name in dict.fromkeys((*before, *now)):
        if name not in now:
            yield f"{name} is gone"
        elif name not in before:
            yield f"{name} is new"
        elif before[name] != now[name]:
            short = max(len(str(before[name])), len(str(now[name]))) <= _LONGEST
            yield f"{name} was {before[name]} and is {now[name]}" if short else f"{name} is another"


def _flat(text: str) -> dict[str, Any]:
    """The values of a diagram by their dotted paths; no words that change nothing."""

    def values(tree: Any, path: str) -> Iterator[tuple[str, Any]]:
        if isinstance(tree, Mapping):
            for name, below in tree.items():
                yield from values(below, f"{path}.{name}" if path else name)
        elif path not in ("title", "run.patience"):
            yield f"`{path}`", tree

    return dict(values(source.parse_value(text, Position("")).plain(), ""))
