"""What authors may write, and what they are told when a function cannot be compiled."""

import json
import re
import subprocess
import sys

import pytest

from cosim.terminal import cli

HEAD = "from cosim import Block, Input, Output\nimport math\nimport numpy as np\n\nTABLE = {'a': 1.0}\n\n"
BLOCK = "class Own(Block):\n    u = Input(2, start=1)\n    s = Input(start=1.0)\n    y = Output(2)\n\n"
BLOCK += "    def outputs(u, s, y):\n        y[1] = s\n"
HELPER = "def helper(a):\n    return a[0] + a.width\n\n\n"
# By name: a statement, then words, fix and column of what is said of it.
MISTAKES = {
    "an array of another shape": ("y[:] = u[:1] + np.ones(3)", r"shape \(3,\) where one of shape \(2,\)", "slice", 9),
    "arrays of two shapes": ("y[:] = s * (u + np.ones(3))", r"shapes \(2,\) and \(3,\) in `u \+ np.ones\(3\)`", "", 21),
    "a product of two shapes": ("y[:] = np.eye(3) @ u", r"shapes \(3, 3\) and \(2,\) in `np.eye\(3\) @ u`", "axis", 16),
    "a size of a run": ("y[:] = np.zeros(int(s))", r"whose size `int\(s\)` is known only", "np.zeros", 25),
    "an array for a truth value": ("y[0] = 1.0 if u > s else 0.0", "the array `u > s` where", "np.any", 23),
    "a dictionary of the module": ("y[0] = TABLE['a']", "uses `TABLE` of the module, .* `dict`", "number, a tuple", 9),
    "an array for a number": ("y[0] = u", "where one number has its place", r"y\[0\] = …\[0\]", 9),
    "a function of numbers": ("y[0] = math.sin(u)", "gives an array to `sin`, which takes numbers", "np.sin", 16),
    "an attribute of a number": ("y[0] = s.size", "asks a number for `.size`", "shape", 9),
    "an attribute of an array": ("y[0] = u.length", "asks an array for `.length`", "loops", 9),
    "too many indices": ("y[0] = u[0, 1]", r"takes `u\[0, 1\]` of an array of shape \(2,\)", "one index", 16),
    "an index that is no integer": ("y[s] = 1.0", "index that is no whole number", r"int\(…\)", 9),
    "kinds that do not unify": (
        "y[0] = s > 1.0 and (s, s)",
        "values of two kinds: a truth value and a tuple",
        "name",
        9,
    ),
    "a loop over a number": ("for q in u.size: y[q] = s", "loops over a number", "range", 9),
    "what the compiler lacks": ("y[0] = math.sqrt(s, 2)", "cannot be compiled", "compiled=False", 9),
}


def diagram(folder, *blocks):
    """A diagram of block types of own.py."""
    lines = "".join(f"  b{k}: {{python: 'own.py:{name}'}}\n" for k, name in enumerate(blocks))
    (folder / "d.yaml").write_text(f"run: {{stop: 1, step: 0.1}}\nblocks:\n{lines}")
    return "d.yaml"


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_cannot_be_compiled_is_named_with_its_line(tmp_path, monkeypatch, capsys, mistake):
    monkeypatch.chdir(tmp_path)
    statement, words, fix, column = MISTAKES[mistake]
    text = f"{HEAD}{BLOCK}        {statement}\n"
    if not statement.startswith(("y[0]", "y[:]")):
        text += "        y[0] = s\n"
    (tmp_path / "own.py").write_text(text)
    line = text.splitlines().index(f"        {statement}") + 1
    for command in ("check", "run"):
        assert cli.main([command, diagram(tmp_path, "Own")]) == 2
        said = capsys.readouterr().err
        assert "Traceback" not in said and "NRT" not in said and "numba" not in said.lower()
        assert re.search(rf"own\.py:{line}:{column}: error: (block b0: )?Own\.outputs\(\):? .*{words}", said), said
        assert re.search(f"fix: .*{fix}", said), said


def test_all_functions_of_all_blocks_are_named_at_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first = BLOCK.replace("Own", "First") + "        y[0] = u.width\n\n"
    first += "    def start(u):\n        a = u.length\n\n"
    second = BLOCK.replace("Own", "Second") + "        y[0] = helper(u)\n        y[:] = u.width\n"
    (tmp_path / "own.py").write_text(HEAD + HELPER + first + "\n" + second)
    assert cli.main(["check", diagram(tmp_path, "First", "Second", "First")]) == 2
    said = capsys.readouterr().err
    places = re.findall(r"^own\.py:(\d+):\d+: error: block (\w+): (\S+)", said, re.MULTILINE)
    # Of each function the first mistake that the compiler meets; a helper's stands where the helper does.
    assert sorted((block, function) for _, block, function in places) == [
        ("b0", "First.outputs()"),
        ("b0", "First.start()"),
        ("b1", "Second.outputs()"),
    ]
    lines = {function: int(line) for line, _, function in places}
    assert (lines["First.outputs()"], lines["First.start()"]) == (18, 21) and lines["Second.outputs()"] in (8, 31, 32)
    assert said.count("3 errors") == 1


def test_a_check_with_all_kernels_in_the_cache_does_without_the_compiler(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(f"{HEAD}{BLOCK}        y[0] = s\n")
    path = tmp_path / diagram(tmp_path, "Own")
    program = "import sys, json; from cosim.terminal import cli; code = cli.main(sys.argv[1:]); "
    program += "print(json.dumps([code, 'numba' in sys.modules]))"
    told = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", program, "check", path], capture_output=True, text=True, check=True
        )
        told.append(json.loads(done.stdout.splitlines()[-1]))
    assert told[1] == [0, False]


def test_helpers_and_constants_are_compiled_with_the_function(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    helper = "import math\n\nSCALE = 3.0\n\n\ndef twice(value):\n    return 2.0 * value\n\n\n"
    helper += "def scaled(value):\n    return SCALE * twice(math.sqrt(value))\n\n\n"
    (tmp_path / "own.py").write_text(HEAD + helper + BLOCK + "        y[0] = scaled(u[0])\n        y[1] = u[1]\n")
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 0.1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Own', start: {u: [4, 5]}}\n"
        "metrics: {last: {signal: b.y, reduce: final}}\n"
    )
    for _ in range(2):
        assert cli.main(["run", "d.yaml", "--json"]) == 0
        assert '"last": [12.0, 5.0]' in capsys.readouterr().out
        # The cache is keyed by the bytecode of all that is reached: an edited helper takes effect on the next run.
    (tmp_path / "own.py").write_text((tmp_path / "own.py").read_text().replace("SCALE = 3.0", "SCALE = 5.0"))
    assert cli.main(["run", "d.yaml", "--json"]) == 0
    assert '"last": [20.0, 5.0]' in capsys.readouterr().out
