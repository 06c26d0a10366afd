"""Diagrams in diagrams, and the resolved text of any."""

from pathlib import Path

import pytest

from cosim.errors import (
    CircularExtends,
    DroppedValue,
    MissingFile,
    Position,
    Problems,
    TwoDrivers,
    UnknownKey,
    UnknownParameter,
    UnknownPort,
    WrongValue,
)
from cosim.language.diagram import load
from tests.language.files import HEAD, INNER, OUTER, mistake, mistakes, plain, same, write


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
    assert {getattr(entry.settings.get("per"), "value", None) for entry in diagram.blocks.values()} == {None, "plant"}
    assert diagram.blocks["plant/tank"].settings["per"].value == "plant"
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
    load("a.yaml", swaps=["p=sub/inner.yaml"], problems=(problems := Problems()))
    assert [type(e) for e in problems.errors] == [DroppedValue, UnknownPort]
    assert all(f"{n} at a.yaml:3:" in problems.errors[0].message for n in ("parameters.m", "inputs.u", "period"))
    waiver = ["blocks.p.drop=[m, u, period]"]
    diagram = load("a.yaml", waiver, swaps=["p=sub/inner.yaml"], problems=(problems := Problems()))
    assert [type(e) for e in problems.errors] == [UnknownPort]
    assert str(diagram.swaps[0]) == "p: P → inner.yaml: keeps demand; drops m, inputs.u, period"
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
    (
        "    per: plant",
        "    period: 1",
        UnknownKey,
        7,
        "remove it; it goes with `block:`, `python:`, `fmu:`, `expression:`",
    ),
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


@pytest.mark.parametrize("name", ["base.yaml", "outer.yaml", "sub/over.yaml"])
def test_the_resolved_text_loads_to_the_same_diagram(nested, name):
    write("sub/over.yaml", "extends: ../base.yaml\nblocks: {level: {fmu: x.fmu, ports: {a: '1e-3'}, isolate: true}}\n")
    diagram = load(name, swaps=["source=other/mine.py:S"] if name == "outer.yaml" else [])
    text = diagram.resolved()
    assert str(Path.cwd()) not in text
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
