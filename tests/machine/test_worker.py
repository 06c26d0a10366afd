"""The thread in which native code runs: what it hands back, and when it is left alone."""

import threading

import pytest

from cosim.machine import worker
from cosim.machine.supervision import Patience, never
from cosim.machine.worker import Abandoned, Worker


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
    one.close()
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
    one.close()
