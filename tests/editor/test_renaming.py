"""A block gets another name in all files that have it, and what is computed stays the same."""

import json
from pathlib import Path

import pytest
from pygls.exceptions import JsonRpcException

from cosim.terminal import cli
from tests.editor.client import edited, using

FILES = {
    "d.yaml": """\
run: {stop: 1, step: 0.1, method: gauss-seidel, order: [plant, plant-2]}
blocks:
  wave: {block: Sine}
  plant: {block: Integrator, inputs: {u: wave.y}}  # the plant
  "plant-2": {block: Integrator, inputs: {u: [plant.x]}, dimensions: {n: 1}}
record: {signals: [plant.x, plant-2.x]}
metrics: {plant: {signal: "plant.x", reduce: max}}
requirements:
  calm: always(plant.x < 3 and plant-2.x < 5)
  quiet: >
    always(wave.y < 2
      and plant.x > -3)
outputs: {plant: plant.x}
""",
    "sub/over.yaml": """\
extends: ../d.yaml
blocks:
  plant: {start: {x: 1}}
  after: {block: Gain, inputs: {u: {from: plant.x, delay: 0.2}}, start: {u: 0}}
record: {signals+: [after.y]}
""",
    "study.yaml": """\
title: The plant
diagram: sub/over.yaml
variants:
  high: {set: {blocks.plant.start.x: 2}}
  other: {swap: {plant: Gain}}
grid: {blocks.plant.start.x: [0, 1]}
""",
    "else.yaml": "run: {stop: 1, step: 0.1}\nblocks:\n  plant: {block: Sine}\n",
    "broken.yaml": "blocks: {plant: [\n",
}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def figures(path: Path, capsys):
    capsys.readouterr()
    assert cli.main(["run", str(path), "--json"]) == 0
    return json.loads(capsys.readouterr().out)["metrics"]


def test_a_block_is_renamed_in_its_diagram_what_extends_that_and_studies(folder, capsys):
    async def session(editor):
        await editor.open("d.yaml")
        await editor.open("sub/over.yaml")
        places = (("d.yaml", 4, 4), ("sub/over.yaml", 4, 46), ("sub/over.yaml", 3, 5))
        return [await editor.rename(*place, "cart") for place in places]

    before = figures(folder / "sub" / "over.yaml", capsys)
    found, from_wire, from_overlay = using(folder, session)
    assert found == from_wire == from_overlay
    assert found.keys() == {"d.yaml", "sub/over.yaml", "study.yaml"}
    for file, edits in found.items():
        (folder / file).write_text(edited(FILES[file], edits))
    text = (folder / "d.yaml").read_text()
    assert text == (
        FILES["d.yaml"]
        .replace("[plant,", "[cart,")
        .replace("  plant: {block", "  cart: {block")
        .replace("plant.x", "cart.x")
    )
    study = (folder / "study.yaml").read_text()
    assert study.count("blocks.cart.start.x") == 2 and "{cart: Gain}" in study and "title: The plant" in study
    assert figures(folder / "sub" / "over.yaml", capsys) == before


def test_names_that_are_taken_or_none_are_refused(folder):
    async def session(editor):
        await editor.open("d.yaml")
        said = []
        for new in ("wave", "plant-2", "2nd", "a.b", "after"):
            with pytest.raises(JsonRpcException) as refused:
                await editor.rename("d.yaml", 4, 4, new)
            said.append(refused.value.message)
        return said

    wave, other, number, dotted, after = using(folder, session)
    assert "has a block `wave` already" in wave and "`plant-2` already" in other
    assert "cannot be called `2nd`" in number and "cannot be called `a.b`" in dotted
    assert "over.yaml has a block `after` already" in after
