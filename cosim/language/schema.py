"""The keys of a diagram, or of whatever else is declared so, as a JSON Schema: editors complete and check by it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from cosim.language.keys import (
    ADDS,
    ANY,
    NOT_NEGATIVE,
    NUMBER,
    ORDER,
    POSITIVE,
    SIGNAL,
    SIZE,
    TEXT,
    TOLERANCE,
    TRUTH,
    Key,
    Type,
)

DIALECT = "http://json-schema.org/draft-07/schema#"
_NUMBER = {"type": ["number", "string"]}  # which may be arithmetic, such as "2*pi"
_FRAGMENTS: list[tuple[Type, dict[str, Any]]] = [
    (TEXT, {"type": ["string", "number", "boolean"]}),
    (TRUTH, {"type": "boolean"}),
    (SIGNAL, {"type": "string", "pattern": r"\."}),
    (ORDER, {"type": "array", "items": {"type": "string"}}),
    *((number, _NUMBER) for number in (NUMBER, POSITIVE, NOT_NEGATIVE, TOLERANCE, SIZE)),
]


def json_schema(keys: Mapping[str, Key], title: str) -> dict[str, Any]:
    """The schema of a file whose keys are declared; every value may be `~`, by which an overlay takes one away."""
    return {"$schema": DIALECT, "title": title, **_section(keys)}


def _section(keys: Mapping[str, Key]) -> dict[str, Any]:
    named = {name: _key(key) for name, key in keys.items() if name != ANY}
    other: Any = _key(keys[ANY]) if ANY in keys else False
    additions = {f"{'.' if ANY in keys else '^(' + '|'.join(named) + ')'}\\{ADDS}$": {"type": "array"}}
    return {
        "type": ["object", "null"],
        "properties": named,
        "patternProperties": additions,
        "additionalProperties": other,
    }


def _key(key: Key) -> dict[str, Any]:
    """A key's help, and what may stand behind it as far as a schema can tell."""
    described = key.help + (f" ({key.unit})" if key.unit else "") if key.help else ""
    found: dict[str, Any] = {"description": described} if described else {}
    if _is_plain(key.default):
        found["default"] = key.default
    if key.type is None:
        return {**found, **_section(key.below)} if key.below else found
    value = _value(key.type)
    if key.below:  # a value, or a mapping that says more
        return {**found, "anyOf": [{"not": {"type": "object"}}, _section(key.below)]}
    return {**found, "anyOf": [value, {"type": "null"}]} if value else found


def _is_plain(value: Any) -> bool:
    return value is not None and (not isinstance(value, float) or math.isfinite(value)) and value not in ("", ())


def _value(type_: Type) -> dict[str, Any]:
    words = list(type_.known)
    return {"enum": words} if words else next((made for known, made in _FRAGMENTS if known is type_), {})


def text(keys: Mapping[str, Key], title: str) -> str:
    """The schema as a file has it."""
    return json.dumps(json_schema(keys, title), indent=1, ensure_ascii=False) + "\n"
