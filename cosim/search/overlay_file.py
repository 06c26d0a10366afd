"""A point of a search as an overlay that a person runs: a file that extends the diagram, with the point's values."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.errors import ResultError
from cosim.language import source
from cosim.machine import files
from cosim.study.addresses import address_of
from cosim.study.variants import Settings, Variants
from cosim.wiring.network import Network

MARK = "# Written by cosim: "


def write(path: Path, title: str, variants: Variants, variant: str, settings: Settings) -> None:
    """Write the overlay of a study's variant with settings. Raises: ResultError."""
    network = variants.wire(variant, settings)
    chosen = variants.study.variants[variant]
    content: dict[str, Any] = {"title": title, "extends": os.path.relpath(chosen.diagram, path.parent)}
    if chosen.overlay:
        content |= chosen.overlay.plain()
    for name in chosen.swaps:
        entry = network.diagram.blocks[name]
        kept = entry.plain(path.parent)
        _put(content, ["blocks", name, entry.kind], kept[entry.kind])
    for place, value in [*((p, n.plain()) for p, n in chosen.settings.items()), *settings]:
        _put(content, *_where(network, place, value))
    left_out = _left_out(variants, variant, network)
    if left_out:
        content["metrics"] = {**content.get("metrics", {}), **dict.fromkeys(left_out)}
    required = {name: entry.plain() for name, entry in network.diagram.requirements.items()}
    if required:
        content["requirements"] = required
    files.refuse_foreign(path, "an overlay of this program", _is_ours)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(path) as new:
            new.write_text(f"{MARK}{title}.\n{source.dump(content)}", encoding="utf-8")
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror}", fix=files.usual_fix(error)) from None


def _left_out(variants: Variants, variant: str, network: Network) -> list[str]:
    """The metrics of the variant that the study does not keep."""
    if variants.study.metrics is None:
        return []
    whole = Variants(replace(variants.study, metrics=None, added_metrics=None))
    tree, _ = whole.layers(variant)
    written = tree.value["metrics"].value if "metrics" in tree.value else {}
    return [name for name in written if name not in network.diagram.metrics]


def _is_ours(path: Path) -> bool:
    return path.read_bytes().startswith(MARK.encode())


def _where(network: Network, place: str, value: Any) -> tuple[list[str], Any]:
    """The keys below which a value stands, and the value; of an element, all of the value that it belongs to."""
    address = address_of(network, place)
    if address is None:
        return place.split("."), value
    component, name = address.signal.component, address.signal.variable
    written = getattr(network.diagram.blocks[component], address.section)[name]
    return ["blocks", component, address.section, name], written.plain()


def _put(content: dict[str, Any], keys: list[str], value: Any) -> None:
    below = content
    for key in keys[:-1]:
        below = below.setdefault(key, {})
    below[keys[-1]] = value
