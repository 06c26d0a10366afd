"""Keys are declared once: what follows from a declaration, and that a new key of a block is one entry."""

from __future__ import annotations

import json
from dataclasses import fields
from itertools import pairwise

import pytest

from cosim.engine.program import METHODS as MADE
from cosim.errors import DiagramErrors
from cosim.language import diagram, keys
from cosim.language.diagram import RunSettings
from cosim.language.entry import BlockEntry
from cosim.language.keys import ANY, BLOCK, DIAGRAM, METHODS, RUN, TYPES, Key
from cosim.study.study_keys import STUDY
from cosim.terminal import cli

SECTIONS = ("inputs", "parameters", "start", "requirements")
MAPPINGS = (*(f".{section}.{ANY}" for section in SECTIONS), ".expression")


def all_keys(section, name=""):
    for key, declared in section.items():
        yield f"{name}.{key}", declared
        yield from all_keys(declared.below, f"{name}.{key}")


@pytest.mark.parametrize("section", [DIAGRAM, STUDY])
def test_every_key_has_a_line_of_help_and_a_type_or_what_stands_below(section):
    for name, key in all_keys(section):
        assert key.help or name.endswith(f".{ANY}"), name
        both = key.type and key.below  # a wire is its source, or says more; a value may stand in a file
        assert (key.type or key.below) and (not both or name.endswith(MAPPINGS)), name


def test_the_settings_of_a_run_are_its_keys():
    assert [field.name for field in fields(RunSettings)] == [*RUN, "nodes"]


def test_every_section_of_a_block_has_its_field():
    sections = {name for name, key in BLOCK.items() if key.below and name not in TYPES}
    assert sections <= {field.name for field in fields(BlockEntry)}


def test_every_method_has_its_file():
    assert set(METHODS) == set(MADE)


def test_defaults_are_what_a_diagram_gets_that_says_nothing(tmp_path):
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {a: {block: Robot}}\n")
    run = diagram.load(tmp_path / "d.yaml").run
    given = {name: key.default for name, key in RUN.items() if name not in ("stop", "step")}
    assert {name: getattr(run, name) for name in given} == given


def test_a_new_key_of_a_block_is_one_declaration(tmp_path, monkeypatch, capsys):
    """Read, refused where it is wrong or does not belong, written out again, and listed: all from one entry."""
    weight = Key("how much it counts", keys.POSITIVE, unit="kg", kinds=("block", "python"))
    monkeypatch.setitem(keys.BLOCK, "weight", weight)
    monkeypatch.setattr("cosim.language.entry.SETTINGS", ("weight",))
    text = "run: {{stop: 1, step: 0.1}}\nblocks:\n  a: {{{}, weight: {}}}\n"
    path = tmp_path / "d.yaml"
    path.write_text(text.format("block: Robot", "2.5"))
    loaded = diagram.load(path)
    assert loaded.blocks["a"].settings["weight"].value == 2.5 and "weight: 2.5" in loaded.resolved()
    for kind, value, said in (
        ("block: Robot", "-1", "`blocks.a.weight` must be above zero, not `-1`"),
        ("fmu: a.fmu", "1", "block `a`: `weight` does not go with `fmu:`"),
    ):
        path.write_text(text.format(kind, value))
        with pytest.raises(DiagramErrors) as caught:
            diagram.load(path)
        assert [str(error.message) for error in caught.value.errors] == [said]
    assert cli.main(["keys", "blocks"]) == 0
    (row,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  weight"))
    assert "number above zero (kg)" in row


def test_the_command_lists_each_section_with_its_defaults(capsys):
    assert cli.main(["keys"]) == 0
    out = capsys.readouterr().out
    assert 'default "jacobi"' in out and json.dumps(RUN["patience"].default) in out
    titles = [
        "diagram:",
        "run:",
        "blocks:",
        "metrics:",
        "study:",
        "study.random:",
        "study.tables.TITLE.columns.HEADING:",
    ]
    assert all(out.index(first) < out.index(second) for first, second in pairwise(titles))
    assert cli.main(["keys", "blok"]) == 2 and "did you mean `blocks`?" in capsys.readouterr().err
