"""What a new block may be called, and the names of its class and file."""

from pathlib import Path

import pytest

from cosim.errors import UsageError
from cosim.project import new_block
from cosim.terminal import cli


@pytest.mark.parametrize(
    ("name", "class_", "module"),
    [
        ("ServoMotor", "ServoMotor", "servo_motor"),
        ("servo_motor", "ServoMotor", "servo_motor"),
        ("DCMotor", "DCMotor", "dc_motor"),
        ("PID2", "PID2", "pid2"),
        ("lag", "Lag", "lag"),
        ("lead_2nd", "Lead2nd", "lead_2nd"),
    ],
)
def test_names(name, class_, module):
    assert new_block.class_and_file(name) == (class_, module)


@pytest.mark.parametrize(
    ("name", "said", "fix"),
    [
        ("time", "would hide the module `time`", "TimeBlock"),
        ("Random", "would hide the module `random`", "RandomBlock"),
        ("numpy", "would hide the module `numpy`", "NumpyBlock"),
        ("class", "a word of Python's own", "ClassBlock"),
        ("None", "a word of Python's own", "NoneBlock"),
        ("Input", "blocks are written with `Input`", "MyInput"),
        ("state", "blocks are written with `State`", "MyState"),
        ("two words", "cannot be called 'two words'", "TwoWords"),
        ("../evil", "cannot be called", "Evil"),
        ("a.py", "cannot be called", "APy"),
        ("größe", "cannot be called", "ServoMotor"),
        ("1st", "cannot be called", "St"),
        ("_hidden", "cannot be called", "Hidden"),
        ("", "cannot be called", "ServoMotor"),
        ("nul", "cannot be called `nul.py`", "NulBlock"),
        ("x" * 300, "cannot be called", "Block"),
    ],
)
def test_names_that_cannot_be(tmp_path, monkeypatch, name, said, fix):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError) as caught:
        new_block.write(name, Path("blocks"))
    assert said in caught.value.message and fix in caught.value.fix
    assert list(tmp_path.iterdir()) == []


def test_a_block_is_written_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "block", "Servo"]) == 0
    Path("blocks/servo.py").write_text("mine")
    assert cli.main(["new", "block", "servo"]) == 2
    assert "already" in capsys.readouterr().err
    Path("blocks/servo.py").unlink()
    assert cli.main(["new", "block", "Servo"]) == 2  # its test is there
    assert not Path("blocks/servo.py").exists()
