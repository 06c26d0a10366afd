"""What a result says of its run beside the samples: attributes of the file, some of them known at the end only."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.results.metrics import for_json, from_json

JSON = (
    "settings",
    "versions",
    "seconds",
    "inner_steps",
    "metrics",
    "reductions",
    "conditions",
    "accuracy",
    "requirements",
)
#: What is known at the end only, with bytes set aside for it: what fits is written in place, so that at no instant is
#: there a file whose header points to what is not yet on disk.
LAST = {
    **{"message": 512, "metrics": 2048, "seconds": 128},
    **{"inner_steps": 512, "conditions": 2048, "accuracy": 2048, "requirements": 2048, "status": 16},
}
NUMBERS: dict[str, int | float] = {"steps": 0, "end": 0.0}
"""What is known at the end only and is a number, with what stands there before."""


def write(file: Any, attributes: Mapping[str, Any]) -> None:
    """What is known when a run begins, and room for what is known at its end."""
    for key, value in attributes.items():
        file.attrs[key] = json.dumps(for_json(value)) if key in JSON else value
    for key, number in NUMBERS.items():
        file.attrs[key] = number
    for key, size in LAST.items():
        file.attrs[key] = np.array("running" if key == "status" else "", f"S{size}")


def write_last(file: Any, values: Mapping[str, Any]) -> None:
    """What is known at the end of a run: a value for each key of NUMBERS and LAST, in place if it fits."""
    for key, number in NUMBERS.items():
        file.attrs.get_id(key).write(np.array(values[key], type(number)))
    for key in LAST:
        if key == "status":
            file.flush()  # whoever finds a status finds the rest
        write_text(file, key, values[key])


def write_text(file: Any, key: str, value: Any) -> None:
    """A value other than a number, for a key of LAST, in place if it fits."""
    text, size = _text(key, value), LAST[key]
    if len(text) <= size:
        file.attrs.get_id(key).write(np.array(text, f"S{size}"))
    else:
        file.attrs[key] = text.decode()


def size_of(values: Mapping[str, Any]) -> int:
    """The bytes of those values that do not fit where they were to be."""
    sizes = [(len(_text(key, values[key])), size) for key, size in LAST.items() if key in values]
    return sum(long for long, size in sizes if long > size)


def _text(key: str, value: Any) -> bytes:
    return (json.dumps(for_json(value)) if key in JSON else str(value)).encode(errors="backslashreplace")


def read(file: Any) -> dict[str, Any]:
    """All that a file says; of a run that is still going on, nothing that is known at the end only.

    Raises: ValueError where it is damaged.
    """
    kept = {key: _plain(value) for key, value in file.attrs.items()}
    if kept.get("status") == "running":
        kept = {key: value for key, value in kept.items() if key == "status" or key not in {*LAST, *NUMBERS}}
    return {key: _read(key, value) for key, value in kept.items()}


def _plain(value: Any) -> Any:
    """An attribute as h5py has it, text always as text."""
    return value.decode() if isinstance(value, bytes) else value


def _read(key: str, value: Any) -> Any:
    if key not in JSON:
        return for_json(value)
    found = json.loads(value)
    if key in ("metrics", "reductions") and not isinstance(found, dict):
        raise ValueError(f"its {key} are damaged")
    if key == "requirements":
        return [{**judged, "margin": from_json(judged["margin"])} for judged in found]
    return from_json(found) if key == "metrics" else found
