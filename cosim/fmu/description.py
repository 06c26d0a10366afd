"""The model description of an FMU, as FMPy reads it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from cosim.errors import FmuError, Position
from cosim.fmu import archive, versions

INTERFACES = {
    "CoSimulation": "coSimulation",
    "ModelExchange": "modelExchange",
    "ScheduledExecution": "scheduledExecution",
}


def read_description(path: Path, position: Position | None = None) -> tuple[Path, Any]:
    """Unpack an FMU and read its description. Raises: MissingFile, ArchiveError, FmuError."""
    folder = archive.unpack(path, position)
    try:
        description = _read(folder)
    except FmuError as error:
        raise FmuError(f"`{path.name}`{error.message}", position, error.fix) from None
    for kind in (getattr(description, name) for name in INTERFACES.values()):
        if kind is not None:
            archive.check_identifier(kind.modelIdentifier, path.name, position)
    return folder, description


@lru_cache(maxsize=64)
def _read(folder: Path) -> Any:
    """The description in a folder, which nobody changes. Raises: FmuError without the FMU's name."""
    from fmpy.model_description import ValidationError, read_model_description
    from lxml import etree

    root = etree.parse(str(folder / archive.DESCRIPTION)).getroot()
    version = root.get("fmiVersion", "none")
    try:
        versions.find(version)
    except LookupError:
        message = f" is of FMI version {version}; FMI 2.0 and 3.0 can be run"
        raise FmuError(message, fix="export the FMU for FMI 2.0 or 3.0") from None
    try:
        description = read_model_description(str(folder), validate=False)
    except ValidationError as error:
        raise FmuError(f": {'; '.join(error.problems)}", fix="export the FMU again") from None
    except Exception as error:  # noqa: BLE001  # fmpy raises all sorts
        message = f": its model description cannot be read: {type(error).__name__}: {error}"
        raise FmuError(message, fix="export the FMU again") from None
    for tag, kind in INTERFACES.items():
        if (interface := getattr(description, kind)) is not None and versions.find(version).number == 3:
            name = "providesDirectionalDerivatives"  # as FMI 2 has one less, FMPy finds none of FMI 3
            interface.providesDirectionalDerivative = root.find(tag).get(name) in ("true", "1")
    texts = _texts(root)
    for variable in description.modelVariables:  # of whose texts FMPy reads the first
        variable.start = texts.get((variable.alias or variable).name, variable.start)
    return description


def _texts(root: Any) -> dict[str, list[str]]:
    """The start values of FMI 3's texts and binary data, by variable."""
    rows = root.iterfind("ModelVariables/*")
    starts = {row.get("name"): [start.get("value") for start in row.findall("Start")] for row in rows}
    return {name: texts for name, texts in starts.items() if texts}
