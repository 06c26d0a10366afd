"""What is wrong is underlined while one types, at the places that `cosim check` prints."""

import re
from pathlib import Path

from cosim.terminal import cli
from tests.conftest import BLOCKS
from tests.editor.client import using

ROOT = Path(__file__).parents[2]
THIRTY = f"""\
titel: Thirty mistakes
run: {{stop: 1, step: 0.1, method: jacoby, tolerance: 2, extrapolation: 3, inner_steps: 0, order: [a, a]}}
fleets: {{robot: 3, car: none}}
blocks:
  source: {{python: "{BLOCKS}:Sine", per: robots}}
  wave: {{block: Sine, parameters: {{amplitud: 2}}}}
  lag:
    python: "{BLOCKS}:Lag"
    per: robot
    parameters: {{T: [1, 2]}}
    inputs: {{u: wave.z}}
  other:
    python: "{BLOCKS}:Lagg"
  pid:
    block: PID
    paramters: {{k_p: 1}}
    parameters: {{k_q: 1, T_f: -1}}
    inputs: {{r: wvae.y, y: wave.y, u: 1}}
    start: {{q: 0}}
    period: 0.05
    offset: -1
  nothing: {{}}
  two: {{block: Sine, python: "{BLOCKS}:Sine"}}
  unknown: {{block: Sinus}}
  gain: {{block: Gain, inputs: {{u: [wave.y, 3]}}, parameters: {{k: "pj/3"}}}}
  open: {{block: Gain}}
  sum: {{expression: "a + * b", inputs: {{a: 1, b: 2}}}}
  lost: {{python: nowhere.py:Lost}}
record: {{period: 0.25, signals: [wave.y, wave.yy, wave.y, pid]}}
metrics:
  largest: {{signal: wave.y, reduce: maxx}}
  least: {{signal: wave.y, reduce: min, from: 3, to: 2}}
  none: {{signal: wave.y}}
requirements:
  calm: always(wave.y <)
  still: always(wav.y < 1)
animation: {{positions: wave}}
"""


def printed(path: Path, capsys) -> set[tuple[int, int]]:
    """The places in a file that `cosim check` prints, also those of further uses of a name."""
    capsys.readouterr()
    cli.main(["check", str(path)])
    found = set()
    for line in capsys.readouterr().err.splitlines():
        if line.startswith(f"{path}:"):
            places, _, also = line.removeprefix(f"{path}:").partition(" at ")
            places = re.match(r"\d+:\d+", places)[0] + (f", {also}" if re.match(r"\d+:\d+", also) else "")
            found |= {(int(row), int(column)) for row, column in re.findall(r"\b(\d+):(\d+)\b", places)}
    return found


def places(diagnostics) -> set[tuple[int, int]]:
    return {(d.range.start.line + 1, d.range.start.character + 1) for d in diagnostics}


def test_thirty_mistakes_of_one_file_are_underlined_where_the_check_prints_them(tmp_path, capsys):
    path = tmp_path / "d.yaml"
    path.write_text(THIRTY)
    wanted = printed(path, capsys)
    assert len(wanted) >= 30

    async def session(editor):
        return await editor.open("d.yaml", "blocks: {}"), await editor.change("d.yaml", THIRTY)

    first, found = using(tmp_path, session)
    assert first and places(found) == wanted
    assert all(d.range.end.character > d.range.start.character for d in found)
    lines = THIRTY.split("\n")
    words = {lines[d.range.start.line][d.range.start.character : d.range.end.character] for d in found}
    assert {"titel", "jacoby", "wvae.y", "k_q", "paramters"} <= words
    (misspelt,) = (d for d in found if "titel" in d.message)
    assert "fix: did you mean `title`?" in misspelt.message and misspelt.code == "UnknownKey"


def test_warnings_are_underlined_too_and_a_good_text_or_yaml_of_another_kind_is_quiet(tmp_path):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {block: Sine}\n  b: {block: Gain, inputs: {u: a.y}}\n"
    text += "  c: {block: Integrator, inputs: {u: b.y}}\n"
    jumping = text.replace("{block: Gain,", '{expression: "if(u > 0.5, 1, 0)",')

    async def session(editor):
        foreign = await editor.open("compose.yaml", "services:\n  web: {image: nginx}\n")
        asked = await editor.hover("compose.yaml", 2, 4)
        return foreign, asked, await editor.open("d.yaml", text), await editor.change("d.yaml", jumping)

    foreign, asked, good, warned = using(tmp_path, session)
    assert foreign == good == [] and asked == ""
    assert [(d.severity.name, d.range.start.line) for d in warned] == [("Warning", 3)]


def test_what_a_diagram_extends_counts_as_it_stands_in_the_editor(tmp_path):
    """A study is checked by its own keys."""
    base = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {block: Sine}\n"
    over = "extends: base.yaml\nblocks:\n  b: {block: Gain, inputs: {u: a.y}}\n"
    (tmp_path / "base.yaml").write_text(base)

    async def session(editor):
        good = await editor.open("over.yaml", over)
        await editor.open("base.yaml", base)
        await editor.change("base.yaml", base.replace("a:", "c:"))
        renamed = editor.told[editor.uri("over.yaml")]
        await editor.change("base.yaml", base.replace("Sine", "Sinus"))
        inherited = editor.told[editor.uri("over.yaml")]
        study = "diagram: base.yaml\nvariants: {x: {swop: {a: Cosine}}}\nrandom: {count: 3}\n"
        return good, renamed, inherited, await editor.open("s.yaml", study)

    good, renamed, inherited, study = using(tmp_path, session)
    assert good == []
    assert places(renamed) == {(3, 32)} and "a.y" in renamed[0].message
    assert places(inherited) == {(1, 10)}  # at the name of the file in which it is
    assert "base.yaml:3:14" in inherited[0].message
    assert inherited[0].related_information[0].location.range.start.line == 2
    assert places(study) == {(2, 16), (3, 1)}


OWN = """\
from cosim import Block, Input, Output, Parameter

print("what a block prints does not disturb the editor")


class Twice(Block):
    \"\"\"y = 2 u.\"\"\"

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = 2 * u
"""


def test_a_file_of_blocks_is_read_anew_when_it_is_saved(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {python: own.py:Twice, inputs: {u: 1}, parameters: {k: 3}}\n"

    async def session(editor):
        before = await editor.open("d.yaml", text)
        (tmp_path / "own.py").write_text(OWN.replace("u = Input()", "u = Input()\n    k = Parameter()"))
        after = await editor.save("own.py")
        (tmp_path / "own.py").write_text(OWN.replace("y = Output()", "y = Output("))
        return before, after, await editor.save("own.py")

    before, after, broken = using(tmp_path, session)
    assert [d.code for d in before] == ["UnknownParameter"] and after == []
    assert [d.code for d in broken] == ["BlockImportError"]
    assert places(broken) == {(3, 15)} and "own.py:10:15" in broken[0].message
