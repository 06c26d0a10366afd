"""Signals that come from nowhere: constants, steps, waves, tables. Each is a scalar, or a vector by its parameters."""

import math

import numpy as np
from numpy.typing import NDArray

from cosim import Block, Indicator, Output, Parameter, State, rule

EARLY = 2.0**-40


def time_to(edge: float, time: float) -> float:
    """The time to an edge (s): below zero at that time, to rounding, as it belongs to what follows; 1 if never."""
    if math.isinf(edge):
        return 1.0 if edge > 0.0 else -1.0
    return edge - time - EARLY * max(1.0, abs(edge))


class Constant(Block):
    """A constant.

    ::

        y = value
    """

    value = Parameter("n?", default=1.0, description="a number, or a list of them")
    y = Output("n?", description="the constant")

    def outputs(value, y):
        for q in range(y.size):
            y[q] = value[q]


class Step(Block):
    """A step from one value to another.

    ::

        y = initial for t < at,   final from then on

    The jump is an event, so that it falls between two steps of all blocks, whenever it is.
    """

    at = Parameter("n?", unit="s", default=1.0, description="time of the step")
    initial = Parameter("n?", default=0.0, description="value before")
    final = Parameter("n?", default=1.0, description="value after")
    after = State("n?", dtype=bool, start=False, description="whether the step has been")
    due = Indicator("n?", crossing="falling", unit="s", description="time to the step")
    y = Output("n?", description="the step")

    def start(time, at, after):
        for q in range(after.size):
            after[q] = time_to(at[q], time) < 0.0

    def outputs(initial, final, after, y):
        for q in range(y.size):
            y[q] = final[q] if after[q] else initial[q]

    def indicators(time, at, due):
        for q in range(due.size):
            due[q] = time_to(at[q], time)

    def event(due, next_after):
        for q in range(due.size):
            if due[q] < 0:
                next_after[q] = True


class Ramp(Block):
    """A ramp that begins at some time.

    ::

        y = initial + slope max(0, t - at)
    """

    slope = Parameter("n?", default=1.0, description="rise in a second")
    at = Parameter("n?", unit="s", default=0.0, description="when it begins")
    initial = Parameter("n?", default=0.0, description="value before")
    kink = Indicator("n?", crossing="falling", unit="s", description="time to the kink")
    y = Output("n?", description="the ramp")

    def outputs(time, slope, at, initial, y):
        for q in range(y.size):
            y[q] = initial[q] + slope[q] * max(0.0, time - at[q])

    def indicators(time, at, kink):
        for q in range(kink.size):
            kink[q] = at[q] - time


class Sine(Block):
    """A sine wave.

    ::

        y = bias + amplitude sin(2 pi frequency t + phase)
    """

    amplitude = Parameter("n?", default=1.0, description="amplitude")
    frequency = Parameter("n?", unit="Hz", default=1.0, description="frequency")
    phase = Parameter("n?", unit="rad", default=0.0, description="phase at time zero")
    bias = Parameter("n?", default=0.0, description="mean value")
    y = Output("n?", description="the wave")

    def outputs(time, amplitude, frequency, phase, bias, y):
        for q in range(y.size):
            y[q] = bias[q] + amplitude[q] * math.sin(2.0 * math.pi * frequency[q] * time + phase[q])


class Chirp(Block):
    """A sine wave whose frequency rises or falls along a line, and stays after that.

    ::

        y = amplitude sin(2 pi (first t + (last - first) t^2 / (2 duration)))    for t < duration
            amplitude sin(2 pi ((first - last) duration / 2 + last t))           from then on
    """

    amplitude = Parameter("n?", default=1.0, description="amplitude")
    first = Parameter("n?", unit="Hz", default=0.1, description="frequency at time zero")
    last = Parameter("n?", unit="Hz", default=10.0, description="frequency at the end of the sweep")
    duration = Parameter("n?", unit="s", default=10.0, description="how long the sweep takes")
    y = Output("n?", description="the wave")

    positive = rule("duration > 0")(lambda duration: bool(np.all(duration > 0.0)))

    def outputs(time, amplitude, first, last, duration, y):
        for q in range(y.size):
            if time < duration[q]:
                cycles = (first[q] + 0.5 * (last[q] - first[q]) * time / duration[q]) * time
            else:
                cycles = 0.5 * (first[q] - last[q]) * duration[q] + last[q] * time
            y[q] = amplitude[q] * math.sin(2.0 * math.pi * cycles)


class Pulse(Block):
    """One rectangular pulse.

    ::

        y = high for at <= t < at + width,   low else

    Both edges are events.
    """

    at = Parameter("n?", unit="s", default=1.0, description="when it begins")
    width = Parameter("n?", unit="s", default=1.0, description="how long it lasts")
    high = Parameter("n?", default=1.0, description="value of the pulse")
    low = Parameter("n?", default=0.0, description="value before and after")
    passed = State("n?", dtype=np.int32, start=0, description="edges that have been")
    due = Indicator("n?", crossing="falling", unit="s", description="time to the next edge")
    y = Output("n?", description="the pulse")

    positive = rule("width > 0")(lambda width: bool(np.all(width > 0.0)))

    def start(time, at, width, passed):
        for q in range(passed.size):
            passed[q] = 0
            if time_to(at[q], time) < 0.0:
                passed[q] = 2 if time_to(at[q] + width[q], time) < 0.0 else 1

    def outputs(high, low, passed, y):
        for q in range(y.size):
            y[q] = high[q] if passed[q] == 1 else low[q]

    def indicators(time, at, width, passed, due):
        for q in range(due.size):
            edge = at[q] if passed[q] == 0 else at[q] + width[q]
            due[q] = time_to(edge, time) if passed[q] < 2 else 1.0

    def event(time, at, width, due, passed, next_passed):
        for q in range(due.size):
            if due[q] < 0:  # a pulse that time cannot tell from none has both edges at once
                both = passed[q] == 0 and time_to(at[q] + width[q], time) < 0.0
                next_passed[q] = 2 if both else passed[q] + 1


def edge_time(edges: int, frequency: float, duty: float, delay: float) -> float:
    """When a square wave has its next edge (s), after so many."""
    cycle = edges // 2
    return delay + (cycle + (duty if edges % 2 == 1 else 0.0)) / frequency


class Square(Block):
    """A square wave; with `low` 0, a train of pulses.

    ::

        y = high for 0 <= (t - delay) frequency mod 1 < duty,   low else and before the delay

    Its edges are events.
    """

    high = Parameter("n?", default=1.0, description="upper value")
    low = Parameter("n?", default=-1.0, description="lower value")
    frequency = Parameter("n?", unit="Hz", default=1.0, description="frequency")
    duty = Parameter("n?", unit="1", default=0.5, description="part of a period in which it is high")
    delay = Parameter("n?", unit="s", default=0.0, description="when it first rises")
    edges = State("n?", dtype=np.int64, start=0, description="edges that have been")
    due = Indicator("n?", crossing="falling", unit="s", description="time to the next edge")
    y = Output("n?", description="the wave")

    fraction = rule("0 < duty < 1")(lambda duty: bool(np.all((duty > 0.0) & (duty < 1.0))))
    positive = rule("0 < frequency < 1e9 Hz")(lambda frequency: bool(np.all((frequency > 0.0) & (frequency < 1e9))))

    def start(time, frequency, duty, delay, edges):
        for q in range(edges.size):
            cycle = math.floor(max(0.0, time - delay[q]) * frequency[q])
            passed = max(0, 2 * cycle - 1)
            while time_to(edge_time(passed, frequency[q], duty[q], delay[q]), time) < 0.0:
                passed += 1
            edges[q] = passed

    def outputs(high, low, edges, y):
        for q in range(y.size):
            y[q] = high[q] if edges[q] % 2 == 1 else low[q]

    def indicators(time, frequency, duty, delay, edges, due):
        for q in range(due.size):
            due[q] = time_to(edge_time(edges[q], frequency[q], duty[q], delay[q]), time)

    def event(time, frequency, duty, delay, due, edges, next_edges):
        for q in range(due.size):
            passed = edges[q]
            if due[q] < 0:
                passed += 1
                while time_to(edge_time(passed, frequency[q], duty[q], delay[q]), time) < 0.0:
                    passed += 1
            next_edges[q] = passed


def ascend(times: NDArray) -> bool:
    """Whether numbers are finite, each above the one before."""
    return bool(np.all(np.isfinite(times)) and np.all(np.diff(times) > 0.0))


def knot_time(number: int, times: NDArray, repeat: bool) -> float:
    """When a knot of a table is (s), which may begin anew where it ends; never, beyond a table that does not."""
    last = times.size - 1
    if repeat and last > 0:
        cycle = number // last
        return times[number - cycle * last] + cycle * (times[last] - times[0])
    return times[number] if number <= last else math.inf


class TableSource(Block):
    """A signal from a table of times and values, by lines between them, or held from one to the next.

    ::

        y = values[k] + (values[k+1] - values[k]) (t - times[k]) / (times[k+1] - times[k])    (hold: values[k])

    for times[k] <= t < times[k+1]; the first value before the table, the last one after it. With `repeat`, the table
    begins anew where it ends. Values: one each time, or a row. Kinks and jumps are events.
    """

    times = Parameter("rows", unit="s", description="times, ascending")
    values = Parameter("rows", "n?", description="value, or row of values, at each time")
    hold = Parameter(dtype=bool, unit="1", default=False, description="hold each value, instead of lines between")
    repeat = Parameter(dtype=bool, unit="1", default=False, description="begin anew where the table ends")
    passed = State(dtype=np.int64, start=0, unit="1", description="knots that have been")
    due = Indicator(crossing="falling", unit="s", description="time to the next knot")
    y = Output("n?", description="the signal")

    ascending = rule("times ascending")(ascend)

    def start(time, times, repeat, passed):
        first, last = times[0], times.size - 1
        begun = math.floor((time - first) / (times[last] - first)) * last if repeat and last > 0 else 0
        for _ in range(times.size):
            if time_to(knot_time(begun, times, repeat), time) < 0.0:
                begun += 1
        passed[0] = begun

    def outputs(time, times, values, hold, repeat, passed, y):
        last, part = times.size - 1, 0.0
        k = passed - 1
        if repeat and last > 0:
            k = k % last
        if 0 <= k < last and not hold:
            begin = knot_time(passed - 1, times, repeat)
            part = (time - begin) / (times[k + 1] - times[k])
        for q in range(y.size):
            below = values[max(0, min(k, last)), q]
            y[q] = below
            if part != 0.0:
                y[q] += part * (values[k + 1, q] - below)

    def indicators(time, times, repeat, passed, due):
        due[0] = time_to(knot_time(passed, times, repeat), time)

    def event(time, times, repeat, due, passed, next_passed):
        if due < 0:
            knots = passed + 1
            for _ in range(times.size):
                if time_to(knot_time(knots, times, repeat), time) < 0.0:
                    knots += 1
            next_passed[0] = knots
