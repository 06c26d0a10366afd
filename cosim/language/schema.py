"""The keys of a diagram, or of whatever else is declared so, as a JSON Schema: editors complete and check by it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from cosim.language.keys import ADDS, ANY, BLOCK, Key, Type

DIALECT = "http://json-schema.org/draft-07/schema#"
_OF_BLOCK_TYPES = "block_types"


def json_schema(keys: Mapping[str, Key], title: str, block_types: Mapping[str, Any]) -> dict[str, Any]:
    """The schema of a file whose keys are declared; every value may be `~`, by which an overlay takes one away.

    block_types: what else a block keeps, by its type, as a schema.
    """
    return {"$schema": DIALECT, "title": title, "definitions": {_OF_BLOCK_TYPES: block_types}, **_section(keys)}


def _section(keys: Mapping[str, Key]) -> dict[str, Any]:
    named = {name: _key(key) for name, key in keys.items() if name != ANY}
    other: Any = _key(keys[ANY]) if ANY in keys else False
    additions = {f"{'.' if ANY in keys else '^(' + '|'.join(named) + ')'}\\{ADDS}$": {"type": "array"}}
    found = {
        "type": ["object", "null"],
        "properties": named,
        "patternProperties": additions,
        "additionalProperties": other,
    }
    return {**found, "allOf": [{"$ref": f"#/definitions/{_OF_BLOCK_TYPES}"}]} if keys is BLOCK else found


def _key(key: Key) -> dict[str, Any]:
    """A key's help, and what may stand behind it as far as a schema can tell."""
    described = key.help + (f" ({key.unit})" if key.unit else "") if key.help else ""
    found: dict[str, Any] = {"description": described} if described else {}
    if is_plain(key.default):
        found["default"] = key.default
    if key.type is None:
        return {**found, **_section(key.below)} if key.below else found
    value = _value(key.type)
    if key.below:  # a value, or a mapping that says more
        return {**found, "anyOf": [{"not": {"type": "object"}}, _section(key.below)]}
    return {**found, "anyOf": [value, {"type": "null"}]} if value else found


def is_plain(value: Any) -> bool:
    """Whether a default is one that JSON has, and says something."""
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, bool | int | str) and value != ""


def _value(type_: Type) -> dict[str, Any]:
    words = list(type_.known)
    return {"enum": words} if words else dict(type_.form)


def text(schema: Mapping[str, Any]) -> str:
    """The schema as a file has it."""
    return json.dumps(schema, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
