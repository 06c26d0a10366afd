"""`name+: […]` adds to a list of what an overlay lies over."""

import pytest

from cosim.errors import UnknownKey, UnknownSetting, WrongValue
from cosim.language.diagram import load
from tests.language.files import HEAD, INNER, mistake, mistakes, plain, write


def signals(path, *settings):
    return [node.value for node in load(path, settings).record.signals]


def test_an_overlay_adds_to_the_lists_of_its_base_and_another_to_what_comes_of_it(folder):
    write(
        "sub/a.yaml",
        "extends: ../base.yaml\nrecord: {signals+: [pump.r]}\nblocks: {level: {inputs: {other+: [pump.z]}}}\n",
    )
    write(
        "b.yaml",
        "extends: sub/a.yaml\nrecord: {signals+: [level.v, pump.s]}\nblocks: {level: {parameters: {area+: [3]}}}\n",
    )
    assert signals("b.yaml") == ["level.h", "pump.q", "pump.r", "level.v", "pump.s"]
    level = load("b.yaml").blocks["level"]
    assert plain(level.inputs)["other"] == ["pump.q", "level.h", "pump.z"]
    assert plain(level.parameters)["area"] == [1, 2, 3]
    assert level.parameters["area"].value[2].position.file == "b.yaml"
    assert signals("base.yaml") == ["level.h", "pump.q"]


def test_a_list_that_is_replaced_is_added_to_afterwards(folder):
    write("a.yaml", "extends: base.yaml\nrecord: {signals+: [pump.r], signals: [level.v]}\n")
    assert signals("a.yaml") == ["level.v", "pump.r"]
    assert signals(write("b.yaml", "extends: a.yaml\nrecord: {signals: [level.h]}\n")) == ["level.h"]


def test_a_setting_adds_too(folder):
    assert signals("base.yaml", "record.signals+=[pump.r]", "record.signals+=[pump.s]")[2:] == ["pump.r", "pump.s"]
    level = load("base.yaml", ["blocks.level.parameters.area+=[5]"]).blocks["level"]
    assert plain(level.parameters)["area"] == [1, 2, 5]


def test_lists_of_blocks_in_a_diagram_that_is_a_block(folder):
    write("inner.yaml", INNER.replace("{gain: 1}", "{gain: [1]}"))
    middle = "run: {stop: 1, step: 1}\nblocks: {in: {diagram: inner.yaml}, in/valve: {parameters: {gain+: [2]}}}\n"
    write("middle.yaml", middle)
    write("over.yaml", "extends: middle.yaml\nblocks: {in/valve: {parameters: {gain+: [3]}}}\n")
    write("outer.yaml", HEAD + "blocks: {m: {diagram: over.yaml}, m/in/valve: {parameters: {gain+: [4]}}}\n")
    assert plain(load("middle.yaml").blocks["in/valve"].parameters) == {"gain": [1, 2]}
    assert plain(load("over.yaml").blocks["in/valve"].parameters) == {"gain": [1, 2, 3]}
    assert plain(load("outer.yaml").blocks["m/in/valve"].parameters) == {"gain": [1, 2, 3, 4]}
    write("again.yaml", "extends: over.yaml\nblocks: {in/valve: {parameters: {gain: [9]}}}\n")
    assert plain(load("again.yaml").blocks["in/valve"].parameters) == {"gain": [9]}


WRONG = [
    ("record: {signals+: pump.r}", WrongValue, "this is the text `pump.r`", "write signals+: [pump.r]"),
    ("run: {order+: [pump]}", WrongValue, "`run.order+` adds to the list `order` of an overlay's base", "`order:`"),
    ("run: {stop+: [pump]}", WrongValue, "`stop` is the text `3*10`", "as a whole"),
    ("run: {stopp+: [1]}", UnknownKey, "has no key `stopp+`", "did you mean `stop`?"),
    ("blocks+: [1]", WrongValue, "`blocks` is a mapping", "write `blocks:`"),
    ("blocks: {level: {parameters: {arae+: [1]}}}", WrongValue, "there is none", "correct the name"),
]


@pytest.mark.parametrize(("line", "kind", "said", "fix"), WRONG)
def test_what_cannot_be_added_to_is_a_mistake_at_its_place(folder, line, kind, said, fix):
    error = mistake(write("a.yaml", f"extends: base.yaml\n{line}\n"))
    assert type(error) is kind and said in error.message and fix in error.fix
    assert str(error.position).startswith("a.yaml:2:")


def test_nothing_is_added_where_nothing_lies_below(folder):
    error = mistakes(write("a.yaml", HEAD + "blocks: {b: {block: B}}\nrecord: {signals+: [b.x]}\n"))[0]
    assert type(error) is WrongValue and "there is none" in error.message


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("record.signals+=pump.r", "a list is added to a list"),
        ("run.stop+=[1]", "`run.stop` is the text `3*10`"),
        ("run.order+=[pump]", "`run.order` is not there"),
        ("record.signal+=[pump.r]", "has no `signal`"),
    ],
)
def test_a_setting_that_cannot_add(folder, setting, said):
    error = mistake("base.yaml", [setting])
    assert type(error) is UnknownSetting and said in error.message
