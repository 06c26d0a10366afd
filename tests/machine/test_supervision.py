"""How long a forked process may be silent, by a clock that the test turns."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pytest

from cosim.machine import supervision
from cosim.machine.supervision import GLANCE, Crew, Ended, Patience

pytestmark = pytest.mark.skipif(not supervision.AVAILABLE, reason="needs fork")


class Clock:
    """Each look at it comes `tick` seconds after the one before; `looked` hears how many there have been."""

    sleep = staticmethod(time.sleep)

    def __init__(self, tick: float, looked: Callable[[int], object] = lambda count: None) -> None:
        self.tick = tick
        self.count = 0
        self._looked = looked

    def monotonic(self) -> float:
        self.count += 1
        assert self.count < 1000
        self._looked(self.count)
        return self.tick * self.count


@pytest.fixture
def crew():
    """A crew of one, who answers 42 when it is told to go on through the pipe."""
    hear, say = os.pipe()
    activity = iter(range(1 << 30))
    made: list[Crew] = []

    def hire(patience: float, busy: bool = False, silence: object = 0) -> Crew:
        crew = Crew(Patience(lambda: next(activity) if busy else silence, patience))
        crew.hire("one", {"wait": lambda: os.read(hear, 1) and 42})
        made.append(crew)
        return crew

    yield hire, lambda: os.write(say, b"x")
    for one in made:
        one.kill()
    os.close(hear)
    os.close(say)


def test_silence_is_borne_up_to_the_patience(crew, monkeypatch):
    hire, _ = crew
    clock = Clock(GLANCE)
    monkeypatch.setattr(supervision, "time", clock)
    silent = hire(patience=10.5 * GLANCE)
    with pytest.raises(Ended) as ended:
        silent.do("one", "wait")
    assert ended.value.hung and "no answer" in ended.value.how
    # The first look is where it begins; ten more are within the patience.
    assert clock.count >= 12


@pytest.mark.parametrize(("busy", "silence"), [(True, 0), (False, None)])
def test_who_does_something_may_take_its_time(crew, monkeypatch, busy, silence):
    hire, go_on = crew
    clock = Clock(GLANCE, lambda count: go_on() if count == 30 else None)
    monkeypatch.setattr(supervision, "time", clock)
    assert hire(2 * GLANCE, busy, silence).do("one", "wait") == 42
    assert clock.count >= 30


def test_while_this_process_was_stopped_silence_is_not_counted(crew, monkeypatch):
    """Each look comes a minute late; that may be the time of two glances at most."""
    hire, go_on = crew
    clock = Clock(60.0, lambda count: go_on() if count == 5 else None)
    monkeypatch.setattr(supervision, "time", clock)
    assert hire(patience=60.0).do("one", "wait") == 42
    assert clock.count >= 5
