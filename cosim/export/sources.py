"""The C files of an FMU: one that includes all others, so that FMI's functions alone are visible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from cosim.export import c_source
from cosim.export.model_description import ModelDescription

WRAPPER = Path(__file__).parent / "wrapper"
_PARTS = "parts"  # the folder of what is included
_HEADERS = ("arithmetic.h", "instance.h", "kernel.h", "model.h")
_BODIES = ("instance.c", "evaluation.c", "events.c", "derivatives.c", "snapshot.c")
_HEAD = """\
/* {name}, as FMI {version}. This file is compiled alone, as C11 by GCC or Clang, with FMI's headers, and linked with
 * the C library's mathematical functions; parts/ has what it includes. */
"""


def files(
    description: ModelDescription, token: str, symbols: Sequence[str], kernels: Mapping[str, str]
) -> dict[str, str]:
    """The texts by their paths. symbols: of each call's function. kernels: C, by their units; none for object code."""
    version = description.version
    included = ["model.h", *(f"{unit}.c" for unit in kernels), "model.c", *_BODIES, f"{version.prefix}.c"]
    head = _HEAD.format(name=_comment(description.model.name), version=version.name)
    lines = ["#define KERNEL static"] if kernels else []
    lines += [f'#include "{_PARTS}/{name}"' for name in included]
    parts = {
        name: (WRAPPER / name).read_text(encoding="utf-8") for name in (*_HEADERS, *_BODIES, f"{version.prefix}.c")
    }
    parts |= {f"{unit}.c": text for unit, text in kernels.items()}
    parts |= {"layout.h": c_source.layout(), "model.c": c_source.model(description, token, symbols)}
    main = {main_file(description): head + "\n".join(lines) + "\n"}
    return main | {f"{_PARTS}/{name}": text for name, text in sorted(parts.items())}


def main_file(description: ModelDescription) -> str:
    """The name of the file that is compiled."""
    return f"{description.model.identifier}.c"


def build_description(description: ModelDescription) -> bytes:
    """FMI 3's buildDescription.xml."""
    root = Element("fmiBuildDescription", fmiVersion=description.version.name)
    built = SubElement(root, "BuildConfiguration", modelIdentifier=description.model.identifier)
    listed = SubElement(built, "SourceFileSet", language="C11")
    SubElement(listed, "SourceFile", name=main_file(description))
    SubElement(built, "Library", name="m", external="true")
    ElementTree.indent(root)
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written


def _comment(text: str) -> str:
    """A text that ends no comment."""
    return " ".join(text.replace("*/", "* /").split()).encode("utf-8", "replace").decode()
