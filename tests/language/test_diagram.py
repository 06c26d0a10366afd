"""Diagrams as YAML says them: what they hold, mistakes with place and fix, any mutation of them."""

import cProfile
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.errors import (
    CosimError,
    DiagramErrors,
    DuplicateKey,
    ExpressionError,
    MetricError,
    MissingFile,
    MissingKey,
    Position,
    Problems,
    UnknownKey,
    WrongType,
    WrongValue,
    YamlSyntaxError,
)
from cosim.language.diagram import load
from tests.language.files import BASE, BLOCKS, HEAD, INNER, ONE, OUTER, mistake, mistakes, plain, same, write

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
    assert (level.kind, level.type.value, level.settings["per"].value) == ("block", "Tank", "tank")
    assert level.position == Position("base.yaml", 5, 3)
    assert level.type.position == Position("base.yaml", 6, 12)
    assert plain(level.parameters) == {"area": [1, 2], "leak": "0.1*i"}
    assert plain(level.start) == {"h": [0.5, "pi/3"]}
    assert plain(level.inputs) == {"inflow": "pump.q", "other": ["pump.q", "level.h"]}
    assert plain(level.dimensions) == {"n": 2}
    assert (level.settings["integrator"].value, level.settings["inner_steps"].value, level.settings.get("period")) == (
        "rk4",
        4,
        None,
    )
    pump = diagram.blocks["pump"]
    assert (pump.kind, pump.directory, pump.path, pump.settings["period"].value) == (
        "python",
        Path(),
        Path("mine.py"),
        0.01,
    )
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


def test_nothing_takes_away_and_a_section_without_lines_says_nothing(folder):
    diagram = load(
        write("a.yaml", "extends: base.yaml\nrecord: ~\nblocks: {level: {start: , inputs: {other: ~}}, pump: ~}\n")
    )
    assert diagram.record is None
    assert list(diagram.blocks) == ["level"]
    assert plain(diagram.blocks["level"].start) == {"h": [0.5, "pi/3"]}
    assert plain(diagram.blocks["level"].inputs) == {"inflow": "pump.q"}


def test_an_fmu_has_keys_of_its_own(folder):
    text = "{fmu: sub/tank.fmu, ports: {h: tank.level}, isolate: true, mode: model-exchange}"
    tank = load(write("d/a.yaml", f"run: {{stop: 1, step: 1}}\nblocks: {{t: {text}}}\n")).blocks["t"]
    assert (tank.kind, tank.directory, tank.path) == ("fmu", Path("d"), Path("d/sub/tank.fmu"))
    assert (plain(tank.ports), tank.settings["isolate"].value, tank.settings["mode"].value) == (
        {"h": "tank.level"},
        True,
        "model-exchange",
    )


def test_loading_takes_as_many_calls_for_each_block_whatever_the_number_of_blocks(folder):
    def calls(count):
        blocks = "".join(f"  b{k}:\n    block: B\n    parameters: {{m: [1, 2, 3, 4, 5, 6]}}\n" for k in range(count))
        write("a.yaml", f"run: {{stop: 1, step: 1}}\nblocks:\n{blocks}")
        profile = cProfile.Profile()
        profile.runcall(load, "a.yaml")
        return sum(entry.callcount for entry in profile.getstats())

    calls(1)
    few, more, most = calls(20), calls(120), calls(220)
    assert (most - more) / 100 == pytest.approx((more - few) / 100, rel=0.05)
    assert (most - more) / 100 < 500


# ---- mistakes in one file


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
    (HEAD + "blocks: {b: {block: B, per: [6]}}\n", WrongType, 2, 29, "write one text"),
    (HEAD + 'blocks: {b: {block: ""}}\n', WrongType, 2, 21, "write one text"),
    (HEAD + "blocks: {b.c: {block: B}}\n", WrongValue, 2, 10, "letters, digits, _ and -"),
    (HEAD + "blocks: {b: {block: B, parameters: {m: {x: 1}}}}\n", WrongType, 2, 40, "a list such as [1, 2]"),
    (HEAD + "blocks: {b: {block: B, parameters: {m: [1, ~]}}}\n", WrongType, 2, 44, "a list such as [1, 2]"),
    (HEAD + "blocks: {b: {block: B, inputs: {u: x}}}\n", WrongValue, 2, 36, "write block.port"),
    (HEAD + "blocks: {b: {block: B, inputs: {u: [b.x, 5]}}}\n", WrongValue, 2, 42, "write block.port"),
    (HEAD + "blocks: {b: {block: B, period: 0.0}}\n", WrongValue, 2, 32, "such as 0.001"),
    (HEAD + "blocks: {b: {block: B, period: 1, offset: -1}}\n", WrongValue, 2, 43, "such as 0.001"),
    (HEAD + "blocks: {b: {block: B, integrator: rk5}}\n", WrongValue, 2, 36, "did you mean `rk45`?"),
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
    (
        "run: {stop: 1, step: 1, integrator: [x]}\n" + BLOCKS,
        WrongValue,
        1,
        37,
        "one of: bdf, bogacki-shampine, dop853, dormand-prince, euler, heun, lsoda, radau, ralston, rk4, rk45",
    ),
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
    write("a.yaml", HEAD + "blocks: {b: {block: B, paramters: {m: 1}, period: 0}, c: {}}\n")
    diagram = load("a.yaml", problems=problems)
    assert [type(e) for e in problems.errors] == [UnknownKey, WrongValue, MissingKey]
    assert plain(diagram.blocks["b"].parameters) == {"m": 1}
    assert list(diagram.blocks) == ["b"]
    assert diagram.unread == {"c"}


def test_a_missing_file(folder):
    error = mistake("bass.yaml")
    assert type(error) is MissingFile
    assert error.fix == "did you mean `base.yaml`?"


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


@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.text("abcdefghilmnoprstuvk.=0123[]{}:,~ ", max_size=12),
    st.sampled_from(["", "blocks.level.", "run.", "blocks."]),
)
def test_any_setting_loads_or_raises_a_typed_error(folder, text, lead):
    try:
        load("base.yaml", [lead + text], [text])
    except DiagramErrors as error:
        assert all(e.position and e.message for e in error.errors)
