"""However a run ends, its rows are kept, something is said, and the exit code tells it."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from cosim.machine import interruption, streams
from cosim.machine.interruption import Interrupted, deferred, heard
from cosim.results import result_file
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.terminal import cli

LONG = """
title: long
run: {stop: 1.0e+9, step: 0.01, integrator: rk4}
blocks:
  oscillator: {type: Oscillator}
record: {period: 10, signals: [oscillator.x]}
metrics:
  largest: {signal: oscillator.x, reduce: max}
"""
HEARING = """
import sys
from cosim.terminal import cli
from cosim.engine.simulation import Simulation
batches = Simulation.batches
def told(self, *arguments):
    for number, samples in enumerate(batches(self, *arguments)):
        if number == 5:
            print("running", file=sys.stderr, flush=True)
        yield samples
Simulation.batches = told
sys.exit(cli.main(sys.argv[1:]))
"""
"""The command line, which says when it is in the middle of a run."""


@pytest.fixture
def run(write, tmp_path):
    """Start a long run: (process, path of its result)."""
    started = []

    def start(*options: str, text: str = LONG, **more):
        output = tmp_path / "long.nc"
        command = [sys.executable, "-c", HEARING, "run", str(write(text)), "-o", str(output), *options]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        started.append(subprocess.Popen(command, **{**pipes, **more}))
        return started[-1], output

    yield start
    for process in started:
        process.kill()
        process.wait()


def rows(path: Path, every: int = 1000) -> tuple[str, int, int]:
    """A result's status, rows and steps; the rows are those of all times up to the last, every so many steps."""
    with result_file.open_result(path) as result:
        count = len(result.times)
        assert np.array_equal(result.times, np.arange(0, every * count, every) * 0.01)
        assert len(result["oscillator.x"]) == count
        return result.attrs["status"], count, result.attrs.get("steps", 0)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("times", [1, 3])
def test_a_signal_ends_a_run_with_all_its_rows(run, name, times):
    """Further ones do no harm, however fast they come."""
    process, output = run("--json")
    assert process.stderr.readline() == "running\n"
    for _ in range(times):
        process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + getattr(signal, name)
    answer = json.loads(out)
    assert answer["status"] == "interrupted" and "Traceback" not in err
    assert rows(output) == ("interrupted", (answer["steps"] + 999) // 1000, answer["steps"])


def test_a_second_signal_ends_a_block_that_does_not_return(run):
    """Interpreted; the rows before are kept."""
    text = (
        LONG.replace("stop: 1.0e+9", "stop: 100")
        .replace("period: 10,", "period: 0.1,")
        .replace("oscillator: {type: Oscillator}", "stuck: {type: Stuck, period: 0.01}")
    )
    process, output = run("--engine", "python", "--json", text=text.replace("oscillator.x", "stuck.x"))
    assert any("stuck" in line for line in iter(process.stderr.readline, "")), "it ended before it was stuck"
    process.send_signal(signal.SIGTERM)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.3)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 143 and json.loads(out)["status"] == "interrupted"
    with result_file.open_result(output) as result:
        assert result.attrs["status"] == "interrupted" and result["stuck.x"].tolist() == list(range(0, 160, 10))


def test_one_signal_ends_a_block_that_does_not_return_after_a_while(run):
    text = LONG.replace("oscillator: {type: Oscillator}", "stuck: {type: Stuck, period: 0.01}")
    text = text.replace("oscillator.x", "stuck.x")
    process, output = run("--engine", "python", "--json", text=text)
    assert any("stuck" in line for line in iter(process.stderr.readline, "")), "it ended before it was stuck"
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 143 and json.loads(out)["status"] == "interrupted"
    with result_file.open_result(output) as result:
        assert result.attrs["status"] == "interrupted" and len(result.times) > 0


def test_a_signal_breaks_through_after_its_grace_however_often_it_is_swallowed(monkeypatch):
    monkeypatch.setattr(interruption, "GRACE", 0.05)
    swallowed = 0
    with deferred() as interrupted, pytest.raises(Interrupted), interrupted.breakable():
        os.kill(os.getpid(), signal.SIGTERM)
        while True:
            try:
                time.sleep(60)
            except Interrupted:
                swallowed += 1
                if swallowed == 2:
                    raise
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_the_signal_is_named(run):
    process, _ = run()
    process.stderr.readline()
    process.send_signal(signal.SIGTERM)
    assert "\ninterrupted by SIGTERM after" in process.communicate(timeout=60)[0]


def test_what_nohup_ignores_stays_ignored(run):
    process, output = run(preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    process.stderr.readline()
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert rows(output)[0] == "interrupted"


@pytest.mark.parametrize("signals", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("delay", [0.02, 0.1, 0.2, 0.4])
def test_before_the_run_a_signal_ends_the_program_without_a_traceback(write, tmp_path, signals, delay):
    """During Python's own start nothing but Python can hear it."""
    number, code = signals
    command = [
        sys.executable,
        "-c",
        "print(flush=True); from cosim.__main__ import entry; import sys; sys.exit(entry())",
    ]
    with subprocess.Popen(
        [*command, "run", str(write(LONG)), "-o", str(tmp_path / "long.nc")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        process.stdout.readline()
        process.stdout.flush()
        time.sleep(delay)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    lines = err.splitlines()
    if lines and lines[0].startswith("Traceback"):  # the line above, before `entry` was there
        assert "cosim" not in "".join(lines[3:-1]), err
    else:
        assert process.returncode in (code, -number) and "Traceback" not in err


KILLED = """
import sys
import numpy as np
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
print(flush=True)
while True:
    with ResultWriter(sys.argv[1], [Recorded("oscillator.x")], {}) as writer:
        for first in range(0, 1000, 20):
            k = np.arange(first, first + 20)
            writer.append(10 * k * 0.01, {"oscillator.x": np.cos(k)})
            writer.flush()
"""


def test_at_every_instant_there_is_a_result_under_the_name(tmp_path):
    """A process that does nothing but replace the result and flush rows into it is killed in the midst of that."""
    path = tmp_path / "long.nc"
    for k in range(8):
        with subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            while not path.exists():
                time.sleep(0.001)
            time.sleep(0.02 + 0.0137 * k)
            process.kill()
        assert rows(path, 10)[0] in ("running", "completed")


def test_a_kill_at_the_moment_of_replacement(tmp_path, monkeypatch):
    """Whichever call on the file system is the last, the name has a result: all calls that change names are cut off."""
    path = tmp_path / "run.nc"
    signals = [Recorded("oscillator.x")]
    ResultWriter(path, signals, {"title": "first"}).close("completed")
    changing = ("link", "replace", "unlink")
    for last in range(4):
        left = [last]

        def cut(do, left=left):
            def call(*arguments, **options):
                if not left[0]:
                    raise SystemExit  # as good as a kill: nothing is cleaned up any more, see below
                left[0] -= 1
                return do(*arguments, **options)

            return call

        with monkeypatch.context() as patch:
            for name in changing:
                patch.setattr(os, name, cut(getattr(os, name)))
            patch.setattr(Path, "unlink", lambda self, missing_ok=False: os.unlink(self))  # noqa: PTH108
            with suppress(SystemExit, FileNotFoundError):
                ResultWriter(path, signals, {"title": "second"})
        with result_file.open_result(path) as result:
            assert result.attrs["title"] in ("first", "second")


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (600_000,) * 2)


def test_a_full_disk_keeps_the_rows_and_shows_the_figures(run):
    """A limit on the size of files stands for the full disk, as both fail in the same call."""
    process, output = run("--stop", "20000", "--set", "record.period=0.1", preexec_fn=limited)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1 and "Traceback" not in err
    assert "largest" in out and "failed after" in out
    assert f"cannot write {output}: File too large" in err and "free some space" in err
    status, count, _ = rows(output, 10)
    assert status == "failed" and count > 600_000 / 16 / 4  # a row has 16 bytes; a fourth went for the file's own


@pytest.mark.parametrize(("closed", "code"), [((1,), 1), ((2,), 0), ((0,), 0), ((0, 1, 2), 1)])
def test_a_run_needs_no_standard_streams(run, closed, code):
    process, output = run(
        "--stop", "20", "--set", "record.period=0.1", preexec_fn=lambda: [os.close(number) for number in closed]
    )
    out, err = process.communicate(timeout=60)
    assert process.returncode == code and "Traceback" not in err
    assert rows(output, 10) == ("completed", 201, 2000)
    assert ("largest" in out) is (1 not in closed)
    if closed == (1,):
        assert "error: cannot write to standard output: Bad file descriptor" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_standard_output_is_said(run):
    with Path("/dev/full").open("w") as full:
        process, output = run("--stop", "20", "--set", "record.period=0.1", stdout=full)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 1 and "error: cannot write to standard output: No space left on device" in err
    assert rows(output, 10) == ("completed", 201, 2000)


def test_a_reader_that_goes_early_changes_no_exit_code(run):
    process, output = run("--stop", "20", "--set", "record.period=0.1")
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert "cannot write" not in process.stderr.read() and rows(output, 10)[0] == "completed"


def test_a_crash_of_the_process_is_told(run):
    text = LONG.replace("{type: Oscillator}", "{type: Crashing}").replace("oscillator.x", "oscillator.y")
    process, _ = run(text=text)
    _, err = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGSEGV and "Fatal Python error: Segmentation fault" in err


def test_handlers_are_put_back_and_other_threads_left_alone():
    from threading import Thread

    before = [signal.getsignal(number) for number in interruption.SIGNALS]
    with heard(), deferred() as outer:
        os.kill(os.getpid(), signal.SIGTERM)
        with deferred() as inner:
            os.kill(os.getpid(), signal.SIGHUP)
        assert (outer.number, inner.number) == (signal.SIGTERM, signal.SIGHUP)
    assert [signal.getsignal(number) for number in interruption.SIGNALS] == before
    seen = []

    def other():
        with heard(), deferred() as interrupted:
            seen.append(interrupted.wanted)

    thread = Thread(target=other)
    thread.start()
    thread.join()
    assert seen == [False]


def test_a_second_signal_breaks_through_only_where_it_is_harmless():
    with deferred() as interrupted:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Interrupted) as raised, interrupted.breakable():
            os.kill(os.getpid(), signal.SIGTERM)
        assert raised.value.number == signal.SIGINT
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Interrupted):
            interrupted.raise_if_wanted()


def test_an_import_that_wraps_the_interruption_is_no_mistake_of_the_file(tmp_path, capsys):
    """Python makes a RuntimeError of what is raised in __set_name__."""
    (tmp_path / "late.py").write_text(
        "import os, signal\nclass Slow:\n    def __set_name__(self, owner, name):\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\nclass Late:\n    x = Slow()\n"
    )
    diagram = tmp_path / "late.yaml"
    diagram.write_text("run: {stop: 1, step: 0.1}\nblocks: {b: {python: late.py:Late}}\n")
    assert cli.main(["check", str(diagram)]) == 143
    assert capsys.readouterr().err == "interrupted by SIGTERM\n"


ENDLESS = """
import sys
from cosim import Block, Output, Parameter, condition, rule

class Odd(Block):
    k = Parameter(default=1.0)
    y = Output()
    @KIND("k is odd")
    def odd(NAME):
        print("judged", file=sys.stderr, flush=True)
        while True:
            pass
    def outputs(k, y):
        y[0] = k
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("judged", [("check", "rule", "k"), ("check", "condition", "k"), ("run", "condition", "y")])
def test_a_rule_that_never_ends_is_ended_by_a_signal_that_names_it(write, tmp_path, judged, number):
    command, kind, name = judged
    (tmp_path / "own.py").write_text(ENDLESS.replace("KIND", kind).replace("NAME", name))
    path = write("run: {stop: 1, step: 0.1}\nblocks: {one: {python: own.py:Odd}}\nrecord: {signals: [one.y]}\n")
    output = tmp_path / "out.nc"
    words = [command, str(path), *(["-o", str(output)] if command == "run" else [])]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-m", "cosim", *words], **pipes) as process:
        while "judged" not in process.stderr.readline():
            assert process.poll() is None
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number and "Traceback" not in said
    assert f"block one judged the {kind} `k is odd` of Odd at " in said and "own.py:" in said
    if command == "run":
        with result_file.open_result(output) as result:
            assert (result.attrs["status"], result.attrs["steps"], len(result.times)) == ("interrupted", 10, 11)


def test_what_several_threads_print_aside_leaves_standard_output_as_it_was(capsys):
    """Members of a study judge their conditions at the same time, and one object of JSON comes after them."""
    several, turns = threading.Barrier(3), [0.0, 0.02, 0.04]

    def judge(k):
        several.wait()
        time.sleep(turns[k])
        with streams.aside():
            print("aside")
            time.sleep(0.03)  # the first leaves while another is inside

    threads = [threading.Thread(target=judge, args=(k,)) for k in range(3)]
    before = sys.stdout
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sys.stdout is before
    with pytest.raises(ValueError, match="inside"), streams.aside():
        raise ValueError("inside")
    assert sys.stdout is before
    print("object")
    assert capsys.readouterr() == ("object\n", "aside\n" * 3)
