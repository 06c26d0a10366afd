"""Values that stand in tables and arrays: what they become, and that everything wrong with a file has its place."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors, MissingFile, TooLarge, UnknownKey, WrongFile, WrongShape, WrongType, WrongValue
from cosim.language import data_files
from cosim.language.diagram import load
from tests.language.files import HEAD, mistake, write

TABLE = "# measured\ntime, torque,x[1]\n0,1.5,2\n1,2.5,3\n\n2,3.5,1e3\n"


class Bomb:
    def __reduce__(self):
        return Path.touch, (Path("bomb"),)


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A folder with a table and arrays, below the current one."""
    monkeypatch.chdir(tmp_path)
    write("data/t.csv", TABLE)
    arrays = {"A": np.arange(6.0).reshape(3, 2), "k": np.array(3), "on": np.array([True, False])}
    np.savez("data/x.npz", **arrays)
    np.savez("data/bad.npz", n=np.array([1, np.nan]), s=np.array(["a"]), z=np.array([1j]))
    np.savez("data/pickled.npz", o=np.array([Bomb()], dtype=object))
    np.save("data/one.npy", np.arange(3))
    return tmp_path


def read(said):
    text = HEAD + f"blocks: {{b: {{block: B, parameters: {{a: {said}}}}}}}\n"
    return load(write("d.yaml", text)).blocks["b"].parameters["a"]


FOUND = {
    "a column": ("{file: data/t.csv, column: torque}", [1.5, 2.5, 3.5]),
    "one whose name has brackets": ('{file: data/t.csv, column: "x[1]"}', [2.0, 3.0, 1000.0]),
    "all columns": ("{file: data/t.csv}", [[0.0, 1.5, 2.0], [1.0, 2.5, 3.0], [2.0, 3.5, 1000.0]]),
    "an array": ("{file: data/x.npz, array: A}", [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]),
    "a number": ("{file: data/x.npz, array: k}", 3),
    "truth values": ("{file: data/x.npz, array: on}", [True, False]),
    "the one array of a file": ("{file: data/one.npy}", [0, 1, 2]),
}


@pytest.mark.parametrize("what", FOUND)
def test_a_file_holds_what_a_list_would(data, what):
    said, expected = FOUND[what]
    node = read(said)
    assert node.value.array.tolist() == expected
    assert data_files.listed(node).plain() == expected


def test_numbers_without_names_and_other_separators(data):
    write("n.csv", "1,2\n3,4\n")
    write("s.csv", "\ufeffa;b\n1.5;2\n")
    write("t.tsv", "a\tb\n7\t8\n")
    assert read("{file: n.csv}").value.array.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert read("{file: s.csv, column: b}").value.array.tolist() == [2.0]
    assert read("{file: t.tsv, column: a}").value.array.tolist() == [7.0]


def test_names_of_columns_may_be_numbers_and_lines_may_end_anyhow(data):
    write("years.csv", "2020,2021\n1,2\n3,4\n")
    assert read('{file: years.csv, column: "2021"}').value.array.tolist() == [2.0, 4.0]
    Path("dos.csv").write_bytes(b"a,b\r\n1,2\r\n3,4\r\n")
    assert read("{file: dos.csv, column: b}").value.array.tolist() == [2.0, 4.0]
    write("quoted.csv", '"a, in m","b"\n"1","2"\n')
    assert read('{file: quoted.csv, column: "a, in m"}').value.array.tolist() == [1.0]


def test_the_path_belongs_to_the_file_that_says_it(data):
    write("sub/base.yaml", HEAD + "blocks: {b: {block: B, parameters: {a: {file: ../data/t.csv, column: torque}}}}\n")
    over = "extends: sub/base.yaml\nblocks: {b: {parameters: {c: {file: data/one.npy}}}}\n"
    found = load(write("over.yaml", over), ["blocks.b.parameters.d={file: data/x.npz, array: k}"]).blocks["b"]
    assert [str(node.value.path) for node in found.parameters.values()] == ["data/t.csv", "data/one.npy", "data/x.npz"]


def test_an_overlay_names_another_file_column_or_array_or_a_number(data):
    base = HEAD + "blocks: {b: {block: B, parameters: {a: {file: data/t.csv, column: torque}}}}\n"
    write("base.yaml", base)

    def over(*settings):
        return load("base.yaml", settings).blocks["b"].parameters["a"]

    assert over("blocks.b.parameters.a.column=time").value.array.tolist() == [0.0, 1.0, 2.0]
    assert over("blocks.b.parameters.a={file: data/x.npz, array: k}").value.array == 3
    assert over("blocks.b.parameters.a=4").value == 4
    write("other.csv", "torque\n9\n")
    assert over("blocks.b.parameters.a.file=other.csv").value.array.tolist() == [9.0]


def test_the_whole_diagram_as_text_means_the_very_content(data):
    read("{file: data/t.csv, column: torque}")
    whole = load("d.yaml").resolved()
    assert load(write("again.yaml", whole)).resolved() == whole
    write("data/t.csv", TABLE.replace("2.5", "2.6"))
    error = mistake("again.yaml")
    assert type(error) is WrongFile and "another one" in error.message and "sha256" in error.fix


TABLES = {
    "a missing column": ("{column: torqe}", TABLE, WrongValue, "has no column `torqe`", "`torque`", "d.yaml"),
    "no line of names": ("{column: a}", "1,2\n", WrongValue, "no line with names", "leave `column` out", "d.yaml"),
    "two columns of a name": ("{column: a}", "a,a\n1,2\n", WrongValue, "several columns", "rename", "d.yaml"),
    "NaN": ("{column: a}", "a,b\n1,2\nnan,3\n", WrongValue, "`nan` is no value", "give a number", "t.csv:3"),
    "no number": ("{column: a}", "a,b\n1,2\n,3\n", WrongValue, "there is no number", "give a number", "t.csv:3"),
    "a word": ("{column: a}", "a,b\n1,2\nx,3\n", WrongValue, "`x` is no number", "give a number", "t.csv:3"),
    "decimal commas": ("{column: a}", "a;b\n1,5;2\n", WrongValue, "`1,5` is no number", "with a point", "t.csv:2"),
    "grouped digits": ("{column: a}", "a\n1_0\n", WrongValue, "`1_0`", "give a number", "t.csv:2"),
    "too large a number": ("{column: a}", "a\n1e400\n", WrongValue, "beyond the range", "1.7e308", "t.csv:2"),
    "ragged rows": ("{column: a}", "a,b\n1,2\n3\n", WrongShape, "line 3", "as many entries", "t.csv:3"),
    "names alone": ("{column: a}", "a,b\n", WrongFile, "no numbers below", "add lines", "t.csv:1"),
    "nothing": ("{column: a}", "\n", WrongFile, "has no row", "line of names", "d.yaml"),
    "an array of a table": ("{array: a}", "a\n1\n", WrongValue, "has no `array`", "`column:`", "d.yaml"),
    "a column without a name": ("{column: 3}", "a\n1\n", WrongValue, "must be text", "quotation marks", "d.yaml"),
    "a misspelt key": ("{colum: a}", "a\n1\n", UnknownKey, "no key `colum`", "`column`", "d.yaml"),
}


@pytest.mark.parametrize("what", TABLES)
def test_what_is_wrong_with_a_table(data, what):
    said, text, kind, words, fix, place = TABLES[what]
    write("t.csv", text)
    with pytest.raises(DiagramErrors) as caught:
        read(said.replace("{", "{file: t.csv, "))
    (error,) = caught.value.errors
    assert type(error) is kind and words in error.message and fix in error.fix
    assert str(error.position).startswith(place)


FILES = {
    "no such file": ("{file: data/tt.csv}", MissingFile, "no file `data/tt.csv`", "`t.csv`"),
    "a folder": ("{file: data}", WrongFile, "neither a table nor an array", ".csv"),
    "a device": ("{file: /dev/zero.csv}", MissingFile, "no file", ""),
    "no name": ("{column: a}", WrongType, "not a mapping", "file: table.csv"),
    "an empty mapping": ("{}", WrongType, "not a mapping", "file: table.csv"),
    "a spreadsheet": ("{file: t.xlsx}", WrongFile, "neither a table nor an array", ".csv"),
    "no such array": ("{file: data/x.npz, array: B}", WrongValue, "has no array `B`", "one of: A, k, on"),
    "several arrays": ("{file: data/x.npz}", WrongValue, "several arrays", "array:"),
    "a column of arrays": ("{file: data/x.npz, column: A}", WrongValue, "has no `column`", "`array:`"),
    "a name of the only array": ("{file: data/one.npy, array: A}", WrongValue, "has no name", "leave `array` out"),
    "NaN in an array": ("{file: data/bad.npz, array: n}", WrongValue, "is NaN at [1]", "give a number"),
    "texts": ("{file: data/bad.npz, array: s}", WrongValue, "of type <U1", "save numbers"),
    "complex numbers": ("{file: data/bad.npz, array: z}", WrongValue, "complex128", "save numbers"),
    "a pickled object": ("{file: data/pickled.npz, array: o}", WrongValue, "of type object", "save numbers"),
    "no archive": ("{file: text.npz}", WrongFile, "no readable NPZ", "numpy.savez"),
    "a header that asks for all memory": ("{file: bomb.npy}", WrongFile, "ends too early", "numpy.savez"),
    "an archive that swells": ("{file: swell.npz}", TooLarge, "more than 16 MiB", "smaller"),
    "a file that is too large": ("{file: large.csv}", TooLarge, "more than 16 MiB", "smaller"),
}


@pytest.mark.parametrize("what", FILES)
def test_what_is_wrong_with_a_file(data, what):
    said, kind, words, fix = FILES[what]
    write("text.npz", "PK words")
    write("t.xlsx", "words")
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }\n"
    Path("bomb.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + b"\0" * 8)
    if "swell" in said:
        content = io.BytesIO()
        np.save(content, np.zeros(3 << 20))
        with zipfile.ZipFile("swell.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("A.npy", content.getvalue())
    if "large" in said:
        with Path("large.csv").open("wb") as file:
            file.truncate(17 << 20)
    with pytest.raises(DiagramErrors) as caught:
        read(said)
    (error,) = caught.value.errors
    assert type(error) is kind and words in error.message and fix in error.fix
    assert str(error.position).startswith("d.yaml:2:")
    assert not Path("bomb").exists()


def test_values_are_converted_as_those_of_the_diagram_are(data):
    write(
        "own.py",
        "from cosim import Block, Output, Parameter\n\nclass B(Block):\n    a = Parameter('n', dtype=int)\n"
        "    b = Parameter(dtype=bool, default=True)\n    c = Parameter(default=0.0)\n    y = Output()\n"
        "    def outputs(a, c, y):\n        y[0] = c * a[a.size - 1]\n",
    )
    text = HEAD + "fleets: {r: 2}\nblocks: {b: {python: 'own.py:B', per: r, parameters: {a: {file: data/one.npy}}}}\n"
    write("d.yaml", text)
    on = "blocks.b.parameters.b={file: data/x.npz, array: on}"
    component = run.load("d.yaml", [on]).components["b"]
    assert component.values["a"].tolist() == [[0, 1, 2]] and component.values["a"].dtype == np.int64
    assert component.values["b"].tolist() == [True, False]
    for setting, words in (
        ("blocks.b.parameters.a={file: data/t.csv, column: torque}", "1.5 is no whole number"),
        ("blocks.b.parameters.c={file: data/x.npz, array: on}", "is no number"),
        ("blocks.b.parameters.c={file: data/t.csv, column: torque}", "has 3 entries for 2 rs"),
    ):
        with pytest.raises(DiagramErrors) as caught:
            run.load("d.yaml", [setting])
        assert words in str(caught.value)


def test_a_value_that_cannot_be_read_is_one_mistake_and_not_missing_too(data):
    values = "{times: {file: data/t.csv, column: time}, values: {file: data/t.csv, column: torqe}}"
    text = f"{HEAD}blocks: {{b: {{block: TableSource, parameters: {values}}}}}\n"
    with pytest.raises(DiagramErrors) as caught:
        run.load(write("d.yaml", text))
    (error,) = caught.value.errors
    assert type(error) is WrongValue and "no column `torqe`" in error.message
