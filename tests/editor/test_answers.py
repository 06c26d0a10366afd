"""What may be written, what a word means and where it is from, asked as an editor asks."""

import sys
from pathlib import Path

import pytest

from cosim.terminal import cli
from tests.editor.client import using

ROOT = Path(__file__).parents[2]
TEXT = """\
title: A controller and its plant
run: {stop: 1, step: 0.01, method: joint}
fleets: {robot: 3}
blocks:
  reference: {block: Step, parameters: {final: 2}}
  controller:
    block: PID
    parameters: {k_p: 2}
    inputs: {r: reference.y, y: plant.x}
  plant:
    python: own.py:Plant
    inputs: {u: controller.u}
  fleet: {block: Gain, per: robot, dimensions: {n: 2}, inputs: {u: [1, 2]}}
record: {signals: [plant.x, fleet.y]}
metrics: {last: {signal: plant.x, reduce: final}}
requirements: {calm: always(plant.x < 3)}
"""
OWN = """\
from cosim import Block, Input, Local, Parameter, State


class Plant(Block):
    \"\"\"A cart of mass m.

    ::

        m dv/dt = u
    \"\"\"

    u = Input(unit="N", description="force")
    x = State(unit="m", output=True, description="position")
    v = State(unit="m/s", description="velocity")
    m = Parameter(unit="kg", default=2.0, min=0.1, description="mass")

    def derivatives(u, v, m, d_x, d_v):
        d_x[0] = v
        d_v[0] = u / m
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "d.yaml").write_text(TEXT)
    return tmp_path


def place(text, marked):
    """The line and column of `|` in a line of a text that is marked with it, from 1; and the text without."""
    plain = marked.replace("|", "")
    assert text.count(plain) == 1, plain
    before = text[: text.index(plain) + marked.index("|")]
    return before.count("\n") + 1, len(before) - before.rfind("\n")


def offered(folder, *typed):
    """What is offered at the `|` of each line that takes the place of another, one after the other in one session."""

    async def session(editor):
        await editor.open("d.yaml")
        found = []
        for old, new in typed:
            assert TEXT.count(old) == 1
            text = TEXT.replace(old, new)
            before = text[: text.index("|")]
            editor.type("d.yaml", text.replace("|", "", 1))
            line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
            found.append(await editor.offered("d.yaml", line, column))
        return found

    return using(folder, session)


def test_signals_keys_types_and_words_are_offered_where_they_fit(folder):
    """Also in lines that do not parse yet, with what was known before."""
    wires, ports, recorded, formula, types, own, fleets, methods, parameters, keys, members, *halves = offered(
        folder,
        ("u: controller.u}", "u: |}"),
        ("u: controller.u}", "u: controller.|}"),
        ("[plant.x, fleet.y]", "[plant.|, fleet.y]"),
        ("always(plant.x < 3)", "always(pl| < 3)"),
        ("block: PID", "block: P|"),
        ("python: own.py:Plant", "python: |"),
        ("per: robot", "per: |"),
        ("method: joint", "method: |"),
        ("{k_p: 2}", "{k_p: 2, |}"),
        ("    block: PID\n", "    block: PID\n    |\n"),
        ("u: controller.u}", 'u: "fleet.y[|"}'),
        ("{u: controller.u}", "{u: con|"),
        ("signals: [plant.x, fleet.y]}", 'signals: [plant.x, "fl|'),
        ("    inputs: {u: controller.u}\n", "    inputs:\n      |\n"),
        ("  plant:\n", "  con|\n  plant:\n"),
    )
    assert {"controller.u", "plant.x", "reference.y", "fleet.y"} <= wires.keys() and "plant.v" not in wires
    assert ports["controller.u"].text_edit.new_text == "controller.u"
    edit = ports["controller.u"].text_edit.range
    assert (edit.start.character, edit.end.character) == (16, 27)  # the word that is typed, with its dot
    assert {"plant.x", "plant.v", "plant.m"} <= recorded.keys()  # recordings may read locals
    assert {"plant.x", "eventually", "and"} <= formula.keys()
    assert "PID controller" in types["PID"].detail and "Integrator" in types
    assert own["own.py:Plant"].detail == "A cart of mass m."
    assert [*fleets] == ["robot"] and {"jacobi", "joint", "gauss-seidel"} == methods.keys() - {"iterated"}
    assert "proportional gain" in parameters["k_p"].detail and parameters["T_f"].text_edit.new_text == "T_f: "
    assert "default 0.01" in parameters["T_f"].detail and [*parameters][-1] == "k_p"  # which is there already
    assert {"inputs", "period", "start"} <= keys.keys() and not {"mode", "python"} & keys.keys()
    assert [*members] == ["1", "2", "3", "1..3"]
    broken, opened, alone, names = halves
    assert "controller.u" in broken and "fleet.y" in opened
    assert [*alone] == ["u"] and alone["u"].detail == "N; force"
    assert "controller" in names


def test_what_a_word_means(folder):
    async def session(editor):
        await editor.open("d.yaml")

        async def about(marked):
            return await editor.hover("d.yaml", *place(TEXT, marked))

        return [
            await about(marked)
            for marked in (
                "inputs: {u: contr|oller.u",
                "signals: [plant|.x",
                "always(pla|nt.x",
                "  pla|nt:\n",
                "python: own|.py",
                "block: PI|D",
                "{k_|p: 2}",
                "me|thod: joint",
                "A contr|oller and",
            )
        ]

    wire, port, formula, name, own, pid, gain, method, title = using(folder, session)
    assert "controller.u" in wire and "output of PID" in wire and "direct feedthrough" in wire
    for page in (port, formula):
        assert "**plant.x** (m): output of Plant" in page and "shape scalar" in page
        assert "position; a state" in page and "m dv/dt = u" in page
    assert "block `plant`" in name and "m dv/dt = u" in name and "m dv/dt = u" in own
    assert "v = k_p (b r - y)" in pid and "default 1.0" in gain and 'default "jacobi"' in method
    assert "what it is called" in title


def test_where_a_word_is_from(folder):
    (folder / "over.yaml").write_text("extends: d.yaml\nblocks:\n  more: {block: Gain, inputs: {u: plant.x}}\n")

    async def session(editor):
        await editor.open("d.yaml")
        await editor.open("over.yaml")
        over = (folder / "over.yaml").read_text()
        return [
            *[
                await editor.definition("d.yaml", *place(TEXT, marked))
                for marked in (
                    "  pla|nt:\n",
                    "own.py:Pl|ant",
                    "inputs: {|u: contr",
                    "block: PI|D",
                    "{u: contr|oller.u",
                    "(plant.|x",
                )
            ],
            *[await editor.definition("over.yaml", *place(over, m)) for m in ("{u: pla|nt.x", "extends: d|.yaml")],
        ]

    pid = next(
        n for n, line in enumerate((ROOT / "blocks" / "pid.py").read_text().split("\n"), 1) if "class PID" in line
    )
    name = ("d.yaml", 10)
    assert using(folder, session) == [
        *[("own.py", 4), ("own.py", 4), ("own.py", 12), ("pid.py", pid), ("d.yaml", 6), name],
        *[name, ("d.yaml", 1)],
    ]


def test_columns_count_in_utf_16_and_the_server_says_what_it_can(folder):
    text = TEXT.replace("reference.y, y: plant.x", "reference.y, y: plant.x, 𝜃𝜃: plant.z")

    async def session(editor):
        found = await editor.open("d.yaml", text)
        line = text.split("\n")[8]
        units = len(line[: line.index("plant.z") + 2].encode("utf-16-le")) // 2
        return editor.about, found, await editor.offered("d.yaml", 9, units + 1), units

    about, found, items, units = using(folder, session)
    edit = items["plant.x"].text_edit.range
    assert edit.start.character == units - 2 and edit.end.character == units + 5
    assert any(d.range.end.character - d.range.start.character == 4 for d in found)  # two signs of two units each
    able = about.capabilities
    assert about.server_info.name == "cosim" and "." in able.completion_provider.trigger_characters
    assert able.hover_provider and able.definition_provider and able.rename_provider


def test_a_server_without_its_package_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygls", None)
    monkeypatch.delitem(sys.modules, "cosim.editor.server", raising=False)
    assert cli.main(["lsp"]) == 2
    assert "pip install 'cosim[editor]'" in capsys.readouterr().err
