"""The Tab key: what may come next, asked as shells ask, in no time, and scripts where shells look for them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.terminal import cli, completing, completion
from cosim.terminal.command_names import COMMANDS

DIAGRAM = """
run: {stop: 1, step: 0.1}
blocks:
  plant: {python: "own.py:Plant", parameters: {mass: 1, gain: {file: t.csv, column: a}}, inputs: {u: 0}}
  sensor: {python: "own.py:Sensor", inputs: {u: plant.x}}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    Path("d.yaml").write_text(DIAGRAM)
    Path("over.yaml").write_text("extends: d.yaml\nblocks: {plant: {start: {x: 1}}}\n")
    Path("own.py").write_text(
        "from cosim import Block\nclass Plant(Block):\n    pass\nclass Sensor(Block):\n    pass\n"
    )
    Path("a b").mkdir()
    Path("a b/e.yaml").write_text("")
    Path("r.nc").write_text("")
    return here


def words(line):
    return list(completing.candidates(line)[1])


def test_commands_and_options():
    assert words("cosim ") == list(COMMANDS)
    assert words("cosim ru") == ["run"]
    assert {"--help", "--version", "--install-completion"} == set(words("cosim --"))
    assert {"--engine", "--error"} <= set(words("cosim run --e"))
    assert words("cosim run d.yaml --engine ") == ["native", "python"]
    assert words("cosim keys --schema s") == ["study"]
    assert words("cosim new ") == ["block"]
    assert words("cosim nothing ") == words("cosim new block ") == []


def test_every_command_has_its_options():
    table = completing._table()
    assert set(table["commands"]) == set(COMMANDS)
    assert all("--help" in entry["options"] for entry in table["commands"].values())
    assert [name for name, entry in table["commands"].items() if not entry["arguments"]] == ["lsp"]


def test_files_by_what_a_command_takes():
    assert words("cosim run ") == ["a b/", "d.yaml", "over.yaml"]
    assert words("cosim run a") == ["a b/"]
    assert words('cosim run "a b/') == words("cosim run a\\ b/") == ["a b/e.yaml"]
    assert words("cosim compare r.nc ") == ["a b/", "r.nc"]
    assert words("cosim run d.yaml ") == []
    assert "own.py" in words("cosim run d.yaml -o ")
    assert words("cosim run nowhere/") == []


def test_keys_of_the_diagram_that_is_named_and_of_what_it_extends():
    assert {"run.", "record.", "blocks."} <= set(words("cosim run d.yaml --set "))
    assert words("cosim run d.yaml --set blocks.") == ["blocks.plant.", "blocks.sensor."]
    assert words("cosim run d.yaml --set blocks.plant.parameters.m") == ["blocks.plant.parameters.mass="]
    assert "blocks.plant.start.x=" in words("cosim check over.yaml --set blocks.plant.start.")
    assert "blocks.plant.parameters.mass=" in words("cosim check over.yaml --set blocks.plant.parameters.")
    assert "run.method=" in words("cosim run missing.yaml --set run.m")


def test_blocks_of_the_library_and_own_ones():
    assert words("cosim run d.yaml --swap pl") == ["plant="]
    assert "plant=own.py:Sensor" in words("cosim run d.yaml --swap plant=")
    assert "plant=NeuralObserver" in words("cosim run d.yaml --swap plant=Neu")
    assert words("cosim blocks Neural") == ["NeuralObserver"]
    assert words("cosim export d.yaml ") == ["plant", "sensor"]
    assert "run" in words("cosim keys ") and "study.random" in words("cosim keys study.r")


def test_broken_files_and_lines_are_no_error(capsys):
    Path("broken.yaml").write_text("blocks: [")
    Path("loop.yaml").write_text("extends: loop.yaml\n")
    for line in ("cosim run broken.yaml --set ", "cosim run loop.yaml --set ", "cosim run 'a", "", "cosim", "cosim \\"):
        assert cli.main(["--complete", "bash", line]) == 0
    assert cli.main(["--complete"]) == cli.main(["--complete", "bash"]) == 0
    assert capsys.readouterr().err == ""


def test_nothing_slow_is_imported():
    completing._table()  # which is kept from now on
    code = "import sys; from cosim.terminal import cli; cli.main(['--complete', 'bash', sys.argv[1]]); "
    code += "assert not {'numpy', 'numba', 'rich', 'h5py', 'networkx'} & set(sys.modules), sorted(sys.modules)"
    for line in ("cosim run d.yaml --set blocks.", "cosim blocks N", "cosim "):
        done = subprocess.run([sys.executable, "-c", code, line], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout


def test_a_table_of_other_files_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    first = completing._table()
    kept = tmp_path / "cache" / "completion.json"
    kept.write_text(kept.read_text().replace('"key": "', '"key": "x').replace('"run a diagram', '"stale'))
    assert completing._table() == first
    kept.write_text("{")
    assert completing._table() == first


@pytest.mark.parametrize(
    ("shell", "file"),
    [
        ("bash", ".local/share/bash-completion/completions/cosim"),
        ("zsh", ".local/share/cosim/completion.zsh"),
        ("fish", ".config/fish/completions/cosim.fish"),
    ],
)
def test_scripts_stand_where_shells_look(tmp_path, monkeypatch, capsys, shell, file):
    monkeypatch.setenv("SHELL", f"/usr/bin/{shell}")
    path = tmp_path / "home" / file
    assert cli.main(["--install-completion"]) == 0
    assert str(path) in capsys.readouterr().out
    script = path.read_text()
    assert completion.MARK in script and "cosim --complete" in script
    assert cli.main(["--install-completion", shell]) == 0  # ours may be replaced
    path.write_text("mine")
    assert cli.main(["--install-completion", shell]) == 2
    assert path.read_text() == "mine" and "not ours" in capsys.readouterr().err


@pytest.mark.parametrize("words_", [["--install-completion", "--help"], ["-h", "--install-completion", "bash"]])
def test_who_asks_for_help_installs_nothing(tmp_path, capsys, words_):
    assert cli.main(words_) == 0
    assert "usage: cosim" in capsys.readouterr().out
    assert not list((tmp_path / "home").rglob("*cosim*"))


def test_shells_that_nobody_knows(monkeypatch, capsys):
    assert cli.main(["--install-completion", "tcsh"]) == 2
    assert "no completion for `tcsh`" in capsys.readouterr().err
    monkeypatch.setenv("SHELL", "")
    assert cli.main(["--install-completion"]) == 2
    assert "$SHELL does not say" in capsys.readouterr().err


def in_shell(folder, shell, code):
    """What a shell prints after the script is loaded; `cosim` is this very one."""
    tools = folder.parent / "bin"
    tools.mkdir()
    (tools / "cosim").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m cosim "$@"\n')
    (tools / "cosim").chmod(0o755)
    environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    environment["PYTHONPATH"] = str(Path(completion.__file__).parents[2])
    script = folder.parent / "script"
    script.write_text(completion.SHELLS[shell].script)
    command = [shell, "-c", f'source "{script}"; {code}']
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False).stdout.splitlines()


@pytest.mark.skipif(not shutil.which("bash"), reason="no bash")
def test_bash_takes_what_comes_after_the_last_sign_at_which_it_breaks_words(folder):
    ask = 'for COMP_LINE in "cosim run a" "cosim run d.yaml --swap plant=own.py:S"; do COMP_POINT=${#COMP_LINE}; '
    found = in_shell(folder, "bash", ask + '_cosim 2>/dev/null; printf "%s\\n" "${COMPREPLY[@]}"; done')
    assert found == ["a\\ b/", "Sensor"]


@pytest.mark.skipif(not shutil.which("fish"), reason="no fish")
def test_fish_shows_help_beside_each_word(folder):
    found = in_shell(folder, "fish", "complete -C 'cosim ru'")
    assert found == ["run\trun a diagram and print its metrics"]
