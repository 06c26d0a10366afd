"""YAML with places: values of the core schema, the line and column of everything, typed errors for broken files."""

import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import (
    DuplicateKey,
    MissingFile,
    Position,
    Problems,
    WrongType,
    WrongValue,
    YamlSyntaxError,
)
from cosim.language import source
from cosim.language.source import describe, dump, parse_value, read

HERE = Position("here")


def value(text):
    return parse_value(text, HERE).plain()


def read_text(folder, text):
    """The tree of a file with this content; a list of the mistakes that were collected."""
    path = folder / "a.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    problems = Problems()
    return read(path, problems), problems.errors


@pytest.fixture(params=["libyaml", "python"])
def parser(request, monkeypatch):
    """Both parsers of YAML: the one in C, and the one that is always there."""
    if request.param == "python":
        monkeypatch.setattr(source, "_LOADER", yaml.BaseLoader)


CORE = [
    ("1e-3", 1e-3),
    ("1E3", 1000.0),
    ("1.0e-3", 1e-3),
    ("-.5", -0.5),
    ("5.", 5.0),
    ("010", 10),
    ("+7", 7),
    ("0o17", 15),
    ("0x1F", 31),
    ("9223372036854775807", 2**63 - 1),
    ("9223372036854775808", 2**63),
    ("-9223372036854775808", -(2.0**63)),
    ("18446744073709551615", 2**64 - 1),
    ("18446744073709551616", 2.0**64),
    (".inf", math.inf),
    ("-.Inf", -math.inf),
    ("true", True),
    ("FALSE", False),
    ("null", None),
    ("~", None),
    ("", None),
    ("# nothing", None),
    ("yes", "yes"),
    ("off", "off"),
    ("y", "y"),
    ("1_000", "1_000"),
    ("1:30", "1:30"),
    ("2024-01-01", "2024-01-01"),
    ("'1'", "1"),
    ('"true"', "true"),
    ("!!str 1", "1"),
    ("! 1", "1"),
    ("pi/3", "pi/3"),
    ("[1, [2.5, x], {a: ~}]", [1, [2.5, "x"], {"a": None}]),
    ("{on: 1, yes: 2, 3: 4, true: 5, ~: 6}", {"on": 1, "yes": 2, "3": 4, "true": 5, "~": 6}),
]


@pytest.mark.parametrize(("text", "expected"), CORE)
def test_core_schema(parser, text, expected):
    result = value(text)
    assert result == expected
    assert type(result) is type(expected)


@pytest.mark.parametrize(
    "text", ["1e400", "-1e400", "9" * 400, "-" + "9" * 5000, "0x" + "f" * 400, "1e-400", "0.0001e-330"]
)
def test_a_number_that_no_float_holds_is_refused(parser, tmp_path, text):
    tree, errors = read_text(tmp_path, f"a: 1\nb: {text}\n")
    assert [(type(e), e.position.line, e.position.column) for e in errors] == [(WrongValue, 2, 4)]
    assert "beyond the range" in errors[0].message and "1.7e308" in errors[0].fix
    assert tree.value["a"].value == 1


@pytest.mark.parametrize("text", ["0e400", "0.0", "0x0", "-0.00e-400", "1.7976931348623157e308", "5e-324"])
def test_what_a_float_holds_is_taken(parser, text):
    assert value(text) == float.fromhex(text) if text.startswith("0x") else value(text) == float(text)


def test_not_a_number():
    assert math.isnan(value(".nan"))


def test_places_of_keys_and_values(parser, tmp_path):
    tree, errors = read_text(tmp_path, "# first\na:\n  b: [1,\n      x]\n'ü': 5\n")
    file = str(tmp_path / "a.yaml")
    b = tree.value["a"].value["b"]
    assert errors == []
    assert tree.position == Position(file, 2, 1)
    assert tree.key_position is None
    assert tree.place == tree.position
    assert tree.value["a"].key_position == Position(file, 2, 1)
    assert (b.key_position, b.position) == (Position(file, 3, 3), Position(file, 3, 6))
    assert b.place == b.key_position
    assert [n.position for n in b.value] == [Position(file, 3, 7), Position(file, 4, 7)]
    assert tree.value["ü"].position == Position(file, 5, 6)


def test_byte_order_mark(tmp_path):
    tree, _ = read_text(tmp_path, b"\xef\xbb\xbfa: 1\n")
    assert tree.plain() == {"a": 1}
    assert tree.value["a"].key_position == Position(str(tmp_path / "a.yaml"), 1, 1)


def test_anchors_aliases_and_merge_keys(parser, tmp_path):
    text = "base: &b {x: 1, y: 2}\ncopy: *b\none: {<<: *b, y: 3}\nboth: {<<: [{x: 8}, *b], z: 9}\nlist: &l [1]\n"
    text += "m: [*l, *l]\n"
    tree, errors = read_text(tmp_path, text)
    assert errors == []
    plain = tree.plain()
    assert plain["copy"] == {"x": 1, "y": 2}
    assert plain["one"] == {"x": 1, "y": 3}
    assert plain["both"] == {"x": 8, "y": 2, "z": 9}
    assert plain["m"] == [[1], [1]]
    assert tree.value["base"].key_position.line == 1
    assert tree.value["copy"].key_position.line == 2
    assert tree.value["copy"].position.line == 1
    assert tree.value["one"].value["x"].position.line == 1


def test_a_quoted_merge_key_is_a_key():
    assert value("'<<': 1") == {"<<": 1}


def test_duplicate_keys_are_all_found_and_the_first_counts(parser, tmp_path):
    tree, errors = read_text(tmp_path, "a: 1\nb: {c: 1, c: 2}\na: 3\n")
    assert tree.plain() == {"a": 1, "b": {"c": 1}}
    assert {type(error) for error in errors} == {DuplicateKey}
    assert [(e.position.line, e.position.column) for e in errors] == [(2, 11), (3, 1)]
    assert "`a`" in errors[1].message
    assert f"{tmp_path / 'a.yaml'}:1:1" in errors[1].message
    assert errors[1].fix == "remove one of the two"


BROKEN = [
    ("a: b: c", 1, 5, "indent the line like its neighbours"),
    ("a: 1\n\tb: 2", 2, 1, "spaces, not tabs"),
    ("a: @x", 1, 4, "quote text that begins with `@`"),
    ("a: *x", 1, 4, "mark a value with `&x` first"),
    ("b: &gain 1\na: *gian", 2, 4, "did you mean `gain`?"),
    ("a: &a [*a]", 1, 8, "write the value out"),
    ("a: 1\n---\nb: 2", 2, 1, "remove the line `---`"),
    ("a: !!python/object:os.system {}", 1, 4, "remove the tag"),
    ("a: !!python/name:os.system x", 1, 4, "remove the tag"),
    ("a: !mine 1", 1, 4, "remove the tag"),
    ("a: 1\nb: \x00", 2, 4, "remove the invisible character"),
    ("? [1]\n: 2", 1, 3, "write `key: value`"),
    ("{<<: 5}", 1, 6, "give it an alias of a mapping"),
    ("a: " + "[" * 60, 1, 54, "use fewer levels"),
    (b"a: 1\nb: \xff\n", 2, 4, "UTF-8"),
    ("a: 1".encode("utf-16"), 1, 1, "UTF-8"),
]


@pytest.mark.parametrize(("text", "line", "column", "fix"), BROKEN)
def test_broken(tmp_path, text, line, column, fix):
    with pytest.raises(YamlSyntaxError) as caught:
        read_text(tmp_path, text)
    assert caught.value.position == Position(str(tmp_path / "a.yaml"), line, column)
    assert fix in caught.value.fix


@pytest.mark.parametrize(
    ("text", "fix"),
    [
        ("a: [1, 2", "close the bracket"),
        ("a: {b: 1", "close the bracket"),
        ("a: 'x", "close the quotation mark"),
        ("a: 1\n b: 2", "indent"),
        ("a:\n  b: 1\n c: 2", "check the indentation"),
    ],
)
def test_broken_where_the_parsers_see_it_at_different_places(parser, tmp_path, text, fix):
    with pytest.raises(YamlSyntaxError) as caught:
        read_text(tmp_path, text)
    assert caught.value.position.line >= 1
    assert "broken YAML" in caught.value.message
    assert fix in caught.value.fix


def test_billion_laughs(parser, tmp_path):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12)]
    with pytest.raises(YamlSyntaxError) as caught:
        read_text(tmp_path, "\n".join(lines))
    assert caught.value.fix == "use fewer aliases of aliases"


def test_a_deep_chain_of_aliases(tmp_path):
    lines = ["a0: &a0 [x]", *(f"a{k}: &a{k} [*a{k - 1}]" for k in range(1, 60))]
    with pytest.raises(YamlSyntaxError) as caught:
        read_text(tmp_path, "\n".join(lines))
    assert caught.value.position.line == 50
    assert caught.value.fix == "use fewer aliases of aliases"


@pytest.mark.parametrize(("text", "words"), [("", "empty"), ("# c\n", "empty"), ("[1]", "a list of 1"), ("5", "`5`")])
def test_not_a_mapping(tmp_path, text, words):
    with pytest.raises(WrongType) as caught:
        read_text(tmp_path, text)
    assert words in caught.value.message
    assert caught.value.position == Position(str(tmp_path / "a.yaml"), 1, 1)
    assert caught.value.fix == "write lines of `key: value`"


def test_missing_file_has_the_nearest_name(tmp_path):
    (tmp_path / "formation.yaml").write_text("a: 1")
    with pytest.raises(MissingFile) as caught:
        read(tmp_path / "fromation.yaml", Problems(), Position("b.yaml", 2, 10))
    assert caught.value.position == Position("b.yaml", 2, 10)
    assert caught.value.fix == "did you mean `formation.yaml`?"


def test_missing_folder(tmp_path):
    with pytest.raises(MissingFile) as caught:
        read(tmp_path / "no" / "a.yaml", Problems())
    assert "there is no folder" in caught.value.message
    assert caught.value.position == Position(str(tmp_path / "no" / "a.yaml"))


@pytest.mark.parametrize("name", [".", "a\0b", "x" * 5000])
def test_what_is_no_file(tmp_path, name):
    with pytest.raises(MissingFile) as caught:
        read(tmp_path / name, Problems())
    assert caught.value.fix


def test_values_of_the_command_line_have_one_place():
    node = parse_value("{a: [1, 2]}", HERE)
    assert node.position == node.value["a"].key_position == node.value["a"].value[1].position == HERE
    with pytest.raises(YamlSyntaxError) as caught:
        parse_value("[1", HERE)
    assert caught.value.position == HERE
    with pytest.raises(YamlSyntaxError) as caught:
        parse_value("\ud800", HERE)
    assert caught.value.position == HERE


def test_describe():
    words = {"{a: 1}": "a mapping", "[1, 2]": "a list of 2", "x": "the text `x`", "": "nothing", "true": "`true`"}
    assert {text: describe(parse_value(text, HERE)) for text in words} == words
    assert len(describe(parse_value("x" * 500, HERE))) < 80


SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63) + 1, 2**63 - 1),
    st.floats(allow_nan=False),
    st.text("ab é:#-'\"{}[]&*!|>%@`,?\n\t01.e~=<"),
    st.sampled_from(["1e-3", "on", "true", "~", "", "<<", "0x1F", ".inf", "1_000", "- a", "a: b", "# c", "pi/3"]),
)


@given(
    st.dictionaries(st.text("abon1<.", min_size=1), st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4)))
)
def test_dump_reads_back_as_the_same(plain):
    again = value(dump(plain))
    assert again == plain
    assert repr(again) == repr(plain)
