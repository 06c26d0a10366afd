"""Diagrams as YAML says them: layers, settings, swaps, diagrams in diagrams, mistakes with place and fix."""

import os
import re
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.diagram import load
from cosim.errors import (
    CircularExtends,
    CosimError,
    DiagramErrors,
    DuplicateKey,
    ExpressionError,
    MetricError,
    MissingFile,
    MissingKey,
    Position,
    Problems,
    TwoDrivers,
    UnknownKey,
    UnknownParameter,
    UnknownPort,
    UnknownSetting,
    WrongType,
    WrongValue,
    YamlSyntaxError,
)

BASE = """\
title: Two tanks
run: {stop: "3*10", step: 1e-3}
fleets: {tank: 2}
blocks:
  level:
    block: Tank
    per: tank
    parameters: {area: [1, 2], leak: "0.1*i"}
    start: {h: [0.5, "pi/3"]}
    inputs: {inflow: pump.q, other: [pump.q, level.h]}
    dimensions: {n: "2*1"}
    integrator: rk4
    inner_steps: 4
  pump:
    python: mine.py:Pump
    period: 0.01
    inputs: {h: level.h}
record: {period: 0.01, signals: [level.h, pump.q]}
metrics:
  highest: {signal: level.h, reduce: max, from: 10, to: 20}
  last: {signal: pump.q, reduce: final}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with base.yaml, which is the current one."""
    monkeypatch.chdir(tmp_path)
    Path("base.yaml").write_text(BASE)
    return tmp_path


def write(name, text):
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return name


def mistakes(*args, **more):
    with pytest.raises(DiagramErrors) as caught:
        load(*args, **more)
    assert all(error.fix for error in caught.value.errors)
    return caught.value.errors


def mistake(*args, **more):
    (error,) = mistakes(*args, **more)
    return error


def plain(entries):
    return {name: node.plain() for name, node in entries.items()}


# ---- a file as it stands


def test_a_whole_diagram(folder):
    diagram = load("base.yaml")
    assert diagram.title == "Two tanks"
    assert diagram.path == Path("base.yaml")
    assert diagram.files == [Path("base.yaml")]
    run = diagram.run
    assert (run.stop, run.step, run.method, run.integrator, run.inner_steps) == (30.0, 1e-3, "jacobi", "euler", 1)
    assert run.steps == 30_000
    assert run.nodes["step"].position == Position("base.yaml", 2, 27)
    assert diagram.fleets == {"tank": 2}
    level = diagram.blocks["level"]
    assert (level.kind, level.type.value, level.per.value) == ("block", "Tank", "tank")
    assert level.position == Position("base.yaml", 5, 3)
    assert level.type.position == Position("base.yaml", 6, 12)
    assert plain(level.parameters) == {"area": [1, 2], "leak": "0.1*i"}
    assert plain(level.start) == {"h": [0.5, "pi/3"]}
    assert plain(level.inputs) == {"inflow": "pump.q", "other": ["pump.q", "level.h"]}
    assert plain(level.dimensions) == {"n": 2}
    assert (level.integrator.value, level.inner_steps.value, level.period) == ("rk4", 4, None)
    pump = diagram.blocks["pump"]
    assert (pump.kind, pump.directory, pump.path, pump.period.value) == ("python", Path(), Path("mine.py"), 0.01)
    assert (diagram.record.period, [n.value for n in diagram.record.signals]) == (0.01, ["level.h", "pump.q"])
    highest, last = diagram.metrics.values()
    assert (highest.signal.value, highest.reduce, highest.start, highest.stop) == ("level.h", "max", 10.0, 20.0)
    assert (last.name, last.start, last.stop) == ("last", 0.0, float("inf"))
    assert last.position == Position("base.yaml", 21, 3)


def test_the_least_that_is_a_diagram(folder):
    diagram = load(write("a.yaml", "run: {stop: 1, step: 1}\nblocks: {b: {block: B}}\n"))
    assert (diagram.title, diagram.record, diagram.metrics, diagram.fleets) == ("a", None, {}, {})


def test_a_recording_without_period_is_of_each_step(folder):
    text = "run: {stop: 1, step: 0.5}\nblocks: {b: {block: B}}\nrecord: {signals: [b.x]}\n"
    assert load(write("a.yaml", text)).record.period == 0.5


def test_nothing_stands_for_not_said(folder):
    diagram = load(
        write("a.yaml", "extends: base.yaml\nrecord:\nblocks: {level: {start: , inputs: {other: ~}}, pump: ~}\n")
    )
    assert diagram.record is None
    assert list(diagram.blocks) == ["level"]
    assert diagram.blocks["level"].start == {}
    assert plain(diagram.blocks["level"].inputs) == {"inflow": "pump.q"}


def test_an_fmu_has_keys_of_its_own(folder):
    text = "{fmu: sub/tank.fmu, ports: {h: tank.level}, isolate: true, mode: model-exchange}"
    tank = load(write("d/a.yaml", f"run: {{stop: 1, step: 1}}\nblocks: {{t: {text}}}\n")).blocks["t"]
    assert (tank.kind, tank.directory, tank.path) == ("fmu", Path("d"), Path("d/sub/tank.fmu"))
    assert (plain(tank.ports), tank.isolate.value, tank.mode.value) == ({"h": "tank.level"}, True, "model-exchange")


def test_loading_is_quick(folder):
    blocks = "".join(f"  b{k}:\n    block: B\n    parameters: {{m: [1, 2, 3, 4, 5, 6]}}\n" for k in range(40))
    write("a.yaml", f"run: {{stop: 1, step: 1}}\nblocks:\n{blocks}")
    load("a.yaml")
    seconds = []
    for _ in range(5):
        began = time.perf_counter()
        load("a.yaml")
        seconds.append(time.perf_counter() - began)
    assert min(seconds) < 0.015


# ---- mistakes in one file

HEAD = "run: {stop: 1, step: 0.1}\n"
BLOCKS = "blocks: {b: {block: B}}\n"
ONE = HEAD + BLOCKS

WRONG = [
    ("run: {stop: 1, stepp: 0.1}\n" + BLOCKS, UnknownKey, 1, 16, "did you mean `step`?"),
    (ONE + "rekord: {signals: []}\n", UnknownKey, 3, 1, "did you mean `record`?"),
    (ONE + "metrics: {m: {signal: b.x, reduce: max, form: 1}}\n", UnknownKey, 3, 41, "did you mean `from`?"),
    (HEAD + "blocks: {b: {block: B, paramters: {}}}\n", UnknownKey, 2, 24, "did you mean `parameters`?"),
    (HEAD + "blocks: {b: {block: B, ports: {}}}\n", UnknownKey, 2, 24, "it goes with `fmu:`"),
    (HEAD + "blocks: {b: {block: B, isolate: true}}\n", UnknownKey, 2, 24, "it goes with `fmu:`"),
    (HEAD, MissingKey, 1, 1, "write `blocks:`"),
    (BLOCKS, MissingKey, 1, 1, "write run: {stop: 30}"),
    (HEAD + "blocks: {b: {}}\n", MissingKey, 2, 10, "write `block: ClassName`"),
    (HEAD + "blocks: {b: {block: B, fmu: b.fmu}}\n", WrongValue, 2, 24, "remove one of them"),
    (HEAD + "blocks: {b: B}\n", WrongType, 2, 13, "write lines of `key: value`"),
    (HEAD + "blocks: {b: {block: 5}}\n", WrongType, 2, 21, "put it between quotation marks"),
    (HEAD + "blocks: {b: {block: B, per: [6]}}\n", WrongType, 2, 29, "put it between quotation marks"),
    (HEAD + "blocks: {b.c: {block: B}}\n", WrongValue, 2, 10, "letters, digits, _ and -"),
    (HEAD + "blocks: {b: {block: B, parameters: {m: {x: 1}}}}\n", WrongType, 2, 40, "a list such as [1, 2]"),
    (HEAD + "blocks: {b: {block: B, parameters: {m: [1, ~]}}}\n", WrongType, 2, 44, "a list such as [1, 2]"),
    (HEAD + "blocks: {b: {block: B, inputs: {u: x}}}\n", WrongValue, 2, 36, "write block.port"),
    (HEAD + "blocks: {b: {block: B, inputs: {u: [b.x, 5]}}}\n", WrongValue, 2, 42, "write block.port"),
    (HEAD + "blocks: {b: {block: B, period: 0.25}}\n", WrongValue, 2, 32, "such as 0.2"),
    (HEAD + "blocks: {b: {block: B, integrator: rk5}}\n", WrongValue, 2, 36, "did you mean `rk4`?"),
    (HEAD + "blocks: {b: {block: B, inner_steps: 0}}\n", WrongValue, 2, 37, "such as 1, 2, 3"),
    (HEAD + "blocks: {b: {block: B, dimensions: {n: 1.5}}}\n", WrongValue, 2, 40, "such as 1, 2, 3"),
    (HEAD + "blocks: {b: {fmu: b, mode: exchange}}\n", WrongValue, 2, 28, "did you mean `model-exchange`?"),
    (HEAD + "blocks: {b: {fmu: b, isolate: yes}}\n", WrongType, 2, 31, "write true or false"),
    ("run: {stop: 1, step: 0}\n" + BLOCKS, WrongValue, 1, 22, "such as 0.001"),
    ("run: {stop: -1, step: 1}\n" + BLOCKS, WrongValue, 1, 13, "such as 0.001"),
    ("run: {stop: 1, step: 0.3}\n" + BLOCKS, WrongValue, 1, 13, "such as 0.9"),
    ("run: {stop: 1, step: 3}\n" + BLOCKS, WrongValue, 1, 13, "such as 3"),
    ("run: {stop: 1e300, step: 1e-300}\n" + BLOCKS, WrongValue, 1, 13, "choose a larger `run.step`"),
    ("run: {stop: .inf, step: 1}\n" + BLOCKS, WrongValue, 1, 13, "write a number"),
    ("run: {stop: [1], step: 1}\n" + BLOCKS, WrongType, 1, 13, "write a number"),
    ("run: {stop: true, step: 1}\n" + BLOCKS, WrongType, 1, 13, "write a number"),
    ('run: {stop: "2*pie", step: 1}\n' + BLOCKS, ExpressionError, 1, 13, "did you mean `pi`?"),
    ("run: {stop: 1, step: 1, method: jacoby}\n" + BLOCKS, WrongValue, 1, 33, "did you mean `jacobi`?"),
    ("run: {stop: 1, step: 1, integrator: [x]}\n" + BLOCKS, WrongValue, 1, 37, "one of: euler, rk4"),
    ("run: 5\n" + BLOCKS, WrongType, 1, 6, "write lines of `key: value`"),
    (ONE + "title: 5\n", WrongType, 3, 8, "put it between quotation marks"),
    (ONE + "fleets: {robot: 2.5}\n", WrongValue, 3, 17, "such as 1, 2, 3"),
    (ONE + "fleets: {robot: 0}\n", WrongValue, 3, 17, "such as 1, 2, 3"),
    (ONE + "record: {period: 0.25}\n", WrongValue, 3, 18, "such as 0.2"),
    (ONE + "record: {signals: b.x}\n", WrongType, 3, 19, "such as signals: [plant.x]"),
    (ONE + "record: {signals: [b]}\n", WrongValue, 3, 20, "write block.port"),
    (ONE + "metrics: {m: {reduce: max}}\n", MissingKey, 3, 11, "write signal: block.port"),
    (ONE + "metrics: {m: {signal: b.x}}\n", MissingKey, 3, 11, "one of: max, min"),
    (ONE + "metrics: {m: {signal: b.x, reduce: maxx}}\n", WrongValue, 3, 36, "did you mean `max`?"),
    (ONE + "metrics: {m: {signal: x, reduce: max}}\n", WrongValue, 3, 23, "write block.port"),
    (
        ONE + "metrics: {m: {signal: b.x, reduce: max, from: 2, to: 1}}\n",
        MetricError,
        3,
        54,
        "exchange `from` and `to`",
    ),
    (ONE + "title: a\ntitle: b\n", DuplicateKey, 4, 1, "remove one of the two"),
    (ONE + "title: [\n", YamlSyntaxError, 4, 1, "close the bracket"),
    ("- 1\n", WrongType, 1, 1, "write lines of `key: value`"),
    ("", WrongType, 1, 1, "write lines of `key: value`"),
]


@pytest.mark.parametrize(("text", "kind", "line", "column", "fix"), WRONG)
def test_a_mistake(folder, text, kind, line, column, fix):
    found = mistakes(write("a.yaml", text))
    error = found[0]
    assert type(error) is kind
    assert error.position == Position("a.yaml", line, column)
    assert fix in error.fix
    # A diagram without `run` lacks two keys; all others are one mistake.
    assert len(found) == (2 if text == BLOCKS else 1)


def test_all_mistakes_of_a_file_in_one_go_and_in_the_order_of_their_places(folder):
    text = "run: {stop: 1, step: 0, method: x}\nblocks:\n"
    text += "  b: {blok: B, paramters: {m: {}}}\n  c: {block: C}\n  c: {}\nx: 1\n"
    found = mistakes(write("a.yaml", text))
    assert [(type(e), e.position.line) for e in found] == [
        (WrongValue, 1),
        (WrongValue, 1),
        (UnknownKey, 3),
        (UnknownKey, 3),
        (WrongType, 3),
        (DuplicateKey, 5),
        (UnknownKey, 6),
    ]


def test_with_problems_the_diagram_is_returned_as_far_as_it_goes(folder):
    problems = Problems()
    write("a.yaml", HEAD + "blocks: {b: {block: B, paramters: {m: 1}, period: 0.25}, c: {}}\n")
    diagram = load("a.yaml", problems=problems)
    assert [type(e) for e in problems.errors] == [UnknownKey, MissingKey, WrongValue]
    assert plain(diagram.blocks["b"].parameters) == {"m": 1}
    assert diagram.blocks["b"].period is None
    assert list(diagram.blocks) == ["b"]
    assert diagram.unread == {"c"}


def test_a_missing_file(folder):
    error = mistake("bass.yaml")
    assert type(error) is MissingFile
    assert error.fix == "did you mean `base.yaml`?"


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
    assert (level.kind, level.type.value, level.per.value) == ("fmu", "tank.fmu", "tank")
    assert level.position == Position("a.yaml", 3, 3)
    assert {n: node.inherited for n, node in level.parameters.items()} == {"area": True, "leak": False, "new": False}
    assert {n: node.inherited for n, node in level.start.items()} == {"h": True, "v": False}
    assert {n: node.inherited for n, node in level.inputs.items()} == {"inflow": True, "other": True}
    assert level.integrator.inherited
    assert not level.per.inherited


def test_the_same_type_again_marks_nothing(folder):
    level = load(write("a.yaml", "extends: base.yaml\nblocks: {level: {block: Tank}}\n")).blocks["level"]
    assert not level.parameters["area"].inherited


def test_keys_of_the_old_kind_go_with_it(folder):
    write("a.yaml", HEAD + "blocks: {t: {fmu: t.fmu, ports: {a: b}, mode: co-simulation}}\n")
    tank = load("a.yaml", swaps=["t=Tank"]).blocks["t"]
    assert (tank.kind, tank.ports, tank.mode) == ("block", {}, None)


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
        "blocks.level.inputs.inflow=",
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
    assert (plain(level.start), level.inner_steps.value) == ({"h": 1e-3}, 2)
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
    ("extends=base.yaml", UnknownSetting, "one of: blocks"),
    ("run.stop", UnknownSetting, "write --set run.stop=10"),
    ("=3", UnknownSetting, "one of: blocks"),
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


# ---- diagrams in diagrams

INNER = """\
run: {stop: 1, step: 1}
inputs: {demand: [valve.u, sum.a], spare: []}
outputs: {level: tank.h}
blocks:
  valve: {block: Valve, parameters: {gain: 1}}
  tank: {block: Tank, inputs: {q: valve.q}, start: {h: 0}}
  sum: {block: Sum, inputs: {b: [tank.h, valve.q]}}
"""
OUTER = """\
run: {stop: 1, step: 0.1}
fleets: {plant: 2}
blocks:
  source: {block: Source, inputs: {h: plant.level}}
  plant:
    diagram: sub/inner.yaml
    per: plant
    inputs: {demand: source.y}
    parameters: {valve.gain: 2, tank.area: [1, 2]}
    start: {tank.h: 5}
  second: {diagram: sub/inner.yaml, inputs: {demand: plant.level}}
record: {signals: [plant.level, plant/valve.q]}
metrics: {m: {signal: second.level, reduce: max}}
outputs: {h: plant.level}
inputs: {d: source.u}
"""


@pytest.fixture
def nested(folder):
    write("sub/inner.yaml", INNER)
    write("outer.yaml", OUTER)


def test_a_diagram_in_a_diagram_is_unfolded(nested):
    diagram = load("outer.yaml")
    inner = ["valve", "tank", "sum"]
    assert list(diagram.blocks) == ["source", *(f"plant/{n}" for n in inner), *(f"second/{n}" for n in inner)]
    assert all(entry.name == name for name, entry in diagram.blocks.items())
    wires = {name: plain(entry.inputs) for name, entry in diagram.blocks.items()}
    assert wires["source"] == {"h": "plant/tank.h"}
    assert wires["plant/valve"] == {"u": "source.y"}
    assert wires["plant/tank"] == {"q": "plant/valve.q"}
    assert wires["plant/sum"] == {"a": "source.y", "b": ["plant/tank.h", "plant/valve.q"]}
    assert wires["second/valve"] == {"u": "plant/tank.h"}
    assert plain(diagram.blocks["plant/valve"].parameters) == {"gain": 2}
    assert plain(diagram.blocks["plant/tank"].parameters) == {"area": [1, 2]}
    assert plain(diagram.blocks["plant/tank"].start) == {"h": 5}
    assert plain(diagram.blocks["second/valve"].parameters) == {"gain": 1}
    assert {entry.per and entry.per.value for entry in diagram.blocks.values()} == {None, "plant"}
    assert diagram.blocks["plant/tank"].per.value == "plant"
    assert [n.value for n in diagram.record.signals] == ["plant/tank.h", "plant/valve.q"]
    assert diagram.metrics["m"].signal.value == "second/tank.h"
    assert diagram.outputs["h"].value == "plant/tank.h"
    assert [n.value for n in diagram.inputs["d"]] == ["source.u"]
    assert diagram.files == [Path("outer.yaml"), Path("sub/inner.yaml")]
    assert diagram.run.step == 0.1


def test_two_levels(nested):
    write(
        "top.yaml",
        HEAD + "blocks:\n  o: {diagram: outer.yaml, inputs: {d: s.y}, parameters: {plant/valve.gain: 7}}\n"
        "  s: {block: S, inputs: {x: o.h}}\n",
    )
    diagram = load("top.yaml")
    assert "o/plant/tank" in diagram.blocks
    assert plain(diagram.blocks["s"].inputs) == {"x": "o/plant/tank.h"}
    assert plain(diagram.blocks["o/source"].inputs) == {"h": "o/plant/tank.h", "u": "s.y"}
    assert plain(diagram.blocks["o/plant/valve"].parameters) == {"gain": 7}


def test_blocks_inside_can_be_set_and_swapped(nested):
    diagram = load(
        "outer.yaml",
        ["blocks.plant/tank.parameters.area=3", "blocks.plant.parameters.valve.gain=4"],
        ["plant/valve=Other"],
    )
    valve, tank = diagram.blocks["plant/valve"], diagram.blocks["plant/tank"]
    assert (valve.type.value, tank.type.value) == ("Other", "Tank")
    assert plain(valve.parameters) == {"gain": 4}
    assert valve.type.position == Position("--swap plant/valve=Other")
    assert diagram.blocks["second/valve"].type.value == "Valve"


def test_a_swap_for_a_diagram_drops_what_it_does_not_have(nested):
    write("a.yaml", HEAD + "blocks:\n  p: {block: P, period: 0.1, parameters: {m: 1}, inputs: {demand: p.x, u: p.x}}\n")
    diagram = load("a.yaml", swaps=["p=sub/inner.yaml"], problems=(problems := Problems()))
    assert [type(e) for e in problems.errors] == [UnknownPort]
    assert list(diagram.blocks) == ["p/valve", "p/tank", "p/sum"]
    assert plain(diagram.blocks["p/valve"].parameters) == {"gain": 1}


NESTED_WRONG = [
    ("inputs: {demand: source.y}", "inputs: {demnd: source.y}", UnknownPort, 8, "did you mean `demand`?"),
    ("valve.gain: 2", "vlave.gain: 2", UnknownParameter, 9, "did you mean `valve`?"),
    ("valve.gain: 2", "gain: 2", UnknownParameter, 9, "write inner.gain, where inner is a block of the diagram"),
    ("{h: plant.level}}", "{h: plant.levle}}", UnknownPort, 4, "did you mean `level`?"),
    ("signals: [plant.level", "signals: [plant.h", UnknownPort, 12, "one of: level"),
    ("sub/inner.yaml\n", "sub/iner.yaml\n", MissingFile, 6, "did you mean `inner.yaml`?"),
    ("sub/inner.yaml\n", "outer.yaml\n", CircularExtends, 6, "name another diagram here"),
    ("    per: plant", "    period: 1", UnknownKey, 7, "remove it; it goes with `block:`, `python:`, `fmu:`"),
]


@pytest.mark.parametrize(("old", "new", "kind", "line", "fix"), NESTED_WRONG)
def test_a_mistake_about_a_diagram_in_a_diagram(nested, old, new, kind, line, fix):
    assert OUTER.count(old) >= 1
    error = mistake(write("outer.yaml", OUTER.replace(old, new, 1)))
    assert type(error) is kind
    assert (error.position.file, error.position.line) == ("outer.yaml", line)
    assert error.fix == fix


@pytest.mark.parametrize(
    ("old", "new", "kind", "line", "fix"),
    [
        ("[valve.u,", "[vlave.u,", UnknownPort, 2, "did you mean `valve`?"),
        ("[valve.u,", "[sum.b,", TwoDrivers, 2, "remove one of them"),
        ("{block: Valve,", "{block: Valve, per: x,", WrongValue, 5, "remove it here, or in `plant`"),
        ("{block: Valve,", "{blok: Valve,", UnknownKey, 5, "did you mean `block`?"),
    ],
)
def test_a_mistake_inside_a_diagram_in_a_diagram(nested, old, new, kind, line, fix):
    write("sub/inner.yaml", INNER.replace(old, new))
    error, *more = mistakes("outer.yaml")
    assert {type(e) for e in more} <= {kind}
    assert type(error) is kind
    assert (error.position.file, error.position.line) == ("sub/inner.yaml", line)
    assert error.fix == fix


# ---- resolved


def same(a, b):
    """Whether two diagrams say the same, places aside."""
    views = []
    for diagram in (a, b):
        blocks = {name: entry.plain(diagram.path.parent) for name, entry in diagram.blocks.items()}
        views.append((diagram.resolved(), blocks, list(diagram.blocks), diagram.fleets, diagram.title))
    return views[0] == views[1]


@pytest.mark.parametrize("name", ["base.yaml", "outer.yaml", "sub/over.yaml"])
def test_the_resolved_text_loads_to_the_same_diagram(nested, name):
    write("sub/over.yaml", "extends: ../base.yaml\nblocks: {level: {fmu: x.fmu, ports: {a: '1e-3'}, isolate: true}}\n")
    diagram = load(name, swaps=["source=other/mine.py:S"] if name == "outer.yaml" else [])
    text = diagram.resolved()
    assert os.getcwd() not in text
    copy = load(write(str(Path(name).with_name("copy.yaml")), text))
    assert same(diagram, copy)
    assert {n: e.path for n, e in diagram.blocks.items() if e.kind != "block"} == {
        n: e.path for n, e in copy.blocks.items() if e.kind != "block"
    }
    assert copy.run.steps == diagram.run.steps


def test_the_resolved_text_has_paths_relative_to_the_folder(nested):
    write("sub/over.yaml", "extends: ../base.yaml\nblocks: {level: {fmu: x.fmu}}\n")
    text = load("sub/over.yaml").resolved()
    assert "python: ../mine.py:Pump" in text
    assert "fmu: x.fmu" in text
    assert "extends" not in text


# ---- any mutation


@st.composite
def mutations(draw, text):
    """The text with a line or a token deleted, doubled or replaced by another."""
    parts = text.splitlines(keepends=True) if draw(st.booleans()) else _tokens(text)
    k = draw(st.integers(0, len(parts) - 1))
    other = draw(
        st.sampled_from([*parts, "- ", ": ", "{", "]", "&a ", "*a", "<<", "'", "\t", "~", "1e999", ".nan", "\0", "é"])
    )
    return "".join(
        [*parts[:k], *draw(st.sampled_from([[], [parts[k]] * 2, [other], [parts[k], other]])), *parts[k + 1 :]]
    )


def _tokens(text):
    return re.findall(r"\w+|\s+|[^\w\s]", text)


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from([BASE, INNER, OUTER]).flatmap(mutations))
def test_any_mutation_loads_or_raises_a_typed_error(nested, text):
    Path("mutant.yaml").write_text(text, encoding="utf-8")
    try:
        diagram = load("mutant.yaml")
    except CosimError as error:
        assert isinstance(error, DiagramErrors)
        assert all(e.position and e.message for e in error.errors)
    else:
        copy = load(write("copy.yaml", diagram.resolved()))
        assert same(diagram, copy)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.text("abcdefghilmnoprstuvk.=0123[]{}:,~ ", max_size=12),
    st.sampled_from(["", "blocks.level.", "run.", "blocks."]),
)
def test_any_setting_loads_or_raises_a_typed_error(folder, text, lead):
    try:
        load("base.yaml", [lead + text], [text])
    except DiagramErrors as error:
        assert all(e.position and e.message for e in error.errors)
