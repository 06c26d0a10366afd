"""What a diagram gives an FMU: items of enumerations, texts, binary data, large integers, sizes; and by what names."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors
from tests.fmu import told

TOLD = {"2": told.TOLD2, "3": told.TOLD3}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The test FMU of each version."""
    folder = tmp_path_factory.mktemp("values")
    return {"2": told.build(folder / "2", 2, "cs"), "3": told.build(folder / "3", 3, "cs")}


@pytest.fixture
def load(write, fmus):
    """Wire a diagram of one FMU with these keys; more: further blocks."""

    def load_keys(version: str, keys: str, more: str = "", *settings: str):
        text = f"run: {{stop: 1, step: 0.5}}\nblocks:\n  plant: {{fmu: {fmus[version]}, {keys}}}\n{more}"
        return run.load(write(text), settings)

    return load_keys


@pytest.fixture
def told_of(load, trajectories):
    """What outputs say at the end."""

    def outputs(version: str, keys: str, *names: str, engine: str = "native", more: str = ""):
        got = trajectories(load(version, keys, more), *(f"plant.{name}" for name in names), engine=engine)
        last = [got[f"plant.{name}"][-1] for name in names]
        return last[0] if len(last) == 1 else last

    return outputs


@pytest.fixture
def mistake(load):
    """The one mistake of a diagram with these keys, as text."""

    def text(version: str, keys: str, more: str = "") -> str:
        with pytest.raises(DiagramErrors) as caught:
            load(version, keys, more)
        (error,) = caught.value.errors
        assert error.position.line >= 3
        return str(error)

    return text


def weighted(data: bytes) -> int:
    """The sum of bytes, each times its place, as the FMU tells it."""
    return sum(k * byte for k, byte in enumerate(data, 1))


# ---- enumerations ----


@pytest.mark.parametrize("version", "23")
@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("value", "number"), [("very high", 7), ("low", 1), ('"2"', 3), ("7", 7), ("1 + 2", 3), ("3", 3)]
)
def test_items_are_named(told_of, version, engine, value, number):
    """A name wins over arithmetic: the item that is called 2 is 3."""
    keys = f"parameters: {{level: {value}}}, start: {{heat: {value}}}"
    assert [*told_of(version, keys, "level_told", "heat_told", engine=engine)] == [number, number]


@pytest.mark.parametrize("version", "23")
def test_each_member_of_a_fleet_may_have_another_item(write, fmus, trajectories, version):
    text = f"""
        run: {{stop: 1, step: 0.5}}
        fleets: {{robot: 3}}
        blocks:
          plant:
            fmu: {fmus[version]}
            per: robot
            parameters: {{level: [low, very high, "2"]}}
            start: {{heat: very high}}
        """
    got = trajectories(run.load(write(text)), "plant.level_told", "plant.heat_told")
    assert [*got["plant.level_told"][-1]] == [1, 7, 3]
    assert [*got["plant.heat_told"][-1]] == [7, 7, 7]


@pytest.mark.parametrize("version", "23")
@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (
            "parameters: {level: very hgih}",
            "`very hgih` is none of the items `low`, `very high`, `2`\n    fix: did you mean `very high`?",
        ),
        ("parameters: {level: 2}", "no item of `level` is 2\n    fix: one of: low = 1, very high = 7, 2 = 3"),
        ("start: {heat: 8}", "no item of `heat` is 8"),
        ("start: {heat: 1.5}", "1.5 is no whole number"),
        ("start: {heat: true}", "`true` is no number"),
    ],
)
def test_what_is_no_item_is_refused(mistake, version, keys, words):
    assert words in mistake(version, keys)


def test_a_study_may_vary_over_items(write, fmus, tmp_path):
    import json

    from cosim.terminal import cli

    write(
        f"""
        run: {{stop: 1, step: 0.5}}
        blocks: {{plant: {{fmu: {fmus["3"]}}}}}
        metrics: {{told: {{signal: plant.level_told, reduce: final}}}}
        """,
        "base.yaml",
    )
    study = write(
        """
        diagram: base.yaml
        grid: {blocks.plant.parameters.level: [low, very high]}
        metrics: [told]
        """,
        "study.yaml",
    )
    assert cli.main(["study", str(study), "--json", "--results", str(tmp_path / "out")]) == 0
    rows = [json.loads(line) for path in (tmp_path / "out").rglob("*.jsonl") for line in path.read_text().splitlines()]
    assert sorted(row["metrics"]["told"] for row in rows if "metrics" in row) == [1, 7]


# ---- texts, binary data, large integers ----


@pytest.mark.parametrize("version", "23")
def test_texts_are_parameters_also_where_fmi_calls_them_inputs(told_of, version):
    text, note = told_of(version, 'parameters: {text: "Grüße, 世界", note: ""}', "text_told", "note_told")
    assert (text, note) == (weighted("Grüße, 世界".encode()), 0)
    text, note = told_of(version, "parameters: {}", "text_told", "note_told")
    assert (text, note) == (weighted(b"nobody"), weighted(b"none"))


def test_arrays_of_texts(told_of):
    assert told_of("3", "parameters: {words: [ab, c]}", "words_told") == weighted(b"ab") + 1001 * weighted(b"c")
    assert told_of("3", "parameters: {words: x}", "words_told") == 1002 * weighted(b"x")
    assert told_of("3", "parameters: {}", "words_told") == 0  # its own are not set again


@pytest.mark.parametrize("isolated", ["false", "true"])
def test_binary_data_are_hexadecimal_digits(told_of, isolated):
    for digits in ("", "00ff00", "DEADBEEF", "00" * 1000):
        data = bytes.fromhex(digits)
        told_bytes = told_of("3", f'isolate: {isolated}, parameters: {{blob: "{digits}"}}', "blob_told")
        assert told_bytes == weighted(data) + 1_000_000 * len(data)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("parameters: {text: 007}", "`7` is no text\n    fix: put it between quotation marks"),
        ("parameters: {text: true}", "`true` is no text"),
        ("parameters: {words: [a, b, c]}", "words"),
        ("parameters: {blob: 0012}", "`blob` is binary data, not `12`"),
        ('parameters: {blob: "0g"}', "`blob` is binary data, and `0g` no hexadecimal digits"),
        ('parameters: {blob: "123"}', "`123` no hexadecimal digits"),
        ("parameters: {big: 18446744073709551616}", "does not fit uint64"),
        ("parameters: {big: -1}", "does not fit uint64"),
    ],
)
def test_what_is_no_text_and_no_number_is_refused(mistake, keys, words):
    assert words in mistake("3", keys)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_the_largest_integer_without_a_sign(told_of, engine):
    for value in (0, 2**63, 2**64 - 2, 2**64 - 1):
        assert int(told_of("3", f"parameters: {{big: {value}}}", "big_told", engine=engine)) == value
    assert int(told_of("3", "parameters: {}", "big_told")) == 2**64 - 1


# ---- structural parameters ----

GAINS = {1: "[5]", 3: "[1, 2, 3]", 4: "[1, 2, 3, 4]", 16: "2"}


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("size", GAINS)
@pytest.mark.parametrize("isolated", ["false", "true"])
def test_structural_parameters_set_the_shapes(write, fmus, trajectories, size, engine, isolated):
    """total = Σ gain (in + 1); in = 1 for every element."""
    text = f"""
        run: {{stop: 1, step: 0.5}}
        blocks:
          plant:
            fmu: {fmus["3"]}
            isolate: {isolated}
            parameters: {{size: {size}, gains: {GAINS[size]}}}
            start: {{in: 1}}
        """
    network = run.load(write(text))
    declared = network.components["plant"].declaration.variables
    assert declared["gains"].shape == declared["in"].shape == (size,)
    got = trajectories(network, "plant.total", engine=engine)
    gains = {1: 5.0, 3: 6.0, 4: 10.0, 16: 32.0}[size]
    assert np.array_equal(got["plant.total"].ravel(), np.full(3, 2.0 * gains))


def test_structural_parameters_have_other_names_and_expressions(load):
    for keys in (
        'parameters: {size: "2*2", gains: 1}, start: {in: 0}',
        "ports: {cells: size}, parameters: {cells: 4, gains: 1}, start: {in: 0}",
    ):
        assert load("3", keys).components["plant"].declaration.variables["in"].shape == (4,)


def test_what_has_no_elements_is_no_port(load, told_of, mistake):
    assert "in" not in load("3", "parameters: {size: 0}").components["plant"].declaration.variables
    assert told_of("3", "parameters: {size: 0}", "total") == 0.0
    assert "`in` has no elements" in mistake("3", "parameters: {size: 0}, start: {in: 1}")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("parameters: {size: 4}, start: {in: 0}", "parameter `gains` of told has no value"),
        ("parameters: {size: 4, gains: 1}", "input `in` is not connected and has no start value"),
        ("parameters: {size: [3, 4], gains: 1}, start: {in: 0}", "`size` needs one value"),
        ("parameters: {size: 2.5}", "2.5 is no whole number"),
        ("parameters: {size: -1}", "does not fit uint64"),
        ("parameters: {size: i}", "`i` in `i` is the number of a fleet's member"),
        ("parameters: {size: 100000000}", "has the size (100000000,)"),
        ("parameters: {size: 4, gains: [1, 2, 3]}, start: {in: 0}", "gains"),
    ],
)
def test_sizes_that_do_not_go(mistake, keys, words):
    assert words in mistake("3", keys)


def test_an_fmu_that_takes_no_such_size_fails_with_its_name(load):
    outcome = run.Run(load("3", "parameters: {size: 17, gains: 1}, start: {in: 0}")).execute()
    assert outcome.status == "failed"
    assert "fmi3SetUInt64() for `size` returned `error`" in outcome.error.message


def test_a_study_may_vary_a_size(write, fmus, tmp_path):
    import json

    from cosim.terminal import cli

    write(
        f"""
        run: {{stop: 1, step: 0.5}}
        blocks: {{plant: {{fmu: {fmus["3"]}, parameters: {{gains: 2}}, start: {{in: 0}}}}}}
        metrics: {{total: {{signal: plant.total, reduce: final}}}}
        """,
        "base.yaml",
    )
    study = write(
        "diagram: base.yaml\ngrid: {blocks.plant.parameters.size: [1, 3, 5]}\nmetrics: [total]\n", "study.yaml"
    )
    assert cli.main(["study", str(study), "--json", "--results", str(tmp_path / "out")]) == 0
    rows = [json.loads(line) for path in (tmp_path / "out").rglob("*.jsonl") for line in path.read_text().splitlines()]
    assert sorted(row["metrics"]["total"] for row in rows if "metrics" in row) == [2.0, 6.0, 10.0]


# ---- names ----

SINK = "  sink: {python: SINKS:Sum, inputs: {u: plant.zeit, v: plant.y_too}}\n"


def test_outputs_have_their_aliases_too(write, fmus, trajectories):
    code = write(
        "from cosim import Block, Input, Output\n\n\nclass Sum(Block):\n    u = Input()\n    v = Input()\n"
        "    y = Output()\n\n    def outputs(u, v, y):\n        y[0] = u + 10.0 * v\n",
        "sinks.py",
    )
    text = (
        f"run: {{stop: 1, step: 0.5}}\nblocks:\n  plant: {{fmu: {fmus['3']}, parameters: {{k: 3}}, start: {{u: 2}}}}\n"
    )
    network = run.load(write(text + SINK.replace("SINKS", str(code))))
    got = trajectories(network, "plant.clock", "plant.zeit", "plant.y", "plant.y_too", "sink.y")
    assert np.array_equal(got["plant.clock"].ravel(), [0.0, 0.5, 1.0])
    assert np.array_equal(got["plant.zeit"], got["plant.clock"])
    assert np.array_equal(got["plant.y"].ravel(), [6.0, 6.0, 6.0])
    assert np.array_equal(got["sink.y"], got["plant.clock"] + 10.0 * got["plant.y"])
    declaration = network.components["plant"].declaration
    assert declaration.writer("y", starts=True).reads == declaration.writer("y_too", starts=True).reads == ("u",)


def test_parameters_and_inputs_may_be_called_by_an_alias(told_of, mistake, load):
    for keys in (
        "parameters: {gain: 3}, start: {u: 2}",
        "parameters: {factor: 3}, start: {force: 2}",
        "ports: {K: factor, U: force}, parameters: {K: 3}, start: {U: 2}",
    ):
        assert told_of("3", keys, "y") == 6.0
    assert "`k` and `gain` are two names of one variable" in mistake("3", "parameters: {k: 3, gain: 4}")
    assert "`u` and `force` are two names of one variable" in mistake("3", "start: {u: 3}, inputs: {force: source.y}")
    assert {"gain", "factor"} & {*load("3", "parameters: {}").components["plant"].declaration.variables} == set()


@pytest.mark.parametrize(
    ("keys", "more", "words"),
    [
        ("parameters: {u: 1}", "", "has no parameter `u`\n    fix: `u` is an input"),
        ("parameters: {y: 1}", "", "fix: `y` is computed by the block"),
        ("start: {k: 1}", "", "fix: `k` is a parameter: write it below `parameters:`"),
        ("inputs: {k: plant.y}", "", "fix: `k` is a parameter"),
        ("parameters: {time: 1}", "", "fix: `time` is the time"),
        ("ports: {K: k}, parameters: {k: 1}", "", "fix: `k` is called `K` here"),
        ("ports: {K: k}, parameters: {gain: 1}", "", "`k` and `gain` are two names of one variable"),
        ("", "record: {signals: [plant.text]}", "fix: `text` is a parameter"),
        ("", "record: {signals: [plant.gain]}", "fix: `gain` is another name of `k`"),
    ],
)
def test_a_message_says_what_a_name_is(mistake, keys, more, words):
    assert words in mistake("3", keys, more)
