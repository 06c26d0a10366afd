"""The thread in which native code runs: what it hands back, and when it is left alone."""

import gc
import os
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from cosim.machine import worker
from cosim.machine.supervision import Patience, never
from cosim.machine.worker import Abandoned, Worker, worker_of_this_thread


def threads():
    return {thread for thread in threading.enumerate() if thread.name == "loop"}


def lasting(seconds):
    """A patience with a call that shows no activity."""
    return Patience(lambda: (1, True), seconds)


@pytest.fixture
def release(monkeypatch):
    """What lets a call that hangs return in the end; who waits for it does so shortly."""
    monkeypatch.setattr(worker, "GRACE", 0.05)
    event = threading.Event()
    yield event
    event.set()


def test_a_call_gives_its_value_or_its_error_and_the_thread_ends():
    before = threads()
    one = Worker()
    assert one.do(lambda: 42, lasting(10.0), lambda: None, never) == 42
    with pytest.raises(ZeroDivisionError):
        one.do(lambda: 1 // 0, lasting(10.0), lambda: None, never)
    (thread,) = threads() - before
    assert not one.abandoned
    assert one.do(threading.current_thread, lasting(10.0), lambda: None, never) is thread  # the same for all calls
    del one
    gc.collect()  # the error has it in its traceback
    thread.join(10.0)
    assert not thread.is_alive()


def test_a_call_that_gives_no_sign_of_life_is_abandoned(release):
    one, asked = Worker(), []
    with pytest.raises(Abandoned):
        one.do(release.wait, lasting(0.05), lambda: asked.append(True), never)
    assert one.abandoned and asked


def test_a_call_that_is_asked_to_return_and_does_not_is_broken_off(release):
    one = Worker()
    with pytest.raises(KeyboardInterrupt):
        one.do(release.wait, lasting(60.0), lambda: None, lambda: True)
    assert one.abandoned


def test_a_call_that_returns_when_it_is_asked_to_keeps_its_value():
    one, stop = Worker(), threading.Event()
    assert one.do(lambda: stop.wait(60.0), lasting(60.0), stop.set, lambda: True) is True
    assert not one.abandoned


def called(number):
    return worker_of_this_thread().do(lambda: number + 1, lasting(10.0), lambda: None, never)


def test_each_thread_has_its_own_and_gets_another_for_one_that_is_abandoned(release):
    mine = worker_of_this_thread()
    assert worker_of_this_thread() is mine
    with ThreadPoolExecutor(1) as other:
        theirs = other.submit(worker_of_this_thread).result()
    assert theirs is not mine
    with pytest.raises(Abandoned):
        mine.do(release.wait, lasting(0.05), lambda: None, never)
    assert worker_of_this_thread() is not mine and called(1) == 2


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_process_has_a_thread_of_its_own():
    assert called(1) == 2
    child = os.fork()
    if child == 0:
        os._exit(called(6))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


def test_a_call_within_a_call_has_another_thread():
    """As of a block in plain Python that runs another diagram."""
    assert worker_of_this_thread().do(lambda: called(1) + called(2), lasting(10.0), lambda: None, never) == 5
