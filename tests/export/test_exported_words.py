"""What an exported FMU says of itself: author, license, date, and its documentation."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from lxml import html

from cosim.engine import run
from cosim.errors import MissingFile, WrongValue
from cosim.export.about import About
from cosim.export.exporter import export_fmu
from cosim.terminal import cli

BLOCKS = Path(__file__).with_name("blocks_for_tests.py")
VERSIONS = ("2.0", "3.0")
DIAGRAM = f"""
title: Pushed & <held>
run: {{stop: 1, step: 0.01}}
blocks:
  robot: {{python: {BLOCKS}:Robot, inputs: {{u: wave.y}}, integrator: rk4, inner_steps: 2}}
  wave: {{python: {BLOCKS}:Wave}}
  counter: {{python: {BLOCKS}:Counter, period: 0.03, inputs: {{u: wave.y}}}}
  gain: {{python: own.py:Gain, inputs: {{u: wave.y}}}}
"""
OWN = '''
from cosim import Block, Input, Output, Parameter

class Gain(Block):
    """Amplifies <all> of `u`.

    ::

        y = k u    with k > 0
          = y
    """

    u = Input(2, unit="m")
    k = Parameter(4, default=(1.0, 2.0, 3.0, 4.5), min=0, unit="1", description="gain & more")
    y = Output(2, unit="m")

    def outputs(u, k, y):
        y[0] = k[0] * u[0]
        y[1] = k[1] * u[1]
'''
ABOUT = About(
    author="Ä. <A> & B", version="1.2", copyright="(C) 2026", license="BSD-3-Clause", date="2026-01-31T13:00+01:00"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("words")
    (made / "own.py").write_text(OWN)
    (made / "d.yaml").write_text(DIAGRAM)
    return made


@pytest.fixture(scope="module")
def network(folder):
    return run.load(folder / "d.yaml")


@pytest.fixture(autouse=True)
def no_epoch(monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_said_stands_in_the_description(network, folder, version):
    path = export_fmu(network, ["gain"], folder / "gain.fmu", version, about=ABOUT)
    said = read_model_description(path)
    assert (said.author, said.version, said.copyright, said.license) == (
        "Ä. <A> & B",
        "1.2",
        "(C) 2026",
        "BSD-3-Clause",
    )
    assert said.generationDateAndTime == "2026-01-31T12:00:00Z" and said.generationTool == "cosim"
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_without_a_word_nothing_is_said_and_the_same_blocks_give_the_same_file(network, folder, version):
    one, two = (export_fmu(network, ["gain"], folder / n / "gain.fmu", version) for n in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    said = read_model_description(one)
    assert [said.author, said.version, said.copyright, said.license, said.generationDateAndTime] == [None] * 5
    one, two = (export_fmu(network, ["gain"], folder / n / "gain.fmu", version, about=ABOUT) for n in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()


def test_a_reproducible_build_says_its_date(network, folder, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    path = export_fmu(network, ["gain"], folder / "gain.fmu")
    assert read_model_description(path).generationDateAndTime == "1970-01-02T00:00:00Z"
    assert "1970-01-02T00:00:00Z" in members(path)["documentation/index.html"].decode()


@pytest.mark.parametrize(
    ("name", "inside"),
    [("LICENSE", "license.txt"), ("terms.md", "license.txt"), ("l.HTML", "license.html"), ("a.spdx", "license.spdx")],
)
def test_the_license_goes_along(network, folder, name, inside):
    (folder / name).write_bytes(b"All rights \xff reserved\r\n")
    path = export_fmu(network, ["gain"], folder / "gain.fmu", about=About(license_file=folder / name))
    found = members(path)
    assert found[f"documentation/licenses/{inside}"] == b"All rights \xff reserved\r\n"
    page = html.document_fromstring(found["documentation/index.html"])
    assert page.xpath("//a/@href") == [f"licenses/{inside}"]


@pytest.mark.parametrize(
    ("about", "error", "message"),
    [
        (About(date="soon"), WrongValue, "`soon` is no date"),
        (About(date="2026-13-01"), WrongValue, "is no date"),
        (About(license_file=Path("none.txt")), MissingFile, "there is no file none.txt with a license"),
        (About(license_file=Path()), MissingFile, "there is no file . with a license"),
    ],
)
def test_what_cannot_be_said_is_refused_before_anything_is_written(network, folder, about, error, message):
    with pytest.raises(error, match=re.escape(message)) as caught:
        export_fmu(network, ["gain"], folder / "no.fmu", about=about)
    assert caught.value.fix and not (folder / "no.fmu").exists()


def test_an_epoch_that_is_none_is_refused(network, folder, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "never")
    with pytest.raises(WrongValue, match="SOURCE_DATE_EPOCH, `never`, is no date"):
        export_fmu(network, ["gain"], folder / "no.fmu")


def test_characters_that_xml_cannot_hold_are_replaced(network, folder):
    path = export_fmu(network, ["gain"], folder / "gain.fmu", about=About(author="A\x01\udcffB\tC"))
    assert read_model_description(path).author.startswith("A\ufffd\ufffdB")
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_the_documentation_tells_blocks_variables_and_settings(network, folder, version):
    path = export_fmu(network, [], folder / "all.fmu", version, about=ABOUT)
    text = members(path)["documentation/index.html"].decode()
    page = html.document_fromstring(text)
    assert page.xpath("//h1/text()") == ["Pushed & <held>"]
    assert page.xpath("//h2/text()") == [
        "robot: Robot",
        "wave: Wave",
        "counter: Counter",
        "gain: Gain",
        "How it computes",
    ]
    assert "Amplifies <all> of u." in [p.text_content() for p in page.xpath("//p")]
    assert page.xpath("//pre/text()") == ["y = k u    with k > 0\n  = y"]
    assert dict(zip(page.xpath("//dt/text()"), page.xpath("//dd/text()"), strict=True))["author"] == "Ä. <A> & B"
    rows = {row[0].text: dict(zip(head, (cell.text for cell in row), strict=True)) for head, row in tables(page)}
    assert rows["gain.k[4]"] == {
        "variable": "gain.k[4]",
        "kind": "parameter",
        "unit": "1",
        "start": "1 2 3 4.5",
        "min": "0",
        "meaning": "gain & more",
        "depends at once on": None,
    }
    assert rows["robot.v[2]"]["kind"] == "continuous local, state" and rows["robot.v[2]"]["unit"] == "m/s"
    assert rows["gain.y[2]"]["depends at once on"] == "time" and "min" not in rows["robot.v[2]"]
    said = [item.text_content() for item in page.xpath("//li")]
    assert "robot is integrated by rk4, 2 steps in each inner step, with its inputs held." in said
    assert "counter is sampled every 0.03 s." in said and "robot.u ← wave.y" in said
    assert str(BLOCKS.parent) not in text and str(folder) not in text


def tables(page):
    for table in page.xpath("//table"):
        head = table.xpath("./thead/tr/th/text()")
        for row in table.xpath("./tbody/tr"):
            yield head, row


def test_the_command_says_it_all(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    Path("mine.txt").write_text("mine")
    words = "--author A --model-version 3 --copyright C --license L --license-file mine.txt --date 2026-01-01"
    assert cli.main(["export", "d.yaml", "gain", "-o", "said.fmu", *words.split()]) == 0
    said = read_model_description("said.fmu")
    assert (said.author, said.version, said.copyright, said.license) == ("A", "3", "C", "L")
    assert said.generationDateAndTime == "2026-01-01T00:00:00Z"
    assert members(Path("said.fmu"))["documentation/licenses/license.txt"] == b"mine"
    assert cli.main(["export", "d.yaml", "gain", "-o", "said.fmu", "--date", "soon"]) == 2
    assert "`soon` is no date\n    fix: such as" in capsys.readouterr().err
