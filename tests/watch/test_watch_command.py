"""The command `cosim watch`: how it begins, what it refuses, and how it ends."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.terminal.cli import main
from tests.watch.conftest import Watch, until


def children(number: int) -> list[int]:
    """The processes that a process has started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        if int(rest.split()[1]) == number:
            found.append(int(name.split()[0]))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_and_leaves_nothing(lag, tmp_path, monkeypatch, number, code):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    with Watch(lag, "lag.yaml") as watch:
        until(lambda: children(watch.process.pid))
        until(lambda: list(folder.glob("cosim-watch-*")))
        started = children(watch.process.pid)
        ended, told = watch.stop(number)
    assert ended == code and told.strip() == f"interrupted by {signal.Signals(number).name}"
    assert list(folder.glob("cosim-watch-*")) == []
    until(lambda: not any(Path(f"/proc/{one}").exists() for one in started))


def test_a_port_in_use_is_told(lag, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["watch", str(lag / "lag.yaml"), "--no-browser", "--port", str(port)]) == 2
    told = capsys.readouterr().err
    assert f"cannot listen on port {port}" in told and "fix: --port 0" in told


@pytest.mark.parametrize("port", ["-1", "65536", "99999999999999999999", "x"])
def test_what_is_no_port_is_told(lag, capsys, port):
    assert main(["watch", str(lag / "lag.yaml"), "--no-browser", "--port", port]) == 2
    assert "port" in capsys.readouterr().err


def test_a_study_and_a_file_that_is_not_there_are_refused(tmp_path, capsys):
    study = tmp_path / "s.yaml"
    study.write_text("diagram: d.yaml\ngrid: {run.stop: [1, 2]}\n")
    (tmp_path / "d.yaml").write_text("blocks: {}\n")
    assert main(["watch", str(study), "--no-browser"]) == 2
    told = capsys.readouterr().err
    assert "is a study, not a diagram" in told and "cosim study" in told
    assert main(["watch", str(tmp_path / "none.yaml"), "--no-browser"]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_a_slip_of_the_command_line_is_told_at_once(lag, capsys):
    assert main(["watch", str(lag / "lag.yaml"), "--no-browser", "--set", "blocks.lga.parameters.T=1"]) == 2
    assert "--set blocks.lga" in capsys.readouterr().err
    assert main(["watch", str(lag / "lag.yaml"), "--no-browser", "--swap", "lga=Lag"]) == 2
    assert "no block `lga`" in capsys.readouterr().err


def test_help_has_examples():
    told = subprocess.run(
        [sys.executable, "-m", "cosim", "watch", "--help"], capture_output=True, text=True, check=True
    )
    assert "cosim watch diagrams/motor.yaml" in told.stdout and "--no-browser" in told.stdout
