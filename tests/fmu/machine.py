"""Builds test FMUs from C with the C compiler, as FMI 2.0 or 3.0, and packs them with a description."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy

SOURCE = Path(__file__).with_name("machine.c")
HEADERS = Path(fmpy.__file__).parent / "c-code"
FOLDERS = {2: "linux64", 3: "x86_64-linux"}


@dataclass(frozen=True)
class V:
    """One variable of the description: FMI 3's type; FMI 2's follows."""

    name: str
    reference: int
    type: str
    causality: str
    start: str | None = None
    variability: str = "continuous"
    initial: str | None = None
    derivative: str | None = None
    depends: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    unit: str | None = None


VARIABLES = (
    V("u", 1, "Float64", "input", "0", unit="m"),
    V("x", 2, "Float64", "output", "0", initial="exact", unit="m"),
    V("y", 3, "Float64", "output", initial="calculated", depends=("u", "x"), unit="m"),
    V("T", 4, "Float64", "parameter", "1", "fixed", unit="s"),
    V("fault_time", 5, "Float64", "parameter", "0", "fixed", unit="s"),
    V("h", 6, "Float64", "output", "1", initial="exact", unit="m"),
    V("v", 7, "Float64", "local", "0", initial="exact"),
    V("der(x)", 8, "Float64", "local", derivative="x", initial="calculated", depends=("u", "x")),
    V("der(h)", 9, "Float64", "local", derivative="h", initial="calculated", depends=("v",)),
    V("der(v)", 10, "Float64", "local", derivative="v", initial="calculated"),
    V("fault", 20, "Int32", "parameter", "0", "fixed"),
    V("bounces", 21, "Int32", "output", "0", "discrete", "exact"),
    V("n", 22, "Int64", "input", "0", "discrete"),
    V("m", 23, "Int64", "output", None, "discrete", "calculated", depends=("n",)),
    V("ticks", 24, "Int32", "output", "0", "discrete", "exact"),
    V("color", 25, "Enumeration", "input", "1", "discrete"),
    V("on", 30, "Boolean", "input", "false", "discrete"),
    V("off", 31, "Boolean", "output", None, "discrete", "calculated", depends=("on",)),
    V("name", 40, "String", "parameter", "nobody", "fixed"),
)
VARIABLES3 = (
    V("array", 50, "Float64", "input", "1 2 3 4 5 6", shape=(2, 3)),
    V("twice", 51, "Float64", "output", initial="calculated", depends=("array",), shape=(2, 3)),
    V("short", 52, "Float32", "input", "0.5"),
    V("short_next", 53, "Float32", "output", initial="calculated", depends=("short",)),
    V("byte", 54, "Int8", "input", "7", "discrete"),
    V("byte_next", 55, "Int8", "output", None, "discrete", "calculated", depends=("byte",)),
)
TYPES2 = {
    "Float64": "Real",
    "Int32": "Integer",
    "Int64": "Integer",
    "Enumeration": "Enumeration",
    "Boolean": "Boolean",
    "String": "String",
}
ITEMS = '<Item name="red" value="1"/><Item name="blue" value="2"/>'
DERIVATIVES = ("der(h)", "der(x)", "der(v)")  # not in the order of the variables


@dataclass(frozen=True)
class Model:
    """What a description says beside the variables; derivatives: their names in the order of the state vector."""

    name: str
    variables: tuple[V, ...]
    derivatives: tuple[str, ...] = ()
    indicators: tuple[int, ...] = ()  # value references


def machine(version: int) -> Model:
    """The FMU of `machine.c`."""
    return Model("machine", VARIABLES + (VARIABLES3 if version == 3 else ()), DERIVATIVES, (6,))


#: With the option -DSAVES, an FMU has the functions that save its state: attributes that say so, by version.
SAVES = {
    2: 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"',
    3: 'canGetAndSetFMUState="true" canSerializeFMUState="true"',
}


def build(
    folder: Path,
    version: int,
    kinds: str = "me cs",
    flags: str = "",
    edit=lambda xml: xml,
    options: tuple[str, ...] = (),
) -> Path:
    """`machine<version>.fmu` in the folder. flags: attributes of the kinds; edit: changes the description's text."""
    return pack(folder, version, machine(version), SOURCE, kinds, flags, edit, options)


def pack(
    folder: Path,
    version: int,
    model: Model,
    source: Path,
    kinds: str = "me cs",
    flags: str = "",
    edit=lambda xml: xml,
    options: tuple[str, ...] = (),
) -> Path:
    """`<name><version>.fmu` of a C source. options: more of the compiler's."""
    if shutil.which("gcc") is None:
        import pytest

        pytest.skip("there is no C compiler")
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / f"{model.name}.so"
    plain = ["-shared", "-fPIC", "-O2", "-ffp-contract=off", f"-DFMI={version}", f"-I{HEADERS}", "-w"]
    subprocess.run(["gcc", *plain, *options, str(source), "-o", str(library), "-lm"], check=True)
    path = folder / f"{model.name}{version}.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(library, f"binaries/{FOLDERS[version]}/{model.name}.so")
        archive.writestr("modelDescription.xml", edit(description(version, kinds, flags, model)))
    return path


def description(version: int, kinds: str = "me cs", flags: str = "", model: Model | None = None) -> str:
    """The model description."""
    model = model or machine(version)
    names = {"me": "ModelExchange", "cs": "CoSimulation", "se": "ScheduledExecution"}
    interfaces = "".join(f'<{names[k]} modelIdentifier="{model.name}" {flags}/>' for k in kinds.split())
    return (_description2 if version == 2 else _description3)(interfaces, model)


def _description2(interfaces: str, model: Model) -> str:
    variables = [V("time", 0, "Float64", "independent"), *model.variables]
    index = {v.name: k + 1 for k, v in enumerate(variables)}

    def scalar(v: V) -> str:
        attributes = {"start": v.start, "derivative": v.derivative and index[v.derivative], "unit": v.unit}
        attributes["declaredType"] = "Color" if v.type == "Enumeration" else None
        outer = {"causality": v.causality, "variability": v.variability, "initial": v.initial}
        inner = f"<{TYPES2[v.type]} {_attributes(attributes)}/>"
        start = f'<ScalarVariable name="{v.name}" valueReference="{v.reference}" {_attributes(outer)}>'
        return f"{start}{inner}</ScalarVariable>"

    def unknowns(tag: str, chosen: list[V]) -> str:
        rows = [f'<Unknown index="{index[v.name]}" dependencies="{_indices(v)}"/>' for v in chosen]
        return f"<{tag}>{''.join(rows)}</{tag}>" if rows else ""

    def _indices(v: V) -> str:
        return " ".join(str(index[d]) for d in v.depends)

    known = {v.name: v for v in variables}
    outputs = [v for v in variables if v.causality == "output"]
    initial = sorted((v for v in variables if v.initial == "calculated"), key=lambda v: index[v.name])
    structure = unknowns("Outputs", outputs) + unknowns("Derivatives", [known[d] for d in model.derivatives])
    structure += unknowns("InitialUnknowns", initial)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{model.name}" guid="{model.name}"
 numberOfEventIndicators="{len(model.indicators)}">
{interfaces}
<UnitDefinitions><Unit name="m"/><Unit name="s"/></UnitDefinitions>
<TypeDefinitions><SimpleType name="Color"><Enumeration>{ITEMS}</Enumeration></SimpleType></TypeDefinitions>
<LogCategories><Category name="logStatusError"/></LogCategories>
<ModelVariables>{"".join(map(scalar, variables))}</ModelVariables>
<ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"""


def _description3(interfaces: str, model: Model) -> str:
    variables = [V("time", 0, "Float64", "independent"), *model.variables]
    reference = {v.name: v.reference for v in variables}

    def variable(v: V) -> str:
        attributes = {"valueReference": v.reference, "causality": v.causality, "variability": v.variability}
        attributes |= {"initial": v.initial, "derivative": v.derivative and reference[v.derivative], "unit": v.unit}
        attributes["declaredType"] = "Color" if v.type == "Enumeration" else None
        inside = "".join(f'<Dimension start="{n}"/>' for n in v.shape)
        if v.type == "String":
            inside += f'<Start value="{v.start}"/>'
        else:
            attributes["start"] = v.start
        return f'<{v.type} name="{v.name}" {_attributes(attributes)}>{inside}</{v.type}>'

    def unknown(tag: str, v: V) -> str:
        known = " ".join(str(reference[d]) for d in v.depends)
        return f'<{tag} valueReference="{v.reference}" dependencies="{known}"/>'

    named = {v.name: v for v in variables}
    rows = [unknown("Output", v) for v in variables if v.causality == "output"]
    rows += [unknown("ContinuousStateDerivative", named[d]) for d in model.derivatives]
    rows += [unknown("InitialUnknown", v) for v in variables if v.initial == "calculated"]
    rows += [f'<EventIndicator valueReference="{reference}"/>' for reference in model.indicators]
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{model.name}" instantiationToken="{model.name}">
{interfaces}
<UnitDefinitions><Unit name="m"/><Unit name="s"/></UnitDefinitions>
<TypeDefinitions><EnumerationType name="Color">{ITEMS}</EnumerationType></TypeDefinitions>
<LogCategories><Category name="logStatusError"/></LogCategories>
<ModelVariables>{"".join(map(variable, variables))}</ModelVariables>
<ModelStructure>{"".join(rows)}</ModelStructure>
</fmiModelDescription>"""


def _attributes(values: dict[str, object]) -> str:
    return " ".join(f'{k}="{v}"' for k, v in values.items() if v is not None)
