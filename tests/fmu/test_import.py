"""Model descriptions as declarations: ports, arrays, units, start values, kinds, names, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cosim.authoring.variables import Input, Local, Output, Parameter, State
from cosim.engine import run
from cosim.errors import DiagramErrors, FmuError, Position, UnknownPort, WrongValue
from cosim.fmu import description, importer, inspect
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from tests.fmu import machine

HERE = Position("diagram.yaml", 1, 1)
ARRAYS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="arrays" guid="machine">
<CoSimulation modelIdentifier="machine"/>
<UnitDefinitions><Unit name="m"/><Unit name="rad"/><Unit name="furlong"/></UnitDefinitions>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"""


def declared(path, **entry):
    """The declaration of an FMU, named by an entry with these keys."""
    nodes = {key: Node(value, HERE) for key, value in entry.items() if key != "ports"}
    ports = {name: Node(value, HERE) for name, value in entry.get("ports", {}).items()}
    return importer.block(
        BlockEntry("plant", "fmu", Node(str(path), Position("")), HERE, ports=ports, settings=nodes)
    ).declaration


@pytest.fixture
def described(tmp_path):
    """An FMU whose variables are these: (name, type, causality, attributes of the type)."""

    def build(*variables: tuple[str, str, str, str], structure: str = ""):
        rows = [
            f'<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}">'
            f"<{kind} {attributes}/></ScalarVariable>"
            for k, (name, kind, causality, attributes) in enumerate(variables)
        ]
        text = ARRAYS.format(variables="".join(rows), structure=structure)
        return machine.build(tmp_path / "arrays", 2, "cs", edit=lambda xml: text)

    return build


@pytest.mark.parametrize("kind", ["2", "3"])
def test_ports_parameters_and_states(machines, kind):
    d = declared(machines[kind], mode="model-exchange")
    assert [type(d.variables[n]) for n in ("u", "y", "T", "x", "v", "h")] == [
        Input,
        Output,
        Parameter,
        State,
        State,
        State,
    ]
    assert [v.name for v in d.continuous()] == ["x", "h", "v"] or {v.name for v in d.continuous()} == {"x", "h", "v"}
    assert d.variables["x"].causality == "output"
    assert d.variables["v"].causality == "local"
    assert isinstance(d.variables["der(x)"], Local)
    assert d.variables["u"].unit == "m"
    assert (d.variables["T"].start, d.variables["h"].start, d.variables["name"].start) == (1.0, 1.0, "nobody")
    assert d.variables["on"].dtype == bool
    assert d.variables["y"].dtype == np.float64


def test_cosimulation_is_chosen_first_and_mode_chooses(machines):
    assert declared(machines["2"]).kind("step")
    assert not declared(machines["2"]).continuous()
    assert declared(machines["2"], mode="model-exchange").kind("derivatives")


def test_feedthrough_follows_the_description(machines):
    for kind, mode in (("3e", "co-simulation"), ("2", "model-exchange"), ("3", "model-exchange")):
        d = declared(machines[kind], mode=mode)
        assert [r for r in d.writer("y").reads if isinstance(d.variables.get(r), Input)] == ["u"]
        assert [r for r in d.writer("m").reads if isinstance(d.variables.get(r), Input)] == ["n"]
        assert "u" not in d.writer("bounces").reads
    assert declared(machines["2"]).writer("y").reads == ()
    assert declared(machines["2"]).writer("y", starts=True).reads == ("u",)


def test_scalars_gather_into_arrays(described):
    a = [(f"a[{i},{j}]", "Real", "input", f'start="{10 * i + j}" unit="m"') for j in (1, 2, 3) for i in (1, 2)]
    b = [(f"b[{i}]", "Real", "output", f'unit="{u}"') for i, u in enumerate(("m", "m", "rad"), 1)]
    c = [(f"c[{i}]", "Real", "input", f'start="{i + 4}"') for i in (0, 1)]
    d = declared(described(*a, *b, *c))
    assert d.variables["a"].shape == (2, 3)
    assert d.variables["a"].start == [[11, 12, 13], [21, 22, 23]]
    assert d.variables["b"].unit == ("m", "m", "rad")
    assert d.variables["c"].start == [4, 5]
    assert d.foreign.ports["a"].references == [0, 2, 4, 1, 3, 5]


def test_what_is_no_array_stays_scalar(described):
    hole = [("h[1]", "Real", "output", ""), ("h[3]", "Real", "output", "")]
    mixed = [("m[1]", "Real", "output", ""), ("m[2]", "Integer", "output", "")]
    taken = [("t", "Real", "output", ""), ("t[1]", "Real", "output", "")]
    d = declared(described(*hole, *mixed, *taken))
    assert {"h[1]", "h[3]", "m[1]", "m[2]", "t", "t[1]"} <= set(d.variables)
    assert {v.shape for v in d.variables.values()} == {()}


def test_ports_gives_our_names(described):
    path = described(
        ("w[1]", "Real", "input", 'start="0"'), ("w[2]", "Real", "input", 'start="0"'), ("q", "Real", "output", "")
    )
    d = declared(path, ports={"u": "w", "x": "q"})
    assert list(d.variables) == ["u", "x"]
    assert d.variables["u"].shape == (2,)
    with pytest.raises(UnknownPort, match=r"has no variable `qq`\n.*did you mean `q`"):
        declared(path, ports={"x": "qq"})


def test_names_of_ports_do_not_collide(described):
    """Either would leave a variable without a name, and its wires at another."""
    path = described(("u", "Real", "input", 'start="0"'), ("v", "Real", "input", 'start="0"'))
    assert list(declared(path, ports={"v": "u", "u": "v"}).variables) == ["v", "u"]
    with pytest.raises(WrongValue, match="`a` and `b` name one variable, `u`"):
        declared(path, ports={"a": "u", "b": "u"})
    with pytest.raises(WrongValue, match="`v` is to name `u`, but the FMU has a variable `v` of its own"):
        declared(path, ports={"v": "u"})


def test_a_unit_that_we_cannot_read_is_no_unit(described):
    assert declared(described(("l", "Real", "output", 'unit="furlong"'))).variables["l"].unit is None


def test_a_swap_keeps_what_the_fmu_has_and_forgets_the_rest(machines, partners):
    path = partners("""
        run: {stop: 1, step: 0.1}
        blocks:
          source: {type: Source}
          plant: {type: Lag, inputs: {u: source.u}, parameters: {T: 2}, start: {x: 0.5}}
        """)
    for name in ("2", "3e"):
        component = run.load(path, swaps=[f"plant={machines[name]}"]).components["plant"]
        assert component.values["T"][0] == 2.0
        assert component.values["x"][0] == 0.5
        assert [str(s) for s in component.wires["u"]] == ["source.u"]
        assert component.given == {"T", "x"}


def test_names_are_checked_like_those_of_any_block(machines, partners):
    with pytest.raises(DiagramErrors) as caught:
        run.load(
            partners(f"""
            run: {{stop: 1, step: 0.1}}
            blocks:
              source: {{type: Source}}
              plant: {{fmu: {machines["2"]}, inputs: {{uu: source.u}}, parameters: {{TT: 2}}, start: {{y: 1}}}}
            """)
        )
    text = str(caught.value)
    assert "machine has no input `uu`" in text
    assert "machine has no parameter `TT`" in text
    assert "machine has no state or input to start `y`" in text


def test_an_input_that_is_left_at_its_start_value_is_a_finding(machines, partners):
    from cosim.wiring import conditions

    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.1}}
        blocks: {{plant: {{fmu: {machines["2"]}, start: {{n: 3, on: true, color: 2}}}}}}
        """)
    )
    assert "held: u = 0.0" in [f.numbers for f in conditions.conditions(network)]


@pytest.mark.parametrize(
    ("version", "kinds", "edit", "message"),
    [
        (2, "cs", lambda xml: xml.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), "FMI version 1.0; FMI 2.0 and 3.0"),
        (3, "cs", lambda xml: re.sub("CoSimulation", "ScheduledExecution", xml), "scheduled execution only"),
        (3, "cs", lambda xml: xml.replace('start="2"/>', 'start="99999999999"/>'), "`array` has the size"),
        (3, "cs", lambda xml: xml.replace('start="2"/>', 'start="-2"/>'), "`array` has the size"),
        (2, "cs", lambda xml: xml.replace('index="3"', 'index="999"'), "cannot be read"),
        (2, "me", lambda xml: xml.replace('derivative="3"', ""), "nothing says which state"),
        (2, "cs", lambda xml: xml.replace('modelIdentifier="machine"', 'modelIdentifier="other"'), "no binary `other"),
        (
            2,
            "cs",
            lambda xml: xml.replace('valueReference="3"', 'valueReference="-2"'),
            "`y` has the value reference -2",
        ),
        (
            3,
            "cs",
            lambda xml: xml.replace('valueReference="3"', f'valueReference="{1 << 40}"'),
            "`y` has the value ref",
        ),
        (
            2,
            "cs",
            lambda xml: xml.replace('Real start="1"', 'Real start="zero"'),
            "value `zero` of its variable `T` is no",
        ),
        (
            2,
            "cs",
            lambda xml: xml.replace('Boolean start="false"', 'Boolean start="no"'),
            "`no` of its variable `on` is",
        ),
        (
            2,
            "cs",
            lambda xml: xml.replace('Integer start="0"', f'Integer start="{1 << 40}"'),
            "variable `fault` is no Int",
        ),
        (2, "cs", lambda xml: xml.replace('name="y"', 'name="u"'), "2 of its variables are called `u`"),
        (3, "me", lambda xml: xml.replace('name="y"', 'name="T"'), "2 of its variables are called `T`"),
        (2, "cs", lambda xml: xml.replace('Identifier="machine"', 'Identifier="../../../evil"'), "no name of a file"),
        (3, "me", lambda xml: xml.replace('Identifier="machine"', 'Identifier="/tmp/evil"'), "no name of a file"),
        (3, "cs", lambda xml: xml.replace('Identifier="machine"', r'Identifier="a\b"'), "no name of a file"),
    ],
)
def test_what_cannot_be_run_is_refused_by_name(tmp_path, version, kinds, edit, message):
    with pytest.raises(FmuError, match=rf"`machine{version}\.fmu`.*{message}"):
        declared(machine.build(tmp_path / "refused", version, kinds, edit=edit))


def test_a_kind_that_the_fmu_is_not_made_for_is_refused(tmp_path):
    path = machine.build(tmp_path / "one", 2, "cs")
    with pytest.raises(FmuError, match=r"not made for model-exchange\n.*write mode: co-simulation"):
        declared(path, mode="model-exchange")


def test_the_library_is_refused_at_run_time_if_it_is_none(tmp_path, partners):
    import zipfile

    good = machine.build(tmp_path / "good", 2, "cs")
    bad = tmp_path / "bad.fmu"
    with zipfile.ZipFile(good) as source, zipfile.ZipFile(bad, "w") as sink:
        for name in source.namelist():
            sink.writestr(name, b"no library" if name.endswith(".so") else source.read(name))
    outcome = run.Run(run.load(partners(f"run: {{stop: 1, step: 0.1}}\nblocks: {{plant: {{fmu: {bad}}}}}"))).execute()
    assert isinstance(outcome.error, FmuError)
    assert "`bad.fmu`: its binary cannot be loaded: binaries/" in outcome.error.message
    assert str(tmp_path / "bad") not in outcome.error.message
    assert (outcome.error.position.line, outcome.error.position.column) == (2, 23)
    assert "export it again for this platform" in outcome.error.fix


def test_inspection_shows_what_a_person_asks_for(machines):
    text = inspect.text(machines["3"])
    for part in (
        "machine, FMI 3.0",
        "kind      co-simulation",
        "3 continuous states, 1 event indicators",
        "platforms x86_64-linux (runs here)",
        "array(2, 3)",
        "← u (one step later)",
        "[s]  start 1.0",
        "validation finds no problem",
    ):
        assert part in text
    assert "one step later" not in inspect.text(machines["3e"])


def test_an_fmu_for_scheduled_execution_can_be_looked_at(tmp_path):
    text = inspect.text(machine.build(tmp_path / "scheduled", 3, "se"))
    assert "scheduled execution (cannot be run here)" in text
    assert "one step later" not in text


@pytest.mark.parametrize(
    "edit",
    [
        lambda xml: xml.replace('valueReference="3"', 'valueReference="-2"'),
        lambda xml: xml.replace('Real start="1"', 'Real start="zero"'),
        lambda xml: xml.replace('Identifier="machine"', 'Identifier="../../../evil"'),
    ],
)
def test_a_description_that_makes_no_sense_is_told_by_name(tmp_path, capsys, edit):
    from cosim.terminal import cli

    assert cli.main(["fmu", str(machine.build(tmp_path / "senseless", 2, "cs", edit=edit))]) == 2
    assert "`machine2.fmu`" in capsys.readouterr().err


def test_an_array_of_scalars_is_put_in_order_once(described, monkeypatch):
    """And not once for each of its elements."""
    from cosim.fmu import elements, ports

    orders = []
    monkeypatch.setattr(elements, "sorted", lambda things: orders.append(1) or sorted(things), raising=False)
    path = described(*((f"x[{i},{j}]", "Real", "output", "") for i in range(20, 0, -1) for j in range(1, 11)))
    port = ports.ports(description.read_description(path)[1])["x"]
    assert port.shape == (20, 10)
    assert [m.name for m in port.members] == [f"x[{i},{j}]" for i in range(1, 21) for j in range(1, 11)]
    assert len(orders) == 1


def test_the_command_prints_it(machines, capsys):
    from cosim.terminal import cli

    assert cli.main(["fmu", str(machines["2"])]) == 0
    assert "linux64 (runs here)" in capsys.readouterr().out
    assert cli.main(["fmu", "nothing.fmu"]) == 2
