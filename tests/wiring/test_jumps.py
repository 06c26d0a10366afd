"""When inputs jump that are read late: by which clocks, rounded to what, and what changes in between."""

from __future__ import annotations

from fractions import Fraction

import pytest

from cosim.wiring import jumps
from cosim.wiring.clocks import MOST_TICKS, Clock

DIAGRAM = """
run: {stop: 10, step: 0.01}
blocks:
  sampled: {block: Gain, period: 0.03, offset: 0.02, inputs: {u: lag.x}}
  lag: {block: FirstOrder, inputs: {u: SOURCE}}
  gain: {block: Gain, inputs: {u: sampled.y}}
  late: {block: Gain, inputs: {u: {from: gain.y, delay: 0.05}}}
  sum: {block: Sum, inputs: {u_1: late.y, u_2: lag.x, u_3: sampled.y}}
  step: {block: Step}
"""


@pytest.fixture
def behind(wired):
    def find(source, *settings):
        network = wired(DIAGRAM.replace("SOURCE", source), *settings)
        return network, jumps.behind(network, network.components["lag"], "u")

    return find


def clock(period, offset=0):
    return Clock(Fraction(period), Fraction(offset))


@pytest.mark.parametrize(
    ("source", "clocks", "flows"),
    [
        ("{from: sampled.y, delay: 0.02}", [clock("0.03", "0.02")], False),
        ("{from: gain.y, delay: 0.02}", [clock("0.03", "0.02")], False),
        ("{from: late.y, delay: 0.02}", [clock("0.03", "0.07")], False),
        ("{from: lag.x, delay: 0.02}", [], True),
        ("late.y", [clock("0.03", "0.07")], False),
    ],
)
def test_a_wire_jumps_by_the_clocks_behind_it(behind, source, clocks, flows):
    found = behind(source)[1]
    assert (list(found.clocks), found.flows, found.strikes) == (clocks, flows, False)


def test_what_a_block_adds_up_jumps_by_the_clocks_of_all(behind):
    found = behind("{from: sum.y, delay: 0.02}")[1]
    assert set(found.clocks) == {clock("0.03", "0.02"), clock("0.03", "0.07")} and found.flows and not found.strikes


def test_an_event_strikes_by_no_clock(behind):
    network, found = behind("{from: step.y, delay: 0.02}")
    assert found == jumps.Behind((), strikes=True, flows=False)
    assert not jumps.are_met(network, network.components["lag"], "u")


def test_the_master_stops_where_an_input_jumps(behind):
    network, _ = behind("{from: late.y, delay: 0.0251}")
    assert network.components["lag"].couplings["u"].jumps == (clock("0.03", "0.0951"),)
    assert {clock("0.03", "0.0951"), clock("0.03", "0.07")} <= set(network.schedule.clocks)
    assert network.schedule.tick == Fraction("0.0001")


def test_a_start_value_ends_once(behind):
    network, _ = behind("{from: lag.x, delay: 0.0251}", "blocks.lag.start={u: 1}")
    (once,) = network.components["lag"].couplings["u"].jumps
    assert once.offset == Fraction("0.0251") and once.period > 10


@pytest.mark.parametrize("stop", [10, 1e5, 1e9])
def test_a_delay_without_a_common_measure_is_met_as_near_as_ticks_can_be_counted(behind, stop):
    """No earlier, so that its sample is there, and by 1e-9 of a tick where a run is not too long for that."""
    delay = 0.0312345678901234
    network, _ = behind(f"{{from: sampled.y, delay: {delay}}}", f"run.stop={stop}")
    (jump,) = network.components["lag"].couplings["u"].jumps
    late = float(jump.offset - Fraction("0.02") - Fraction(delay))
    assert stop / network.schedule.tick < MOST_TICKS
    assert 0 <= late <= max(0.01 * 2**-30, 4 * stop / MOST_TICKS)


def test_with_steps_of_any_size_a_delay_makes_none_shorter(behind):
    network, _ = behind("{from: sampled.y, delay: 0.0312345678901234}", "run.coupling_tolerance=1e-3")
    assert network.schedule.tick == Fraction(1, 100 * 1024)


def test_what_is_due_after_the_end_is_left_out(behind):
    network, _ = behind("{from: sampled.y, delay: 1e30}")
    assert network.components["lag"].couplings["u"].jumps == ()


def test_an_echo_is_followed_until_its_phases_repeat(wired):
    network = wired(
        """
        run: {stop: 10, step: 0.01}
        blocks:
          source: {block: Gain, period: 0.1, inputs: {u: lag.x}}
          echo: {block: Sum, inputs: {u_1: source.y, u_2: again.y}}
          again: {block: Gain, inputs: {u: {from: echo.y, delay: 0.025}}, start: {u: 0}}
          lag: {block: FirstOrder, inputs: {u: {from: echo.y, delay: 0.1}}}
        """
    )
    phases = {jump.offset % Fraction("0.1") for jump in network.components["lag"].couplings["u"].jumps}
    assert phases == {Fraction(k, 40) for k in range(4)}
