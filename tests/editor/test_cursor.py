"""The keys above a place are found by indentation and brackets: compared with the YAML parser on whole files."""

from pathlib import Path

import pytest

from cosim.editor.cursor import find
from cosim.editor.workbench import Workbench
from cosim.errors import Problems
from cosim.language import source

ROOT = Path(__file__).parents[2]
FILES = [path for path in sorted((ROOT / "diagrams").rglob("*.yaml")) if "results" not in path.parts]


def places(node, path=()):
    """Every key and every value in one line with its place and the keys above it, as the parser has them."""
    if isinstance(node.value, dict):
        for key, child in node.value.items():
            yield child.key_position, path, key
            yield from places(child, (*path, key.removesuffix("+")))
    elif isinstance(node.value, list):
        for child in node.value:
            yield from places(child, path)
    else:
        yield node.position, path, None


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_place_of_every_diagram_has_the_keys_that_the_parser_gives_it(path):
    """Whatever comes afterwards: all that is behind the line's begin may be missing."""
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    seen = set()
    for place, above, key in places(source.read(path, Problems())):
        line, column = place.line - 1, place.column - 1
        if place in seen or lines[line][column] in "*&|>'\"":
            continue  # an alias gives a second path to what stands elsewhere; and a quotation mark is no word
        for known in (text, "\n".join([*lines[:line], lines[line][: column + 1]])):
            found = find(known, line, column)
            assert found.path == above, (place, found)
            assert found.is_key or key is None or known is not text, (place, found)
        seen.add(place)
    assert len(seen) > 5


@pytest.mark.parametrize(
    ("text", "path", "is_key"),
    [
        ("blocks:\n  a:\n    ", ("blocks", "a"), True),
        ("blocks:\n  a:\n    block: PID\n  ", ("blocks",), True),
        ("blocks: {a: {inputs: {u: ", ("blocks", "a", "inputs", "u"), False),
        ("blocks: {a: {inputs: {u: b.y, ", ("blocks", "a", "inputs"), True),
        ("record:\n  signals:\n  - a.x\n  - ", ("record", "signals"), False),
        ("record:\n  signals: [a.x,\n    ", ("record", "signals"), False),
        ("record:\n  signals: [a.x,\nmetrics:\n  e: {signal: ", ("metrics", "e", "signal"), False),
        ('requirements:\n  r: "always[0, 5](a.x < {', ("requirements", "r"), False),
        ("requirements:\n  r: >\n    always(a.x\n      < b", ("requirements", "r"), False),
        ("requirements:\n  r: always[0, 5](a.x < 1)\n  s", ("requirements",), True),
        ("title: it's 5 o'clock\nrun: {", ("run",), True),
        ("run: {stop: 1} # of {a", ("#",), False),
    ],
)
def test_half_written_texts(text, path, is_key):
    line = text.count("\n")
    found = find(text, line, len(text.split("\n")[line]))
    assert (found.path, found.is_key) == (path, is_key)


INNER = "run: {stop: 1, step: 0.1}\nblocks: {g: {block: Gain}}\ninputs: {in: g.u}\noutputs: {out: g.y}\ntitle: A gain\n"


def test_a_diagram_that_is_a_block_is_known_by_its_ports(tmp_path):
    (tmp_path / "inner.yaml").write_text(INNER)
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  a: {diagram: inner.yaml, inputs: {in: 1}}\n"
    text += "  b: {block: Gain, inputs: {u: a.out}}\n"
    bench, path = Workbench(), tmp_path / "d.yaml"
    bench.put(path, text)
    labels = {suggestion.label for suggestion in bench.suggestions(path, 3, 34)[1]}
    assert {"a.out", "a/g.y", "b.y"} <= labels
    assert [s.label for s in bench.suggestions(path, 2, 38)[1]] == ["in"]
    page = bench.page(path, 3, 34)[1]
    assert "A gain" in page and "in: in" in page and "out: out" in page
    assert str(bench.home(path, 3, 34)) == f"{tmp_path / 'inner.yaml'}:1:1"


OWN = """\
from cosim import Block, Output, Parameter, rule


class Odd(Block):
    k = Parameter(default=1.0)
    y = Output()

    def outputs(k, y):
        y[0] = k

    @rule("k is odd")
    def odd(k):
        raise SystemExit(3)
"""


def test_a_block_that_would_end_the_program_is_a_mistake(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    bench, path = Workbench(), tmp_path / "d.yaml"
    bench.put(path, "run: {stop: 1, step: 0.1}\nblocks:\n  a: {python: own.py:Odd}\n")
    (error,) = bench.reading(path).errors
    assert "asks the whole program to end: SystemExit(3)" in error.message
