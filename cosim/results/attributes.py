"""What a result says of its run beside the samples: attributes of the file, some of them known at the end only."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.results import global_heap, object_header
from cosim.results.growing_file import ROOT_HEADER, GrowingFile
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
STATUS_BYTES = 16
NUMBERS = {"steps": "<q", "end": "<d"}
"""What is known at the end only and is a number, with its type."""
LAST = ("message", "metrics", "seconds", "inner_steps", "conditions", "accuracy", "requirements")
"""What is known at the end only and is a text."""


def create(file: Any, attributes: Mapping[str, Any]) -> None:
    """What is known when a run begins, but for texts, and the places of all else.

    Those of what is known at the end come first, so that they lie in the file's first page, see `growing_file`; the
    status before them, as a result that is brought back to an earlier state is written from its front.
    """
    file.attrs["status"] = np.array("running", f"S{STATUS_BYTES}")
    for key, kind in NUMBERS.items():
        file.attrs[key] = np.zeros((), kind)
    for key, value in {**dict.fromkeys(LAST, ""), **attributes}.items():
        file.attrs[key] = "" if _is_text(key, value) else value


def write_first(file: GrowingFile, attributes: Mapping[str, Any]) -> None:
    """The texts that are known when a run begins. Raises: ValueError."""
    _write_texts(file, {key: value for key, value in attributes.items() if _is_text(key, value)})


def write_last(file: GrowingFile, values: Mapping[str, Any]) -> None:
    """What is known at the end of a run: its status, and a value for each key of NUMBERS and LAST.

    Space for it is set aside. Raises: OSError, ValueError where the file is damaged.
    """
    places = _write_texts(file, {key: values[key] for key in LAST})
    for key, kind in NUMBERS.items():
        file.write(places[key], struct.pack(kind, values[key]))
    file.write(places["status"], values["status"].encode().ljust(STATUS_BYTES, b"\0"))  # who finds it finds the rest


def write_accuracy(file: GrowingFile, accuracy: Mapping[str, Any]) -> None:
    """How sure the metrics of a run are. Space is set aside. Raises: OSError, ValueError where the file is damaged."""
    _write_texts(file, {"accuracy": accuracy})


def status_of(file: GrowingFile) -> tuple[int, int]:
    """Where the status begins and ends. Raises: OSError, ValueError where the file is damaged."""
    at = _places(file)["status"]
    return at, at + STATUS_BYTES


def size_of(values: Mapping[str, Any]) -> int:
    """The bytes that the texts of those values take."""
    return len(global_heap.collection([_text(key, values[key]) for key in LAST if key in values]))


def _write_texts(file: GrowingFile, values: Mapping[str, Any]) -> dict[str, int]:
    """Write values as texts, and have their attributes point there. Returns the places of all attributes."""
    texts = [_text(key, value) for key, value in values.items()]
    content = global_heap.collection(texts)
    at = file.take(len(content))
    file.write(at, content)
    places = _places(file)
    for number, (key, text) in enumerate(zip(values, texts, strict=True), 1):
        file.write(places[key], global_heap.place(at, number, text))
    return places


def _places(file: GrowingFile) -> dict[str, int]:
    """Where the value of each attribute is."""
    return object_header.attributes_of(file, file.word(ROOT_HEADER))


def _is_text(key: str, value: Any) -> bool:
    return key in JSON or isinstance(value, str)


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
