"""Arithmetic of whole arrays in an author's function: compiled and interpreted the same bits, and numpy's figures."""

import ctypes
import importlib.util
import re
import textwrap

import numpy as np
import pytest

from cosim.authoring import authors
from cosim.authoring.block import mistakes_wait
from cosim.authoring.declaration import is_scalar, variable_of
from cosim.authoring.lowering.block_functions import lowered
from cosim.compiling import compiler
from cosim.compiling.adapters import block_source
from cosim.compiling.frame import frame_of
from cosim.compiling.interpreted.arrays import array_view
from cosim.compiling.interpreted.functions import interpreted
from cosim.compiling.interpreted.numbers import number
from cosim.machine import object_code
from cosim.terminal import cli

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)

# what is written: into y (3), Y (3, 3), q (n) or s, from u, w (3), A, B (3, 3), k, M (n, 3), v, z (n)
CASES = {
    "a sum": "y[:] = u + w",
    "a copy": "y[:] = u",
    "a state space": "y[:] = A @ u + B @ w * k",
    "nested": "y[:] = (A @ (u - w) + k) * np.sin(u) / (2.0 + np.cos(w)) - -u",
    "powers": "y[:] = u**2 + np.abs(w) ** 0.5 - abs(u)",
    "in place": "y[:] = 0.0; y += u; y *= w; y -= k; y /= 3.0",
    "a part in place": "y[:] = u; y[1:] += w[:2]; y[0] *= 2.0",
    "a product of vectors": "s[0] = u @ w + np.dot(u, w) + u.dot(w) + np.inner(u, w)",
    "a product of matrices": "Y[:] = A @ B @ A.T",
    "a vector on the left": "y[:] = u @ A",
    "a transposed product": "y[:] = A.T @ u + np.transpose(B) @ w",
    "its own content": "y[:] = u; y[:] = A @ y; y[:] = y[::-1] + y",
    "a run-time size": "q[:] = M @ u + v - 2.0 * z",
    "a run-time product": "y[:] = M.T @ v",
    "a run-time matrix": "Y[:] = M.T @ M",
    "shifted": "q[:] = v; q[1:] = v[1:] - v[:-1]; q[:-1] += z[1:]",
    "shifted in itself": "q[:] = v; q[1:] = q[:-1] + z[1:]",
    "reversed": "q[:] = v[::-1] + z; q[::2] = 0.5",
    "cut": "q[:] = v; q[:2] += v[-2:]",
    "solved": "y[:] = np.linalg.solve(A, u)",
    "solved for a matrix": "Y[:] = np.linalg.solve(A, B) + np.linalg.solve(A.T, B.T)",
    "inverted": "Y[:] = np.linalg.inv(A)",
    "an outer product": "Y[:] = np.outer(u, w) - np.outer(w, u)",
    "a cross product": "y[:] = np.cross(u, w)",
    "norms": "s[0] = np.linalg.norm(u) + np.linalg.norm(A) + np.linalg.norm(v - z)",
    "sums": "s[0] = np.sum(u) + u.sum() + np.sum(A) + sum(w) + np.mean(A) + v.mean() + np.prod(u)",
    "extremes": "s[0] = np.min(u) + np.max(w) + (u - w).max() + A.min() + max(u) + min(w)",
    "along an axis": "y[:] = np.sum(A, axis=0) + A.sum(axis=1) + np.max(B, axis=-1) + np.mean(M, axis=0)",
    "clipped": "y[:] = np.clip(u, -0.5, k) + np.minimum(u, w) + np.maximum(u, 0.0)",
    "chosen": "y[:] = np.where(u > w, u, 0) + np.where(k > 0, 1.0, w) + np.sign(u)",
    "functions": "y[:] = np.exp(u) + np.sqrt(np.abs(w)) + np.tanh(u) + np.arctan2(u, w) + np.log1p(u * u)",
    "tests": "s[0] = 1.0 if np.any(u > w) and not np.all(u > 0.0) else 0.0",
    "a count": "s[0] = np.sum(u > w)",
    "zeros": "e = np.zeros(3); e[0] = k; y[:] = e + np.ones(3) * 2 + np.full(3, k)",
    "like others": "e = np.zeros_like(v); e[0] = k; q[:] = e + np.ones_like(z) + np.zeros(v.size)",
    "the unit matrix": "Y[:] = np.eye(3) * k - A + np.diag(u)",
    "a diagonal": "y[:] = np.diag(A); s_ = np.trace(B); y += s_",
    "numbers": "y[:] = np.array([k, u[0] * 2.0, 1.0])",
    "numbers from itself": "y[:] = u; y[:] = np.array([y[2], y[0], y[1]])",
    "a matrix of numbers": "R = np.array([[np.cos(k), -k, 0.0], [np.sin(k), np.cos(k), 0.0], [0, 0, 1]]); y[:] = R @ u",
    "rows": "Y[:] = np.array([u, w, u - w])",
    "joined": "c = np.concatenate((u, w)); y[:] = c[1:4] + np.hstack((u[:2], [k]))",
    "rows and columns": "Y[:] = B; Y[0, :] = u; Y[:, 1] += w; Y[2] = A[1] + A[:, 0]",
    "brought to a matrix": "Y[:] = u[:, None] * w[None, :] + A * u + w[:, np.newaxis]",
    "brought from one row": "Y[:] = u; Y += np.array([[1.0], [2.0], [3.0]])",
    "a name again": "e = u - w; e = A @ e; e = A @ e + u; y[:] = e",
    "a name in a loop": "e = u * 1.0\n    for i in range(3):\n        e = 0.5 * (A @ e) + w\n    y[:] = e",
    "the one before": (
        "old = np.zeros(3); new = u * 1.0\n    for i in range(3):\n"
        "        newer = new + old\n        old = new\n        new = newer\n    y[:] = new + old"
    ),
    "two at once": "a = u * 2.0; b = w * 3.0; a, b = b + a, a; y[:] = a - 2.0 * b",
    "exchanged": "a = u * 2.0; b = w * 3.0; a, b = b, a; y[:] = a - 2.0 * b",
    "a branch": "e = np.zeros(3)\n    if np.linalg.norm(u) > k:\n        e = u / np.linalg.norm(u)\n    y[:] = e",
    "while": "e = u * 1.0\n    while np.linalg.norm(e) > 0.1:\n        e = e * 0.5\n    y[:] = e",
    "each": "s[0] = 0.0\n    for e in u + w:\n        s[0] += e",
    "each row": "y[:] = 0.0\n    for row in A:\n        y += row * k",
    "pairs": "s[0] = 0.0\n    for a, b in zip(u, w - u):\n        s[0] += a * b",
    "numbered": "s[0] = 0.0\n    for i, a in enumerate(A @ u):\n        s[0] += i * a",
    "a helper": "y[:] = turned(k, u) + scaled(A @ u, 2.0)",
    "a helper of several": "a, t, b = split(A, u - w); y[:] = a * t + b",
    "a tuple with a name": "p = split(A, u); y[:] = p[0] * p[1] + p[2]",
    "a helper of a run-time size": "q[:] = scaled(v + z, by=k)",
    "a helper that writes": "fill(y, k); fill(y[1:], 2.0); y += u",
    "a helper that gives a part": "y[:] = u; e = second_row(A); y += e",
    "helpers in helpers": "y[:] = twice(k, u)",
    "a helper in a loop": "e = u * 1.0\n    for i in range(2):\n        e = turned(0.1 * i, e)\n    y[:] = e",
    "sizes": "n = v.size; e = np.zeros(n + 2); e[1:-1] = v; q[:] = e[2:] - e[:-2] + len(u) + A.shape[1]",
    "whole numbers": "i = np.arange(3); y[:] = i * k + i; s_ = 0",
    "whole numbers by name": "i = np.zeros(3, dtype=int); i[1] = 2; i += i; y[:] = i * 0.5 + np.array([1, 2, 3])",
    "truth values by name": "m = u > w; m[0] = True; y[:] = np.where(m, u, w) + np.sum(m)",
    "a table of the module": "y[:] = TABLE * k + SQUARE @ u",
    "copies": "e = u.copy(); e[0] = 7.0; y[:] = e + u + np.copy(w)",
    "a part that is written": "e = u * 1.0; f = e[1:]; f[0] = 7.0; y[:] = e + u",
    "a view": "e = A[0]; f = A.T; y[:] = e + f[1] + f @ u",
    "either": "m = np.sum(u) if k > 100.0 else np.sum(w); s[0] = m",
}
HEAD = """
import numpy as np
from cosim import Block, Input, Output, Parameter

TABLE = np.array([1.0, 2.0, 3.0])
SQUARE = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]])


def turned(angle, x):
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return R @ x


def twice(angle, x):
    return turned(angle, turned(angle, x) + 1.0)


def scaled(x, by=1.0):
    if by > 1.0:
        return x * by
    return x + 1.0


def split(A, b):
    return A @ b, np.sum(b), 2.0 * b


def fill(x, value):
    x[:] = value


def filled(x, value):
    x[:] = value
    return x * 2.0


def pair(x, k):
    return x * k, x


def second_row(A):
    return A[1]


class Cases(Block):
    u = Input(3, start=0)
    w = Input(3, start=0)
    A = Parameter(3, 3, default=0)
    B = Parameter(3, 3, default=0)
    k = Input(start=0)
    M = Parameter("n", 3, default=0)
    v = Input("n", start=0)
    z = Input("n", start=0)
"""
SHAPES = {"y": "3", "Y": "3, 3", "q": '"n"', "s": ""}
ARGUMENTS = "u, w, A, B, k, M, v, z"


def written(body):
    """The name of what a case writes."""
    return next(name for name in ("y", "Y", "q", "s") if f"{name}[" in body or f"fill({name}," in body)


def block_text():
    lines = []
    for number_, body in enumerate(CASES.values()):
        name = written(body)
        lines.append(f"{name}{number_} = Output({SHAPES[name]})")
        lines.append(f"def outputs_{number_}({ARGUMENTS}, {name}{number_}):")
        lines.append(f"    {name} = {name}{number_}")
        lines += [f"    {line.removeprefix('    ')}" for line in body.split("\n")]
    return HEAD + textwrap.indent("\n".join(lines), "    ") + "\n"


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    path = tmp_path_factory.mktemp("arrays") / "array_cases.py"
    path.write_text(block_text())
    spec = importlib.util.spec_from_file_location("array_cases", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Cases


SIZES = {"n": 5}


def values():
    random = np.random.default_rng(1)
    found = {name: random.normal(size=shape) for name, shape in (("u", 3), ("w", 3), ("v", 5), ("z", 5), ("M", (5, 3)))}
    found["A"] = random.normal(size=(3, 3)) + 2.0 * np.eye(3)
    return found | {"B": random.normal(size=(3, 3)), "k": 0.7}


def memory(declaration, function):
    """Each argument and each temporary of a function, as arrays of 64-bit words."""
    found = {}
    for name in function.arguments:
        variable = variable_of(declaration, name)
        shape = [SIZES.get(size, size) for size in variable.shape]
        found[name] = np.full(shape, np.nan) if name in function.writes else np.array(values()[name]).reshape(shape)
    for temporary in lowered(declaration, function).temporaries:
        found[temporary.name] = np.zeros([size.of(SIZES) for size in temporary.kind.shape], temporary.kind.element)
    return found


def run_interpreted(declaration, function):
    there = memory(declaration, function)
    arguments = [
        number(array[()])
        if name in function.arguments and is_scalar(variable_of(declaration, name), function, name)
        else array_view(array.reshape(array.shape or (1,)))
        for name, array in there.items()
    ]
    with np.errstate(all="ignore"):
        interpreted(lowered(declaration, function).python)(*arguments)
    return next(there[name] for name in function.writes)


def run_compiled(library, declaration, function, constants):
    there = memory(declaration, function)
    arena = np.zeros(sum(array.nbytes for array in there.values()), np.uint8)
    places, at = {}, 0
    for name, array in there.items():
        arena[at : at + array.nbytes] = array.reshape(-1).view(np.uint8)
        places[name] = at, 0
        at += array.nbytes
    words = np.array(frame_of(declaration, function, constants).words(1, SIZES, places), np.int64)
    assert KERNEL(library.address(function.name))(0.0, arena.ctypes.data, words.ctypes.data) == 0
    (name,) = function.writes
    return arena[places[name][0] :][: there[name].nbytes].view(float).reshape(there[name].shape)


def run_as_numpy_does(function, declaration):
    there = {name: np.array(value) for name, value in values().items()}
    (name,) = function.writes
    shape = [SIZES.get(size, size) for size in declaration.variables[name].shape]
    result = np.full(shape or [1], np.nan)
    there |= {"k": 0.7, name: result}
    function.python(*[there[a] for a in function.arguments])
    return result.reshape(shape)


@pytest.mark.parametrize("constants", [{}, SIZES], ids=["run-time sizes", "constant sizes"])
def test_engines_agree_to_the_bit_and_with_numpy(cases, constants):
    declaration = cases.declaration
    sources = [block_source(declaration, function, constants) for function in declaration.functions]
    library = object_code.Library(compiler.compile_object("cases", sources))
    for case, function in zip(CASES, declaration.functions, strict=True):
        compiled = run_compiled(library, declaration, function, constants)
        assert compiled.tobytes() == run_interpreted(declaration, function).tobytes(), case
        # rounding errors of sums of 5 terms of size 10, behind a matrix whose condition is below 100
        np.testing.assert_allclose(
            compiled, run_as_numpy_does(function, declaration), rtol=1e-12, atol=1e-13, err_msg=case
        )


#: What is refused where it is declared: (statements, what is said, the fix, column)
REFUSED = {
    "two shapes": ("y[:] = u + np.ones(2)", r"shapes \(3,\) and \(2,\) in `u \+ np.ones\(2\)`", "slice", 16),
    "shapes behind a dimension": ("q[:] = v + v[1:]", r"shapes \(n,\) and \(n - 1,\)", "slice", 16),
    "a product": ("y[:] = M @ u[:2]", r"multiplies arrays of shapes \(n, 3\) and \(2,\)", "last axis", 16),
    "a product the wrong way": ("y[:] = A @ np.zeros((2, 3))", r"shapes \(3, 3\) and \(2, 3\)", "last axis", 16),
    "too long for its place": ("y[:2] = u", r"shape \(3,\) where one of shape \(2,\)", "slice", 9),
    "a matrix in a vector": ("y[:] = A", r"shape \(3, 3\) where one of shape \(3,\)", "", 9),
    "a vector for a number": ("s[0] = u", r"shape \(3,\) where one number", "element", 9),
    "a vector as a truth value": ("if u > w: y[0] = 1.0", "the array `u > w` where a number", "np.any", 12),
    "another shape": (
        "e = u * 1.0; e = u[:2] * 1.0; y[0] = e[0]",
        r"shape \(2,\) where one of shape \(3,\)",
        "slice",
        22,
    ),
    "another kind": ("e = u * 1.0; e = k; y[0] = e", "`e` to an array and to a number", "name for each", 22),
    "on one path": ("if k > 0: e = u * 1.0\n        y[:] = e", "may read `e` before it has a value", "every path", 16),
    "a choice of arrays": ("y[:] = u if k > 0.0 else w", "chooses between arrays in `u if k > 0.0", "np.where", 16),
    "a loop over arrays": ("for a in (u, w): y[:] = a", r"loops over the arrays in `\(u, w\)`", "helper", 18),
    "a size of a run": ("y[:] = np.zeros(int(k))", r"size `int\(k\)` is known only", "np.zeros", 25),
    "a mask": ("y[:] = u[u > 0.0]", "the elements that `u > 0.0` says", "np.where", 18),
    "a function of numbers": ("y[0] = math.sin(u)", "gives an array to `sin`", "np.sin", 16),
    "ragged rows": ("Y[:] = np.array([[1.0, 2.0], [1.0]])", "not equally long", "as many", 16),
    "two names for one": (
        "e = u * 1.0\n        for i in range(2):\n            e = e * 2.0\n        f = e; f[0] = 7.0; y[:] = e + f",
        "makes `f` another name for memory of `e`",
        "copy",
        9,
    ),
    "a part of what a loop makes": (
        "y[:] = 0.0\n        for i in range(2):\n            e = u * i; f = e[1:]; f[0] = 7.0; y += e",
        "makes `f` another name for memory of `e`",
        "copy",
        24,
    ),
    "a helper that writes inside": ("y[:] = u + filled(y, k)", r"calls filled\(\), which writes `x`", "its own", 20),
    "what numpy has more": ("y[:] = np.cumsum(u)", r"calls `np.cumsum\(\)`", "loop", 16),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_lowered_is_said_with_its_place(tmp_path, case):
    body, words, fix, column = REFUSED[case]
    (tmp_path / "own.py").write_text(refused_text(body))
    spec = importlib.util.spec_from_file_location("own", tmp_path / "own.py")
    module = importlib.util.module_from_spec(spec)
    with mistakes_wait():
        spec.loader.exec_module(module)
    begin = (tmp_path / "own.py").read_text().splitlines().index(f"    def outputs({ARGUMENTS}, y, Y, q, s):") + 1
    (said,) = [m for m in authors.mistakes(module.Own.declaration) if m.position.line > begin]  # y may be unwritten
    assert re.search(words, said.message), said
    assert fix in said.fix and said.position.column == column
    assert said.position.line == begin + 1 + body.count("\n")  # the last line


def test_what_a_helper_does_is_said_where_it_does_it(tmp_path):
    (tmp_path / "own.py").write_text(text := refused_text("a, b = pair(u, k); y[:] = a + b"))
    spec = importlib.util.spec_from_file_location("own", tmp_path / "own.py")
    module = importlib.util.module_from_spec(spec)
    with mistakes_wait():
        spec.loader.exec_module(module)
    first = authors.mistakes(module.Own.declaration)[0]
    assert first.position.line == text.splitlines().index("    return x * k, x") + 1
    assert "pair(), called by Own.outputs(): returns a part of its argument `x`" in first.message


def refused_text(body):
    declared = HEAD[: HEAD.index("class Cases")].replace("import numpy", "import math\nimport numpy")
    inputs = HEAD[HEAD.index("    u = ") :]
    outputs = '    y = Output(3)\n    Y = Output(3, 3)\n    q = Output("n")\n    s = Output()\n'
    return f"{declared}class Own(Block):\n{inputs}{outputs}    def outputs({ARGUMENTS}, y, Y, q, s):\n        {body}\n"


@pytest.mark.parametrize("engine", ["native", "python"])
def test_sizes_that_only_a_run_knows_are_compared_in_both_engines(tmp_path, monkeypatch, capsys, engine):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Input, Output\n\nclass Own(Block):\n"
        "    a = Input('n', start=1)\n    b = Input('m', start=1)\n    y = Output('n')\n"
        "    def outputs(a, b, y):\n        y[:] = a + 2.0 * b\n"
    )
    for sizes, code in (("{n: 3, m: 3}", 0), ("{n: 3, m: 2}", 1)):
        (tmp_path / "d.yaml").write_text(
            f"run: {{stop: 1, step: 1}}\nblocks:\n  b: {{python: 'own.py:Own', dimensions: {sizes}}}\n"
        )
        assert cli.main(["run", "d.yaml", "--engine", engine]) == code
    said = capsys.readouterr().err
    assert "ValueError: an array of size 3 does not fit one of size 2 (own.py:8)" in said and "block b" in said


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_singular_matrix_ends_the_run(tmp_path, monkeypatch, capsys, engine):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "import numpy as np\nfrom cosim import Block, Output, Parameter\n\nclass Own(Block):\n"
        "    A = Parameter(2, 2, default=1)\n    y = Output(2)\n"
        "    def outputs(A, y):\n        y[:] = np.linalg.solve(A, np.ones(2))\n"
    )
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks:\n  b: {python: 'own.py:Own'}\n")
    assert cli.main(["run", "d.yaml", "--engine", engine]) == 1
    said = capsys.readouterr().err
    assert "ValueError: the matrix given to np.linalg.solve is singular (own.py:8)" in said


def test_an_edited_helper_takes_effect(tmp_path, monkeypatch, capsys):
    """The key of compiled code covers helpers that are lowered, and what they call."""
    monkeypatch.chdir(tmp_path)
    text = (
        "import numpy as np\nfrom cosim import Block, Output\n\ndef inner(x):\n    return x * 2.0\n\n"
        "def helper(x):\n    return inner(x) + np.ones(2)\n\nclass Own(Block):\n    y = Output(2)\n"
        "    def outputs(y):\n        y[:] = helper(np.array([1.0, 2.0]))\n"
    )
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 1, step: 1}\nblocks:\n  b: {python: 'own.py:Own'}\nmetrics: {y: {signal: b.y, reduce: final}}\n"
    )
    for old, new, wanted in (("", "", "[3.0, 5.0]"), ("x * 2.0", "x * 3.0", "[4.0, 7.0]")):
        (tmp_path / "own.py").write_text(text.replace(old, new) if old else text)
        assert cli.main(["run", "d.yaml", "--json"]) == 0
        assert f'"y": {wanted}' in capsys.readouterr().out
