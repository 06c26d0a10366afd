"""What a wire brought, by itself: samples that are kept, taken back and forgotten, and the value between them."""

import numpy as np
import pytest

from cosim.master import histories

TO, FRESH, HISTORY = 0, 8, 16


class Wire:
    def __init__(
        self,
        room: int = 3,
        orders: tuple[int, int] = (0, 0),
        delay: float = 0.0,
        pieces: tuple[bool, bool] = (True, False),
    ) -> None:
        self.memory = np.zeros(2 + histories.words(room, 1))
        head = histories.head(TO, FRESH, 1, room, orders, delay, pieces)
        self.memory.view(np.int64)[2 : 2 + head.size] = head
        self.base = self.memory.ctypes.data

    def push(self, time: float, value: float) -> None:
        self.memory[FRESH // 8] = value
        histories.push(self.base, HISTORY, time)

    def jump(self, time: float, value: float) -> None:
        histories.forget(self.base, HISTORY)
        self.push(time, value)

    def at(self, time: float, left: int = 0) -> float:
        histories.trace(self.base, HISTORY, time, self.base + TO, left)
        return self.memory[TO]


def test_a_sample_of_an_earlier_time_takes_later_ones_back():
    wire = Wire(orders=(1, 1))
    for time, value in ((0.0, 0.0), (1.0, 1.0), (2.0, 5.0)):
        wire.push(time, value)
    wire.push(1.5, 2.0)
    assert [wire.at(t) for t in (0.0, 1.0, 1.25, 1.5, 2.0)] == [0.0, 1.0, 1.5, 2.0, 3.0]


def test_what_is_forgotten_is_gone_also_where_time_goes_back():
    wire = Wire(orders=(1, 1))
    for time in (1.0, 2.0):
        wire.push(time, time)
    histories.forget(wire.base, HISTORY)
    wire.memory[TO] = -1.0
    assert wire.at(2.0) == -1.0
    wire.push(0.5, 7.0)
    assert wire.at(0.5) == wire.at(3.0) == 7.0
    wire.push(1.5, 8.0)
    assert wire.at(1.0) == 7.5


@pytest.mark.parametrize("delay", [0.25, 0.5])
def test_a_delayed_wire_brings_what_there_was(delay):
    wire = Wire(room=4, delay=delay)
    for k in range(4):
        wire.push(0.25 * k, float(k))
    assert wire.at(0.75) == 3.0 - delay / 0.25
    assert wire.at(0.75 + delay) == 3.0


def test_of_order_0_a_step_has_the_value_of_its_begin_to_its_very_end():
    wire = Wire(room=6, delay=0.5)
    for k in range(4):
        wire.push(0.25 * k, float(k))
    assert wire.at(0.75) == 1.0
    assert [wire.at(t, left=1) for t in (0.75, 0.875, 1.0)] == [1.0] * 3
    assert wire.at(1.0) == wire.at(1.0, left=1) == 2.0


@pytest.mark.parametrize("met", [True, False])
def test_up_to_a_jump_the_sample_before_it_is_held_and_then_the_line_goes_on_from_it(met):
    wire = Wire(room=6, orders=(0, 1), delay=0.5, pieces=(met, False))
    wire.push(0.0, 0.0)
    wire.push(0.25, 1.0)
    wire.jump(0.5, 5.0)
    wire.push(0.75, 6.0)
    assert wire.at(0.75) == 1.0
    assert [wire.at(t, left=1) for t in (0.75, 0.875, 1.0)] == [1.0] * 3
    assert wire.at(1.0) == wire.at(1.0, left=1) == 5.0
    assert wire.at(1.125, left=1) == 5.5
    assert wire.at(0.625) == 0.5


def test_where_no_step_ends_at_a_jump_it_is_seen_within_one():
    wire = Wire(room=6, orders=(0, 0), delay=0.5, pieces=(False, False))
    for k in range(4):
        wire.push(0.25 * k, float(k))
    assert wire.at(0.9) == 1.0
    assert [wire.at(t, left=1) for t in (0.9, 1.0, 1.1, 1.25, 1.3, 0.95)] == [1.0, 1.0, 2.0, 2.0, 3.0, 1.0]


@pytest.mark.parametrize("met", [True, False])
@pytest.mark.parametrize("started", [True, False])
def test_before_the_first_sample_there_is_the_start_value_or_that_sample(started, met):
    """Whatever was looked up in between, as for a step that was given up."""
    wire = Wire(room=4, orders=(0, 1), delay=1.0, pieces=(met, started))
    wire.memory[TO] = -7.0
    for k in range(3):
        wire.push(0.5 * k, 2.0 + k)
    before = -7.0 if started else 2.0
    assert wire.at(0.5) == before
    assert wire.at(1.25, left=1) == (before if met and started else 2.5)
    assert wire.at(0.75, left=1) == wire.at(1.0, left=1) == wire.at(0.75) == before
    assert wire.at(1.0) == 2.0
    assert wire.at(1.25, left=1) == 2.5


def test_late_in_a_long_run_a_sample_is_still_found():
    """At 1e6 s the times that doubles can be are 1.2e-10 s apart."""
    wire = Wire(room=8, delay=0.03)
    for k in range(10**8, 10**8 + 1000):
        wire.push(k * 0.01, float(k))
        assert k < 10**8 + 3 or wire.at(k * 0.01) == k - 3
