"""What changes a diagram: overlays, settings, swaps."""

from pathlib import Path

import pytest

from cosim.errors import (
    CircularExtends,
    DuplicateKey,
    MissingFile,
    Position,
    UnknownSetting,
    WrongType,
    WrongValue,
    YamlSyntaxError,
)
from cosim.language.diagram import load
from tests.language.files import HEAD, mistake, mistakes, plain, write

# ---- extends


def test_mappings_merge_and_everything_else_is_replaced(folder):
    write("sub/a.yaml", "extends: ../base.yaml\nblocks:\n  level: {parameters: {area: [3]}}\n  new: {block: New}\n")
    diagram = load(write("sub/b.yaml", "extends: a.yaml\nrun: {stop: 1}\nfleets: {tank: 1}\n"))
    assert diagram.files == [Path("sub/b.yaml"), Path("sub/a.yaml"), Path("base.yaml")]
    assert (diagram.run.stop, diagram.run.step, diagram.fleets) == (1.0, 1e-3, {"tank": 1})
    level = diagram.blocks["level"]
    assert plain(level.parameters) == {"area": [3], "leak": "0.1*i"}
    assert level.parameters["area"].position == Position("sub/a.yaml", 3, 30)
    assert level.parameters["leak"].position.file == "base.yaml"
    assert level.position == Position("base.yaml", 5, 3)
    assert list(diagram.blocks) == ["level", "pump", "new"]
    assert not any(node.inherited for node in level.parameters.values())


def test_paths_belong_to_the_file_that_says_them(folder):
    diagram = load(write("sub/a.yaml", "extends: ../base.yaml\nblocks: {new: {python: mine.py:New}}\n"))
    assert diagram.blocks["pump"].path == Path("mine.py")
    assert diagram.blocks["new"].path == Path("sub/mine.py")


def test_another_type_marks_what_was_written_for_the_old_one(folder):
    write(
        "a.yaml",
        "extends: base.yaml\nblocks:\n  level: {fmu: tank.fmu, parameters: {leak: 2, new: 3}, start: {v: 1}}\n",
    )
    level = load("a.yaml").blocks["level"]
    assert (level.kind, level.type.value, level.settings["per"].value) == ("fmu", "tank.fmu", "tank")
    assert level.position == Position("a.yaml", 3, 3)
    assert {n: node.inherited for n, node in level.parameters.items()} == {"area": True, "leak": False, "new": False}
    assert {n: node.inherited for n, node in level.start.items()} == {"h": True, "v": False}
    assert {n: node.inherited for n, node in level.inputs.items()} == {"inflow": True, "other": True}
    assert level.settings["integrator"].inherited
    assert not level.settings["per"].inherited


def test_the_same_type_again_marks_nothing(folder):
    level = load(write("a.yaml", "extends: base.yaml\nblocks: {level: {block: Tank}}\n")).blocks["level"]
    assert not level.parameters["area"].inherited


def test_keys_of_the_old_kind_go_with_it(folder):
    write("a.yaml", HEAD + "blocks: {t: {fmu: t.fmu, ports: {a: b}, mode: co-simulation}}\n")
    tank = load("a.yaml", swaps=["t=Tank"]).blocks["t"]
    assert (tank.kind, tank.ports, tank.settings.get("mode")) == ("block", {}, None)


@pytest.mark.parametrize("chain", [["a"], ["a", "b"], ["c", "a", "b"]])
def test_an_overlay_that_extends_itself(folder, chain):
    for name, below in zip(chain, [*chain[1:], "./a"], strict=True):
        write(f"{name}.yaml", f"title: x\nextends: {below}.yaml\n")
    error = mistake(f"{chain[0]}.yaml")
    assert type(error) is CircularExtends
    assert error.position == Position(f"{chain[-1]}.yaml", 2, 10)
    assert "a.yaml → " in error.message
    assert error.fix == "remove this `extends`"


def test_extends_a_missing_file(folder):
    error = mistake(write("a.yaml", "extends: bass.yaml\n"))
    assert type(error) is MissingFile
    assert (error.position, error.fix) == (Position("a.yaml", 1, 10), "did you mean `base.yaml`?")


def test_extends_no_file(folder):
    error = mistake(write("a.yaml", "extends: [base.yaml]\n"))
    assert type(error) is WrongType
    assert error.position == Position("a.yaml", 1, 10)


# ---- --set


def test_settings(folder):
    given_settings = [
        "run.stop=2*5",
        "run.method=joint",
        "fleets.tank=3",
        "blocks.level.parameters.area.1=5",
        "blocks.level.parameters.new=[1, 2]",
        "blocks.level.start.h=1e-3",
        "blocks.level.inputs.inflow=~",
        "blocks.pump.parameters={k: 1}",
        "blocks.level.inner_steps=2",
        "blocks.new={block: New}",
        "record.signals.1=level.other",
        "metrics.last.reduce=min",
        "title=a=b",
    ]
    diagram = load("base.yaml", given_settings)
    level = diagram.blocks["level"]
    assert (diagram.run.stop, diagram.run.method, diagram.fleets) == (10.0, "joint", {"tank": 3})
    assert plain(level.parameters) == {"area": [1, 5], "leak": "0.1*i", "new": [1, 2]}
    assert level.parameters["new"].position == Position("--set blocks.level.parameters.new=[1, 2]")
    assert str(level.parameters["new"].position) == "--set blocks.level.parameters.new=[1, 2]"
    assert level.parameters["area"].value[0].position.line == 8
    assert level.position == Position("base.yaml", 5, 3)
    assert (plain(level.start), level.settings["inner_steps"].value) == ({"h": 1e-3}, 2)
    assert "inflow" not in level.inputs
    assert plain(diagram.blocks["pump"].parameters) == {"k": 1}
    assert diagram.blocks["new"].type.value == "New"
    assert diagram.record.signals[1].value == "level.other"
    assert diagram.metrics["last"].reduce == "min"
    assert diagram.title == "a=b"
    assert plain(load("base.yaml").blocks["level"].parameters)["area"] == [1, 2]


def test_a_setting_changes_nothing_that_shares_an_alias(folder):
    write("a.yaml", HEAD + "blocks:\n  b: {block: B, parameters: &p {m: [1, 2]}}\n  c: {block: C, parameters: *p}\n")
    diagram = load("a.yaml", ["blocks.b.parameters.m.0=9"])
    assert [plain(b.parameters) for b in diagram.blocks.values()] == [{"m": [9, 2]}, {"m": [1, 2]}]


def test_a_setting_of_a_type_is_a_swap(folder):
    level = load("base.yaml", ["blocks.level.fmu=tank.fmu"]).blocks["level"]
    assert (level.kind, level.path) == ("fmu", Path("tank.fmu"))
    assert level.parameters["area"].inherited


BAD_SETTINGS = [
    ("run.stepp=1", UnknownSetting, "did you mean `step`?"),
    ("runn.step=1", UnknownSetting, "did you mean `run`?"),
    ("blocks.levl.parameters.area=1", UnknownSetting, "did you mean `level`?"),
    ("blocks.level.paramters.area=1", UnknownSetting, "did you mean `parameters`?"),
    ("blocks.level.parameters.area.2=1", UnknownSetting, "its elements are 0 to 1"),
    ("blocks.level.parameters.area.x=1", UnknownSetting, "its elements are 0 to 1"),
    ("blocks.level.parameters.area.0.0=1", UnknownSetting, "set `blocks.level.parameters.area.0` as a whole"),
    ("blocks.level.parameters.aera.0=1", UnknownSetting, "did you mean `area`?"),
    ("fleets.tanks=3", UnknownSetting, "did you mean `tank`?"),
    ("metrics.lst.reduce=min", UnknownSetting, "did you mean `last`?"),
    ("run.stop.x=3", UnknownSetting, "set `run.stop` as a whole"),
    ("extends=base.yaml", UnknownSetting, "one of: animation, blocks"),
    ("run.stop", UnknownSetting, "write --set run.stop=10"),
    ("run.stop=", WrongValue, "or =~ to take it away"),
    ("=3", UnknownSetting, "one of: animation, blocks"),
    ("run.stop=[1", YamlSyntaxError, "close the bracket"),
    ("blocks.level.start={h: 1, h: 2}", DuplicateKey, "remove one of the two"),
    ("run.step=0", WrongValue, "such as 0.001"),
    ("run.stop=0.0015", WrongValue, "such as 0.002"),
    ("blocks=5", WrongType, "write lines of `key: value`"),
]


@pytest.mark.parametrize(("text", "kind", "fix"), BAD_SETTINGS)
def test_a_mistake_in_a_setting(folder, text, kind, fix):
    error = mistakes("base.yaml", [text])[-1]
    assert type(error) is kind
    assert error.position == Position(f"--set {text}")
    assert fix in error.fix


# ---- --swap


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("Other", "block"),
        ("other.fmu", "fmu"),
        ("x/mine.py:Other", "python"),
    ],
)
def test_swaps(folder, text, kind):
    write("sub/a.yaml", "extends: ../base.yaml\n")
    level = load("sub/a.yaml", swaps=[f"level={text}"]).blocks["level"]
    assert (level.kind, level.type.value, level.directory) == (kind, text, Path())
    assert level.type.position == Position(f"--swap level={text}")
    assert level.position == Position("base.yaml", 5, 3)
    assert all(node.inherited for node in level.parameters.values())


def test_swaps_come_before_settings(folder):
    level = load("base.yaml", ["blocks.level.parameters.new=1"], ["level=Other"]).blocks["level"]
    assert {n: node.inherited for n, node in level.parameters.items()} == {"area": True, "leak": True, "new": False}


@pytest.mark.parametrize(
    ("text", "fix"),
    [("levl=X", "did you mean `level`?"), ("level", "write --swap block=Type"), ("level=", "write --swap block=Type")],
)
def test_a_mistake_in_a_swap(folder, text, fix):
    error = mistake("base.yaml", swaps=[text])
    assert type(error) is UnknownSetting
    assert (error.position, error.fix) == (Position(f"--swap {text}"), fix)


def test_a_block_that_several_settings_miss_is_one_mistake_with_all_places(folder):
    settings = [f"blocks.lvel.{what}" for what in ("parameters.area=1", "start.h=1", "period=2")]
    error = mistake("base.yaml", settings)
    assert type(error) is UnknownSetting and str(error.position) == f"--set {settings[1 - 1]}"
    assert error.message == f"`blocks` has no `lvel`, also at --set {settings[2]}, --set {settings[1]}"
    assert "`level`" in error.fix
