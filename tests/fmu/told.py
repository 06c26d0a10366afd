"""The test FMU `told.c`, which tells what it has been told, and its descriptions."""

from __future__ import annotations

from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model

SOURCE = Path(__file__).with_name("told.c")
ITEMS = '<Item name="low" value="1"/><Item name="very high" value="7" description="hot"/><Item name="2" value="3"/>'
CATEGORIES = "".join(f'<Category name="{name}"/>' for name in ("logEvents", "logSteps", "logStatusWarning"))
EXPERIMENT = '<DefaultExperiment startTime="2" stopTime="3" stepSize="0.1" tolerance="1e-5"/>'
TOLD2 = {
    "events": 4,
    "logging": 5,
    "categories": 6,
    "level_told": 11,
    "heat_told": 13,
    "text_told": 15,
    "note_told": 28,
}
TOLD3 = {**TOLD2, "words_told": 17, "blob_told": 19}


def description2(kinds: str, experiment: str = EXPERIMENT) -> str:
    """Of FMI 2.0."""

    def scalar(name: str, reference: int, more: str, value: str) -> str:
        return f'<ScalarVariable name="{name}" valueReference="{reference}" {more}>{value}</ScalarVariable>'

    fixed, exact = 'causality="parameter" variability="fixed"', 'causality="output" variability="discrete"'
    real = "<Real/>"
    rows = [
        scalar("tolerance", 1, 'causality="output"', real),
        scalar("start", 2, 'causality="output"', real),
        scalar("clock", 3, 'causality="output"', real),
        scalar("k", 7, fixed, '<Real start="1"/>'),
        scalar("u", 8, 'causality="input"', '<Real start="0"/>'),
        scalar("y", 9, 'causality="output"', real),
        scalar("level", 10, fixed, '<Enumeration declaredType="Level" start="1"/>'),
        scalar("heat", 12, 'causality="input" variability="discrete"', '<Enumeration declaredType="Level" start="1"/>'),
        scalar("text", 14, fixed, '<String start="nobody"/>'),
        scalar("note", 27, 'causality="input" variability="discrete"', '<String start="none"/>'),
        *(scalar(name, reference, exact, "<Integer/>") for name, reference in TOLD2.items()),
    ]
    outputs = [k + 1 for k, row in enumerate(rows) if 'causality="output"' in row]
    unknowns = "".join(
        f'<Unknown index="{k}"' + (' dependencies="5"' if k == 6 else ' dependencies=""') + "/>" for k in outputs
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="told" guid="told" numberOfEventIndicators="0">
{kinds}
<TypeDefinitions><SimpleType name="Level"><Enumeration>{ITEMS}</Enumeration></SimpleType></TypeDefinitions>
<LogCategories>{CATEGORIES}</LogCategories>
{experiment}
<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>
</fmiModelDescription>"""


def description3(kinds: str, experiment: str = EXPERIMENT) -> str:
    """Of FMI 3.0."""

    def row(kind: str, name: str, reference: int, more: str, inside: str = "") -> str:
        return f'<{kind} name="{name}" valueReference="{reference}" {more}>{inside}</{kind}>'

    fixed, discrete = 'causality="parameter" variability="fixed"', 'causality="output" variability="discrete"'
    sized = '<Dimension valueReference="22"/>'
    rows = [
        '<Float64 name="time" valueReference="0" causality="independent"/>',
        row("Float64", "tolerance", 1, 'causality="output"'),
        row("Float64", "start", 2, 'causality="output"'),
        row("Float64", "clock", 3, 'causality="output"', '<Alias name="zeit" description="auch"/>'),
        row("Float64", "k", 7, f'{fixed} start="1"', '<Alias name="gain"/><Alias name="factor"/>'),
        row("Float64", "u", 8, 'causality="input" start="0"', '<Alias name="force"/>'),
        row("Float64", "y", 9, 'causality="output"', '<Alias name="y_too"/>'),
        row("Enumeration", "level", 10, f'{fixed} declaredType="Level" start="1"'),
        row("Enumeration", "heat", 12, 'causality="input" declaredType="Level" start="1"'),
        row("String", "text", 14, fixed, '<Start value="nobody"/>'),
        row("String", "note", 27, 'causality="input"', '<Start value="none"/>'),
        row("String", "words", 16, fixed, '<Dimension start="2"/><Start value="a"/><Start value="b"/>'),
        row("Binary", "blob", 18, fixed, '<Start value="00ff"/>'),
        row("UInt64", "big", 20, f'{fixed} start="{2**64 - 1}"'),
        row("UInt64", "big_told", 21, discrete),
        row("UInt64", "size", 22, 'causality="structuralParameter" variability="fixed" start="3" max="16"'),
        row("Float64", "gains", 23, f'{fixed} start="1 2 3"', sized),
        row("Float64", "in", 24, 'causality="input" start="0 0 0"', sized),
        row("Float64", "total", 26, 'causality="output"'),
        *(row("Int64", name, reference, discrete) for name, reference in TOLD3.items()),
    ]
    known = {9: "8", 26: "24"}
    outputs = [1, 2, 3, 9, 21, 26, *TOLD3.values()]
    structure = [
        f'<{tag} valueReference="{r}" dependencies="{known.get(r, "")}"/>'
        for tag in ("Output", "InitialUnknown")
        for r in outputs
    ]
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="told" instantiationToken="told">
{kinds}
<TypeDefinitions><EnumerationType name="Level">{ITEMS}</EnumerationType></TypeDefinitions>
<LogCategories>{CATEGORIES}</LogCategories>
{experiment}
<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure>{"".join(structure)}</ModelStructure>
</fmiModelDescription>"""


def build(
    folder: Path, version: int, kinds: str = "me cs", flags: str = "", options=(), experiment: str = EXPERIMENT
) -> Path:
    """The FMU; options: of the compiler."""
    names = {"me": "ModelExchange", "cs": "CoSimulation"}
    interfaces = "".join(f'<{names[k]} modelIdentifier="told" {flags}/>' for k in kinds.split())
    text = (description2 if version == 2 else description3)(interfaces, experiment)
    return machine.pack(folder, version, Model("told", ()), SOURCE, kinds, "", lambda _: text, options)
