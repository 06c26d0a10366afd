"""What a wire brought, by itself: samples that are kept, taken back and forgotten, and the value between them."""

import numpy as np
import pytest

from cosim.master import histories

TO, FRESH, HISTORY = 0, 8, 16


class Wire:
    def __init__(self, room: int = 3, orders: tuple[int, int] = (0, 0), delay: float = 0.0) -> None:
        self.memory = np.zeros(2 + histories.words(room, 1))
        head = histories.head(TO, FRESH, 1, room, orders, delay)
        self.memory.view(np.int64)[2 : 2 + head.size] = head
        self.base = self.memory.ctypes.data

    def push(self, time: float, value: float) -> None:
        self.memory[FRESH // 8] = value
        histories.push(self.base, HISTORY, time)

    def at(self, time: float) -> float:
        self.memory[TO] = np.nan
        histories.trace(self.base, HISTORY, time, self.base + TO)
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
    assert np.isnan(wire.at(2.0))
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
