"""A project begins with files that run, and nothing that is there is touched."""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from cosim.errors import Problems
from cosim.language import source
from cosim.terminal import cli
from cosim.terminal.command_names import COMMANDS
from tests.conftest import BLOCKS

ROOT = Path(__file__).parents[2]


def run_tests(folder):
    """What pytest says of a folder, where nothing of the clone is found but `cosim` itself."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", ["plant", "my prójeĉt"])
def test_a_fresh_project_runs(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", name]) == 0
    assert "cosim run diagrams/motor.yaml" in capsys.readouterr().out
    monkeypatch.chdir(name)
    assert Path("README.md").read_text().startswith(f"# {name}\n")
    assert cli.main(["run", "diagrams/motor.yaml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["metrics"]["speed_at_end"] == pytest.approx(8 * 10 / 9, rel=1e-6)
    assert cli.main(["study", "studies/gains.yaml", "--json"]) == 0
    assert cli.main(["blocks"]) == 0
    assert "blocks/motor.py: The motor.\n  Motor  A motor" in capsys.readouterr().out
    for word in Path("README.md").read_text().split("`"):
        if word.endswith(("/", ".yaml", ".py")) and " " not in word:
            assert Path(word).exists(), word


def test_folders_of_odd_names(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", ""]) == 2
    assert "has no name" in capsys.readouterr().err and list(tmp_path.iterdir()) == []
    assert cli.main(["init", "--", "-x"]) == 0
    assert "cd ./-x" in capsys.readouterr().out
    assert cli.main(["init", "two\nlines"]) == 0
    assert Path("two\nlines/README.md").read_text().startswith("# two lines\n")


def test_its_tests_and_those_of_a_new_block_pass(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "."]) == 0
    assert cli.main(["new", "block", "ServoMotor"]) == 0
    assert cli.main(["new", "block", "lead_lag", "--folder", "deep/own 'blocks'"]) == 0
    assert "python: deep/own 'blocks'/lead_lag.py:LeadLag" in capsys.readouterr().out
    done = run_tests(tmp_path)
    assert done.returncode == 0 and "4 passed" in done.stdout, done.stdout


def test_nothing_is_replaced(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    Path("there/README.md").write_text("mine")
    assert cli.main(["init", "there"]) == 2
    assert "`there/README.md` is there already" in capsys.readouterr().err
    assert [path.name for path in Path("there").iterdir()] == ["README.md"]
    Path("other").mkdir()
    Path("other/notes.txt").write_text("mine")
    assert cli.main(["init", "other"]) == 0
    assert Path("other/notes.txt").read_text() == "mine"
    Path("dangling").mkdir()
    Path("dangling/README.md").symlink_to(tmp_path / "nowhere")
    assert cli.main(["init", "dangling"]) == 2
    assert not (tmp_path / "nowhere").exists()


def test_what_was_written_is_removed_where_the_rest_cannot_be(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("blocks").write_text("a file, not a folder")
    assert cli.main(["init", "."]) == 2
    assert "blocks" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["blocks"]
    assert cli.main(["new", "block", "Servo"]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["blocks"]


def test_a_file_for_which_there_is_no_space_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "cosim", "init", "own"]
    limited = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))}
    done = subprocess.run(command, capture_output=True, text=True, check=False, **limited)
    assert done.returncode == 2 and done.stderr.startswith("error: own/") and "File too large" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_editor_knows_the_keys(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "."]) == 0
    settings = json.loads(Path(".vscode/settings.json").read_text())
    assert all(Path(schema).exists() for schema in settings["yaml.schemas"])
    server = [settings["glspc.server.command"], *settings["glspc.server.commandArguments"]]
    assert server[0] == "cosim" and server[1] in COMMANDS
    capsys.readouterr()
    for name in ("diagram", "study"):
        assert cli.main(["keys", "--schema", name]) == 0
        assert capsys.readouterr().out == Path(f".vscode/{name}.schema.json").read_text()


def misfits(schema, value):
    """Where a value does not keep a schema."""
    return sorted({error.json_path.removeprefix("$") for error in Draft7Validator(schema).iter_errors(value)})


def schema_of(name, capsys):
    capsys.readouterr()
    assert cli.main(["keys", "--schema", name]) == 0
    return json.loads(capsys.readouterr().out)


FENCE = re.compile(r"^```yaml.*?\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_every_shipped_diagram_and_study_keeps_the_schema(tmp_path, capsys):
    """And those of the pages."""
    kinds = {kind: schema_of(kind, capsys) for kind in ("diagram", "study")}
    files = [path for path in (ROOT / "diagrams").rglob("*.yaml") if "results" not in path.relative_to(ROOT).parts]
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    for number, text in enumerate(text for page in pages for text in FENCE.findall(page.read_text("utf-8"))):
        files.append(tmp_path / f"{number}.yaml")
        files[-1].write_text(text)
    assert len(files) > 60
    for path in files:
        tree = source.read(path, Problems())
        kind = "study" if "diagram" in tree.value else "diagram"
        assert misfits(kinds[kind], tree.plain()) == [], path


def test_the_schema_finds_slips_and_lets_overlays_add_and_take_away(capsys):
    schema = schema_of("diagram", capsys)
    block = {"python": f"{BLOCKS}:Lag", "inputs": {"u": 0}, "parameters": {"T": {"file": "t.csv", "column": "T"}}}
    assert misfits(schema, {"blocks": {"a": block}, "record": {"signals+": ["a.x"]}, "run": {"method": None}}) == []
    assert misfits(schema, {"blokcs": {}}) == [""] and misfits(schema, {"run": {"method": "jacoby"}}) == [".run.method"]
    for wrong in ({"stop": 0}, {"inner_steps": 0}, {"tolerance": 1}, {"extrapolation": 3}, {"rollback": "no"}):
        assert misfits(schema, {"run": wrong}) == [f".run.{next(iter(wrong))}"], wrong
    assert misfits(schema, {"run": {"stop": "2*pi", "inner_steps": 3, "tolerance": 1e-6, "extrapolation": 2}}) == []


def test_the_schema_knows_what_each_block_takes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "."]) == 0
    schema = schema_of("diagram", capsys)

    def wrong(**block):
        return misfits(schema, {"blocks": {"a": block}})

    assert wrong(block="PID", parameters={"k_p": 1, "k_x": None}, inputs={"r": 1}, start={"i": 0}) == []
    assert wrong(block="PIDD") == [".blocks.a.block"]
    assert wrong(block="cosim:PID", parameters={"any": 1}) == []  # which pack that is, the check knows
    assert wrong(block="PID", parameters={"k_q": 1}) == [".blocks.a.parameters.k_q"]
    assert wrong(block="PID", inputs={"u": "b.y"}) == [".blocks.a.inputs.u"]
    own = "../blocks/motor.py:Motor"
    assert wrong(python=own, inputs={"voltage": "b.y"}) == []
    assert wrong(python=own, inputs={"uu": "b.y"}) == [".blocks.a.inputs.uu"]
    names = schema["definitions"]["block_types"]["properties"]["python"]["anyOf"][0]["enum"]
    assert names == [own, "../blocks/proportional_controller.py:ProportionalController"]
