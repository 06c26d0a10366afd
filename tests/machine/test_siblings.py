"""Tasks shared out among processes are done once each, whatever becomes of a process."""

import os
import signal
import threading
import time
from functools import partial

import pytest

from cosim.machine import siblings


def note(folder, number):
    """A task that leaves the process that did it."""
    (folder / str(number)).write_text(str(os.getpid()))
    time.sleep(0.02)


def done_by(folder):
    return {int(file.name): int(file.read_text()) for file in folder.iterdir()}


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_all_is_done_once_by_so_many_processes(tmp_path, processes):
    seconds = siblings.shared_out([partial(note, tmp_path, n) for n in range(40)], processes)
    assert {*seconds} == {*done_by(tmp_path)} == {*range(40)}
    assert all(took >= 0.02 for took in seconds.values())
    assert os.getpid() in done_by(tmp_path).values()
    assert len({*done_by(tmp_path).values()}) == processes


def test_what_raises_is_not_done_and_ends_nobody(tmp_path):
    def wrong():
        raise ValueError

    tasks = [partial(note, tmp_path, 0), wrong, partial(note, tmp_path, 2), wrong]
    assert {*siblings.shared_out(tasks, 2)} == {0, 2}


def test_a_process_that_is_killed_is_told_and_leaves_its_task(tmp_path, caplog):
    parent = os.getpid()

    def deadly(number):
        if os.getpid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)
        note(tmp_path, number)

    seconds = siblings.shared_out([partial(deadly, n) for n in range(10)], 2)
    assert len(seconds) == 9 and {*seconds} == {*done_by(tmp_path)}
    assert {*done_by(tmp_path).values()} == {parent}
    (told,) = caplog.messages
    assert "has ended (somebody, or a lack of memory, killed the process)" in told


def test_the_others_end_with_this_one(tmp_path):
    parent = os.getpid()

    def stuck():
        if os.getpid() == parent:
            while not (tmp_path / "at work").exists():
                time.sleep(0.01)
            raise KeyboardInterrupt
        (tmp_path / "at work").write_text(str(os.getpid()))
        time.sleep(3600)

    with pytest.raises(KeyboardInterrupt):
        siblings.shared_out([stuck, stuck], 2)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "at work").read_text()), 0)


def test_a_lock_that_another_thread_has_is_free_in_all_processes(tmp_path):
    lock, begun = threading.RLock(), threading.Event()

    def holding():
        with lock:
            begun.set()
            time.sleep(0.1)

    def locking(number):
        with lock:
            note(tmp_path, number)

    other = threading.Thread(target=holding)
    other.start()
    begun.wait()
    seconds = siblings.shared_out([partial(locking, n) for n in range(6)], 2, [lock])
    other.join()
    assert {*seconds} == {*range(6)} and len({*done_by(tmp_path).values()}) == 2
