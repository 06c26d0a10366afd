"""Exports blocks of a diagram as a native FMU: the same kernels and the same loop, with no Python at run time."""

from __future__ import annotations

import hashlib
import re
import tempfile
import uuid
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

from cosim.errors import NotExportable, ResultError, nearest
from cosim.export import build, documentation, sources, subnetwork
from cosim.export.about import About
from cosim.export.fmi2_description import Fmi2Description
from cosim.export.fmi3_description import Fmi3Description
from cosim.export.model import Model, describe
from cosim.export.model_description import TOOL, ModelDescription
from cosim.machine import files, notices
from cosim.wiring.network import Network

#: How a model is described, by the version of FMI.
DESCRIPTIONS: dict[str, type[ModelDescription]] = {d.version.name: d for d in (Fmi2Description, Fmi3Description)}
_EPOCH = (1980, 1, 1, 0, 0, 0)  # in the archive, so that the same blocks give the same file
DESCRIPTION_HEAD = 64 * 1024  # bytes of a description, in which it says what tool made it


def export_fmu(
    network: Network,
    blocks: Sequence[str],
    output: str | Path,
    fmi_version: str = "3.0",
    platforms: Sequence[str] | None = None,
    member: int = 1,
    scalars: bool = False,
    about: About | None = None,
    with_sources: bool = False,
) -> Path:
    """Write some blocks of a wired diagram (none: all) as one FMU for Co-Simulation and Model Exchange.

    Blocks that are all mapped by the same fleet are exported as one member of it, with the values of number `member`
    (from 1) as start values; a mixture is exported with arrays over the fleet. Returns the path written.
    platforms: names of `build.PLATFORMS`; this machine's, if none are given. scalars: every element of an array is a
    variable of its own, in FMI 3 too, for importers that know no arrays. about: author, license and the like.
    with_sources: the FMU holds C files too, which compile to the same without Python.
    Raises: UnknownBlock, NotExportable, WrongValue, MissingFile, KernelError, CompilerMissing, BuildFailed,
    ResultError where something stands at `output` that this function did not write.
    """
    if fmi_version not in DESCRIPTIONS:
        raise NotExportable(f"FMI {fmi_version} cannot be written", fix=nearest(fmi_version, DESCRIPTIONS))
    targets = build.find(platforms)
    output = Path(output)
    refuse_foreign(output)
    model = describe(subnetwork.cut(network, blocks, member), _identifier(output.stem))
    about = (about or About()).dated()
    licenses = about.files()
    description = DESCRIPTIONS[fmi_version](model, about, scalars, with_sources)
    _pack(output, {**_members(description, targets), **licenses})
    _tell(model)
    return output


def _members(description: ModelDescription, platforms: Sequence[build.Platform]) -> dict[str, bytes]:
    """What is in the archive, by its paths. Raises: KernelError, CompilerMissing, BuildFailed, NotExportable."""
    kernels = build.KernelCode(description.model)
    token = _token(description, kernels)
    members = {"modelDescription.xml": description.write(token)}
    members["documentation/index.html"] = documentation.page(description).encode(errors="backslashreplace")
    if description.with_sources:
        members |= _sources(description, token, kernels)
    with tempfile.TemporaryDirectory(prefix="cosim-fmu-") as work:
        for platform in platforms:
            library = build.library(description, token, platform, kernels, Path(work) / platform.name)
            members[f"binaries/{platform.folder(description.version)}/{library.name}"] = library.read_bytes()
    return members


def _sources(description: ModelDescription, token: str, kernels: build.KernelCode) -> dict[str, bytes]:
    """What stands in the folder `sources`. Raises: KernelError, NotExportable."""
    texts = sources.files(description, token, kernels.symbols, kernels.texts())
    found = {f"sources/{name}": text.encode() for name, text in texts.items()}
    if description.version.name == "3.0":
        found["sources/buildDescription.xml"] = sources.build_description(description)
    return found


def _tell(model: Model) -> None:
    """What of the diagram importers do not find in the FMU, or may refuse of it."""
    declared = [(v.signal, model.network.variable(v.signal)) for v in model.variables if v.causality == "output"]
    infinite = [signal for signal, variable in declared if not variable.finite]
    for words, signals in (
        ("left out, as importers refuse what is NaN or infinite at the initialization", model.left_out),
        (
            "inputs that begin in the diagram as no number or beyond a limit, in the FMU with 0 or the limit",
            model.moved,
        ),
        ("outputs that may become NaN or infinite, which this program and others refuse of an FMU", infinite),
    ):
        if signals:
            notices.warn(f"{words}: {', '.join(f'`{signal}`' for signal in signals)}")


def refuse_foreign(output: Path) -> None:
    """Raises: ResultError where something stands that `export_fmu` did not write."""
    files.refuse_foreign(output, "an FMU of this program", _is_ours)


def _is_ours(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            return f'generationTool="{TOOL}"'.encode() in file.read(DESCRIPTION_HEAD)
    except (zipfile.BadZipFile, KeyError, EOFError, zlib.error):
        return False


def _identifier(name: str) -> str:
    """A C identifier, as FMI wants of the library's name."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{name}" if not name or name[0].isdigit() else name


def _token(description: ModelDescription, kernels: build.KernelCode) -> str:
    """The same for the same content: of the description, and of the code that computes it."""
    code = "".join(source.symbol + source.fingerprint for unit in kernels.units for source in unit.sources)
    digest = hashlib.sha256(description.write("") + code.encode()).digest()
    return f"{{{uuid.UUID(bytes=digest[:16])}}}"


def _pack(output: Path, members: dict[str, bytes]) -> None:
    """Raises: ResultError."""
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(output) as new, zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
    except OSError as error:
        raise ResultError(f"cannot write {output}: {error.strerror}", fix=files.usual_fix(error)) from None
