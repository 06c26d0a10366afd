"""From a file to a network, or to what is wrong with it; and either way, the files that it is made from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from cosim.authoring.leaving import left
from cosim.errors import CosimError, Problems
from cosim.language import diagram as diagrams
from cosim.language.diagram import Diagram
from cosim.machine import importing
from cosim.watch.orders import Order
from cosim.wiring import block_files, resolution
from cosim.wiring.network import Network


@dataclass(frozen=True)
class Loaded:
    """network: None where there are errors. files: all that have been read, and those that mistakes name."""

    network: Network | None
    errors: list[CosimError]
    files: tuple[Path, ...]


def load(order: Order) -> Loaded:
    """Read and wire what an order names. Nothing is raised: an author's `exit()` is a mistake too."""
    problems, diagram = Problems(), None
    try:
        with importing.LOADING:
            diagram = _read(order, problems)
            network = resolution.wire(diagram, problems)
    except CosimError as error:
        return Loaded(None, error.each, tuple(files(order.path, diagram, error.each)))
    except SystemExit as leaving:
        exited = left(leaving)
        return Loaded(None, [exited], tuple(files(order.path, diagram, [exited])))
    return Loaded(network, [], tuple(files(order.path, diagram)))


def _read(order: Order, problems: Problems) -> Diagram:
    if order.path.suffix.lower() == ".fmu":
        from cosim.wiring import fmu_alone  # with all that FMUs need

        return fmu_alone.load(order.path, order.settings, order.swaps, problems)
    return diagrams.load(order.path, order.settings, order.swaps, problems)


def files(path: Path, diagram: Diagram | None, errors: Iterable[CosimError] = ()) -> list[Path]:
    """The files of a diagram, of its blocks with what they import, of FMUs and of data, and those of mistakes."""
    found = [path, *(diagram.files if diagram else ())]
    for entry in diagram.blocks.values() if diagram else ():
        if entry.kind in ("python", "fmu"):
            found.append(entry.path)
        if entry.kind == "python":
            found += block_files.contents(entry.path)
        found += [data.path for data in entry.data_files]
    found += _places(errors)
    return list(dict.fromkeys(one.absolute() for one in found))


def _places(errors: Iterable[CosimError]) -> Iterator[Path]:
    for error in errors:
        for place in (error.position, *error.others):
            if place and place.line and Path(place.file).is_file():
                yield Path(place.file)
