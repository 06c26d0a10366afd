"""What differs between the diagrams of several results: key by key, each written as `--set` takes it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from cosim.errors import CosimError, Position
from cosim.language import source
from cosim.language.keys import TYPES

ABSENT = "—"
"""What stands for a key that a diagram does not have."""
LONGEST = 32
"""Characters of a value: of longer ones, the beginning is shown."""
LAST = ("metrics", "record", "inputs", "outputs", "title")
"""What changes no signal: it comes behind what does."""


class FromDiagram(Protocol):
    """What says which diagram it comes from: a `cosim.results.result_file.Result`, for one."""

    path: Path
    attrs: dict[str, Any]


@dataclass(frozen=True)
class Difference:
    """One key, and what each diagram says there, None where it does not have it."""

    key: str
    values: tuple[Any, ...]

    @property
    def changes_run(self) -> bool:
        """Whether the runs themselves may differ by it, not just what is kept of them."""
        return self.key.partition(".")[0] not in LAST

    @property
    def texts(self) -> tuple[str, ...]:
        """The values as text, shortened, but never so far that two that differ look the same."""
        whole = [ABSENT if value is None else written(value) for value in self.values]
        if all(_is_texts(value) for value in self.values if value is not None):
            whole = [
                text if value is None else _own(value, self.values)
                for text, value in zip(whole, self.values, strict=True)
            ]
        short = tuple(_shortened(text) for text in whole)
        return short if len(set(short)) == len(set(whole)) else tuple(whole)


def read(result: FromDiagram) -> dict[str, Any] | None:
    """The diagram that a result comes from, as plain values; None where it has none that can be read."""
    text = result.attrs.get("diagram")
    if not isinstance(text, str) or not text.strip():
        return None
    try:
        tree = plain(text, str(result.path))
    except (CosimError, RecursionError):  # of another version, or by another program
        return None
    return tree if isinstance(tree, dict) else None


def plain(text: str, place: str = "") -> Any:
    """A resolved diagram's text as plain values. Raises: CosimError, RecursionError."""
    return source.parse_value(text, Position(place)).plain()


def differences(diagrams: Sequence[Mapping[str, Any]]) -> list[Difference]:
    """Every key at which the diagrams do not all say the same: first those that change the run, in their order.

    What one of them does not have at all, such as a block, is one difference.
    """
    return sorted(_differences("", diagrams), key=lambda found: not found.changes_run)


def _differences(path: str, values: Sequence[Any]) -> Iterator[Difference]:
    if all(_same(values[0], value) for value in values[1:]):
        return
    below = _below(values)
    if not below:
        yield Difference(path, tuple(values))
        return
    for key in below:
        yield from _differences(f"{path}.{key}" if path else key, [_at(value, key) for value in values])


def _below(values: Sequence[Any]) -> list[str]:
    """The keys, or indices from 0, by which all values go on; none where one of them does not."""
    if all(isinstance(value, Mapping) for value in values):
        return list(dict.fromkeys(str(key) for value in values for key in value))
    lists = all(isinstance(value, list) for value in values) and not all(map(_is_texts, values))
    sizes = {len(value) for value in values} if lists else set()
    return [str(k) for k in range(sizes.pop())] if len(sizes) == 1 else []


def _at(value: Any, key: str) -> Any:
    return value.get(key) if isinstance(value, Mapping) else value[int(key)]


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, str) for item in value)


def _same(a: Any, b: Any) -> bool:
    """Whether two values say the same; `true` and 1 do not, 1 and 1.0 do."""
    if isinstance(a, bool) or isinstance(b, bool):
        return a is b
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_same, a, b))
    return bool(a == b) or (a != a and b != b)  # noqa: PLR0124  # NaN


def written(value: Any) -> str:
    """A value on one line, as YAML writes it; of a block, its type."""
    if isinstance(value, Mapping):
        kind = next((value[key] for key in TYPES if key in value), None)
        return written(kind) if kind else "{" + ", ".join(f"{key}: {written(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return " ".join(str(value).split()) or '""'


def _own(value: list[str], values: Sequence[Any]) -> str:
    """Of a list of names, those that not all have."""
    lists = [set(other) for other in values if other is not None]
    own = [item for item in value if not all(item in other for other in lists)]
    return f"… {', '.join(own)}" if own and len(own) < len(value) else "…" if not own else written(value)


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
