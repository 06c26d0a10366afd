"""Threads for native code: their jobs' results, and a call that gives no sign of life costs its own job alone."""

import json
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError

import pytest

from cosim.machine.minded_threads import MindedThreads, this_thread
from cosim.machine.supervision import Patience


def lasting(seconds):
    """A patience with a call that shows no activity."""
    return Patience(lambda: (1, True), seconds)


def silent():
    return TimeoutError("no sign of life")


def native(function, patience=60.0):
    """A job that has native code do something."""
    return lambda: this_thread().call(function, lasting(patience), silent)


@pytest.fixture
def release():
    event = threading.Event()
    yield event
    event.set()


def test_jobs_give_their_values_and_errors_and_the_threads_end():
    threads = MindedThreads(2)
    assert [f.result(10) for f in [threads.submit(pow, 2, k) for k in range(9)]] == [2**k for k in range(9)]
    assert threads.submit(native(lambda: 42)).result(10) == 42
    with pytest.raises(ZeroDivisionError):
        threads.submit(native(lambda: 1 // 0)).result(10)
    threads.shutdown()
    assert not [t for t in threading.enumerate() if t.name.startswith("member_")]
    assert this_thread() is None


def test_what_has_not_begun_is_cancelled(release):
    threads = MindedThreads(1)
    begun = threading.Event()
    first = threads.submit(lambda: begun.set() or release.wait())
    rest = [threads.submit(pow, 2, k) for k in range(3)]
    assert begun.wait(10)
    threads.shutdown(wait=False, cancel_futures=True)
    release.set()
    assert first.result(10) is True
    for future in rest:
        with pytest.raises(CancelledError):
            future.result(10)


def test_a_silent_call_loses_its_job_and_another_thread_does_the_rest(release):
    threads = MindedThreads(1)
    hung = threads.submit(native(release.wait, 0.05))
    after = threads.submit(pow, 2, 5)
    with pytest.raises(TimeoutError, match="no sign of life"):
        hung.result(10)
    assert after.result(10) == 32
    threads.shutdown()  # does not wait for what never returns


def test_a_call_that_returns_after_all_changes_nothing(release):
    threads = MindedThreads(1)
    thread = threads.submit(threading.current_thread).result(10)
    hung = threads.submit(native(release.wait, 0.05))
    with pytest.raises(TimeoutError):
        hung.result(10)
    release.set()
    thread.join(10)
    assert not thread.is_alive() and threads.submit(pow, 2, 5).result(10) == 32
    threads.shutdown()
    assert isinstance(hung.exception(), TimeoutError)


def test_a_call_within_a_call_leaves_the_outer_one_minded(release):
    """As of a block in plain Python that runs another diagram."""
    threads = MindedThreads(1)
    inner = native(lambda: 1)
    hung = threads.submit(native(lambda: inner() and release.wait(), 0.05))
    with pytest.raises(TimeoutError):
        hung.result(10)
    threads.shutdown()


ENDLESS = """
from cosim import *

class Bad(Block):
    a = Parameter(default=0.0)
    x = State(output=True)

    def derivatives(time, x, a, d_x):
        d_x[0] = 1.0
        k = 0
        while a > 0.5 and time > 0.02 and k >= 0:
            k = (k + 1) % 1000
"""
DIAGRAM = "run: {stop: 0.1, step: 0.01, patience: 0.3}\nblocks: {bad: {python: 'own.py:Bad'}}\n"
METRIC = "metrics: {x: {signal: bad.x, reduce: final}}\n"
GRID = "diagram: own.yaml\ngrid: {blocks.bad.parameters.a: [0, 1, 0.25]}\n"


def cosim(folder, *words):
    """The command line in a process that ends, with what never does in it."""
    command = [sys.executable, "-m", "cosim", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def test_members_of_a_study_that_never_end_are_lost_alone(tmp_path):
    (tmp_path / "own.py").write_text(ENDLESS)
    (tmp_path / "own.yaml").write_text(DIAGRAM + METRIC)
    (tmp_path / "grid.yaml").write_text(GRID)
    done = cosim(tmp_path, "study", "grid.yaml", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["counts"] == {"completed": 2, "failed": 1}
    assert "block bad: no sign of life for 0.3 s in derivatives() at t = 0.03 s" in done.stdout


def test_ctrl_c_waits_for_no_member_that_never_ends(tmp_path):
    (tmp_path / "own.py").write_text(ENDLESS)
    (tmp_path / "own.yaml").write_text(DIAGRAM.replace("patience: 0.3", "patience: 600") + METRIC)
    (tmp_path / "grid.yaml").write_text(GRID)
    command = [sys.executable, "-m", "cosim", "study", "grid.yaml"]
    store = tmp_path / "results" / "grid" / "members.jsonl"
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (store.exists() and len(store.read_text().splitlines()) == 2):
            time.sleep(0.05)  # until the one that never ends is alone
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "2 of 3 members" in output + errors
