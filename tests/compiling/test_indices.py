"""An author's function cannot read or write outside its arrays, whoever runs it, and says where it tried to."""

import re

import pytest

from cosim.authoring import authors
from cosim.engine import compilation
from cosim.terminal import cli

HEAD = """import numpy as np
from cosim import Block, Input, Output, Parameter, State

TABLE = np.array([1.0, 2.0, 3.0])


def put(array, index):
    array[index] = 7.0


def put_last(array, index=2):
    put(array, index)


class Own(Block):
    k = Parameter(dtype=int, default=0)
    u = Input(3, start=1)
    m = Input(3, 2, start=1)
    j = Input(dtype="uint8", start=0)
    y = Output(2)
    z = Output(3, 2)

    def outputs_z(m, z):
        for i in range(3):
            for q in range(2):
                z[i, q] = m[i, q]

    def outputs(k, u, m, j, y):
        y[0] = y[1] = u[0]
"""
LINE = HEAD.count("\n") + 1

# what is attempted: (the statement, k, what is said: index, axis, array, size)
OUTSIDE = {
    "a read": ("y[1] = u[k]", 3, (3, 0, "`u`", 3)),
    "a write": ("y[k] = 1.0", 2, (2, 0, "`y`", 2)),
    "a read and a write": ("y[k] += 1.0", 2, (2, 0, "`y`", 2)),
    "far outside": ("y[k] = 1.0", 10**9, (10**9, 0, "`y`", 2)),
    "as far as can be": ("y[k] = 1.0", 2**63 - 1, (2**63 - 1, 0, "`y`", 2)),
    "below the first": ("y[k] = 1.0", -3, (-3, 0, "`y`", 2)),
    "far below the first": ("y[k] = 1.0", -(2**63), (-(2**63), 0, "`y`", 2)),
    "the first axis": ("y[1] = m[k, 1]", 3, (3, 0, "`m`", 3)),
    "the second axis": ("y[1] = m[1, k]", 2, (2, 1, "`m`", 2)),
    "the second axis from its end": ("y[1] = m[1, k]", -3, (-3, 1, "`m`", 2)),
    "a row": ("row = m[k]; y[1] = row[0]", 3, (3, 0, "`m`", 3)),
    "in a row": ("row = m[1]; y[1] = row[k]", 2, (2, 0, "`row`", 2)),
    "in a row at once": ("y[1] = m[1][k]", 2, (2, 0, "an array", 2)),
    "in a slice": ("part = u[1:3]; y[1] = part[k]", 2, (2, 0, "`part`", 2)),
    "in an empty slice": ("part = u[3:]; y[1] = part[k]", 0, (0, 0, "`part`", 0)),
    "in a slice backwards": ("part = u[::-1]; y[1] = part[k]", 3, (3, 0, "`part`", 3)),
    "in a loop too long": ("for q in range(k): y[q] = 1.0", 3, (2, 0, "`y`", 2)),
    "a table": ("y[1] = TABLE[k]", 3, (3, 0, "`TABLE`", 3)),
    "a column": ("column = m[:, 1]; y[1] = column[k]", 5, (5, 0, "`column`", 3)),
    "a transposed view": ("y[1] = m.T[k, 0]", 2, (2, 0, "an array", 2)),
    "a narrow index": ("y[j + 2] = 1.0", 0, (2, 0, "`y`", 2)),
}
INSIDE = {
    "the last": ("y[k] = u[k]", 1),
    "counted from the end": ("y[k] = u[k]", -2),
    "a slice is cut to the array": ("part = u[1:k]; y[1] = part[part.size - 1]", 10**9),
    "an empty slice": ("part = u[k:]; y[1] = part.size", 7),
    "a loop that is not entered": ("for q in range(k): y[q + 5] = 1.0", -1),
    "a loop backwards": ("for q in range(1, k, -1): y[q] = u[q]", -1),
    "a helper": ("put(y, k)", -1),
}


@pytest.fixture
def ends(tmp_path, monkeypatch, capsys):
    """Run a body with a parameter k by an engine; returns the exit code and all that is said.

    What the source shows is not looked at, nor compiled for the interpreter: this is about what stands behind.
    """
    monkeypatch.setattr(authors, "mistakes", lambda *_, **__: [])
    monkeypatch.setattr(authors, "check", lambda *_: None)

    def run(body: str, k: int, engine: str, more: str = "", head: str = HEAD):
        if engine == "python":
            monkeypatch.setattr(compilation, "compile_program", lambda table: None)
        monkeypatch.chdir(tmp_path)
        (tmp_path / "own.py").write_text(head + f"        {body}\n")
        (tmp_path / "d.yaml").write_text(
            f"run: {{stop: 0.2, step: 0.1}}\nblocks:\n  b: {{python: 'own.py:Own', parameters: {{k: {k}}}}}\n{more}"
        )
        code = cli.main(["run", "d.yaml", "--engine", engine, "--json"])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out + err

    return run


engines = pytest.mark.parametrize("engine", ["native", "python"])


@engines
@pytest.mark.parametrize("attempt", OUTSIDE)
def test_an_index_out_of_bounds_is_named(ends, engine, attempt):
    body, k, (index, axis, array, size) = OUTSIDE[attempt]
    code, said = ends(body, k, engine)
    assert code == 1
    place = rf"index {index} is out of bounds for axis {axis} of {array}, size {size} \(own\.py:{LINE}\)"
    assert re.search(rf"block b: outputs\(\) failed at t = 0 s: IndexError: {place}", said), said


@engines
@pytest.mark.parametrize("attempt", INSIDE)
def test_what_is_within_bounds_runs(ends, engine, attempt):
    body, k = INSIDE[attempt]
    code, said = ends(body, k, engine)
    assert code == 0, said


@engines
@pytest.mark.parametrize("helper", ["put(y, k)", "put_last(y)"])
def test_a_helper_is_checked_as_well(ends, engine, helper):
    code, said = ends(helper, 2, engine)
    assert code == 1 and "IndexError: index 2 is out of bounds for axis 0 of `array`, size 2 (own.py:8)" in said


@engines
@pytest.mark.parametrize(
    "body", ["np.add(u, u, y)", "np.multiply(u, 2.0, y)", "y += u", "y *= u", "part = y[:1]; part += u"]
)
def test_arrays_of_different_shapes_do_not_meet(ends, engine, body):
    code, said = ends(body, 0, engine)
    assert code == 1 and re.search(rf"outputs\(\) failed at t = 0 s: ValueError: .*\(own\.py:{LINE}\)", said), said


@engines
@pytest.mark.parametrize("body", ["np.add(u[1:], u[:2], y)", "y += u[k:]", "y += u[:1]", "y += m[1]"])
def test_arrays_of_one_shape_do(ends, engine, body):
    assert ends(body, 1, engine)[0] == 0


@engines
@pytest.mark.parametrize(
    "body", ["u[0] = 1.0", "put(u, 0)", "m[0][0] = 1.0", "u += 1.0", "u.fill(1.0)", "np.add(y, y, u)", "TABLE[0] = 1.0"]
)
def test_inputs_cannot_be_written(ends, engine, body):
    code, said = ends(body, 0, engine)
    assert code == (2 if engine == "native" else 1)
    words = r"own\.py:\d+:\d+: error: .* may only read" if engine == "native" else r"read-only.*own\.py:\d+\)"
    assert re.search(words, said), said


@pytest.mark.parametrize("body", ["y.flat[k] = 1.0", "y[1] = u.flat[k]"])
def test_what_cannot_be_checked_is_not_compiled(ends, body):
    code, said = ends(body, 0, "native")
    assert code == 2 and f"own.py:{LINE}:" in said


@engines
def test_an_author_may_catch_it(ends, engine):
    body = "try:\n            y[k] = 5.0\n        except Exception:\n            y[1] = 7.0"
    code, said = ends(body, 9, engine, "metrics: {last: {signal: b.y, reduce: final}}\n")
    assert code == 0 and '"last": [1.0, 7.0]' in said, said


@engines
def test_a_block_that_stays_python_tells_it_too(ends, engine):
    code, said = ends("y[k] = 1.0", 2, engine, head=HEAD.replace("Own(Block)", "Own(Block, compiled=False)"))
    assert code == 1 and f"index 2 is out of bounds for axis 0 of `y`, size 2 (own.py:{LINE})" in said


def test_what_stands_behind_an_array_is_not_touched(ends):
    """The old way: the write lands in the next variable."""
    body = "y[0] = 5.0\n        if k > 0:\n            y[k + 8] = 1e9"
    code, said = ends(body, 2, "native", "metrics: {last: {signal: b.z, reduce: final}}\n")
    assert code == 1 and "index 10" in said and "1000000000" not in said.replace("1e9", "")


@engines
def test_the_member_of_a_fleet_is_named(tmp_path, monkeypatch, capsys, engine):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(HEAD + "        y[k] = 1.0\n")
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 0.2, step: 0.1}\nfleets: {robot: 3}\n"
        "blocks:\n  b: {python: 'own.py:Own', per: robot, parameters: {k: [0, 2, 1]}}\n"
    )
    assert cli.main(["run", "d.yaml", "--engine", engine]) == 1
    assert "outputs() of robot 2 failed at t = 0 s: IndexError: index 2" in " ".join(capsys.readouterr().err.split())


RAISING = """from cosim import Block, Output, State


class Own(Block):
    x = State(start=1.0, output=True)

    def derivatives(time, x, d_x):
        if time > 0.22:
            {statement}
        d_x[0] = 1.0
"""


@engines
@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("raise ValueError('100 % late')", "ValueError: 100 % late"),
        ("raise RuntimeError", "RuntimeError"),
        ("assert time < 0.1, 'too late'", "AssertionError: too late"),
        ("d_x[3] = x", "IndexError: index 3 is out of bounds for axis 0 of `d_x`, size 1"),
    ],
)
def test_an_exception_in_a_stage_is_told_as_it_was_raised(tmp_path, monkeypatch, capsys, engine, statement, words):
    """The stages of the third step are at 0.2, 0.25, 0.25 and 0.3 s; a call anew at 0.2 s would raise nothing."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(RAISING.format(statement=statement))
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 1, step: 0.1, integrator: rk4}\nblocks:\n  b: {python: 'own.py:Own'}\n"
    )
    assert cli.main(["run", "d.yaml", "--engine", engine]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert f"block b: derivatives() failed at t = 0.25 s: {words} (own.py:9)" in said


def test_the_engines_refuse_a_dimension_of_zero(tmp_path, monkeypatch, capsys):
    """Kernels are compiled for sizes from 1."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter\n\n\nclass Own(Block):\n    p = Parameter('n', default=[1])\n"
        "    y = Output()\n\n    def outputs(p, y):\n        y[0] = p[0]\n"
    )
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Own', parameters: {p: []}}\n"
    )
    assert cli.main(["check", "d.yaml"]) == 2
    assert "d.yaml:3:45: error: block b: `p` has an axis of 0 elements" in capsys.readouterr().err
