"""What authors may write, and what they are told when a function cannot be compiled."""

import re

import pytest

from cosim import cli

HEAD = "from cosim import Block, Input, Output\nimport numpy as np\n\n\n"
BLOCK = "class Own(Block):\n    u = Input(2, start=1)\n    y = Output(2)\n\n    def outputs(u, y):\n"
MISTAKES = {
    "a name that is not defined": ("        y[0] = mystery(u[0])\n", r"mystery.*own\.py:9\)"),
    "an array that is allocated": (
        "        y[0] = (u + 1.0)[0]\n",
        r"its result is a new array, which needs memory.*own\.py:10\)",
    ),
    "a type that the compiler lacks": ("        y[0] = {'a': u}['b'].nothing\n", r"own\.py:10\)"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_cannot_be_compiled_is_named_with_its_line(tmp_path, monkeypatch, capsys, mistake):
    monkeypatch.chdir(tmp_path)
    body, words = MISTAKES[mistake]
    (tmp_path / "own.py").write_text(HEAD + BLOCK + body)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Own'}\n")
    assert cli.main(["run", "d.yaml"]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said and "d.yaml:3:15: error: block b: Own" in said
    assert re.search(words, said) and "compiled=False" in said


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
