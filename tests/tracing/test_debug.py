"""A run that changes its engine on the way has the bits of one that does not; it stops where somebody wants to look."""

from __future__ import annotations

import bdb
import io
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import compilation, program
from cosim.errors import FormulaError, UnknownPort, WrongUnit, WrongValue
from cosim.terminal import cli
from cosim.tracing import halts, hand_over
from tests.engine.test_checkpoints import ALL
from tests.engine.test_checkpoints import HOW as METHODS

HOW = {name: how for name, how in METHODS.items() if name != "scipy"}
SINE = """
run: {stop: 2, step: 0.01}
fleets: {robot: 2}
blocks:
  source: {block: Sine, per: robot, parameters: {frequency: 0.5, amplitude: [1, 2]}}
"""
TANK = '''\
from cosim import Block, Input, State


class Tank(Block):
    """A tank that does not hold everything."""

    u = Input()
    level = State(output=True)

    def derivatives(u, level, d_level):
        if level > 0.75:
            raise ValueError("it overflows")
        d_level[0] = u
'''
LINE = 1 + TANK[: TANK.index("        if level")].count("\n")
FILLED = """
run: {stop: 2, step: 0.01, integrator: rk4}
fleets: {tank: 2}
blocks: {tank: {python: tank.py:Tank, per: tank, start: {u: [0.5, 1]}}}
record: {signals: [tank.level]}
"""


def made(network):
    built = program.build(network, network.diagram.run.method)
    kernels = compilation.compile_program(built)
    kernels.load()
    return built, kernels


@pytest.mark.parametrize("method", HOW)
@pytest.mark.parametrize("tick", [0, 3, 57])
def test_engines_take_turns_without_changing_a_bit(wired, method, tick):
    built, kernels = made(wired(ALL.replace("HOW", HOW[method])))
    tick *= built.network.schedule.grid
    whole = hand_over.begun(built, kernels)
    whole.go_to(whole.ticks)
    turns = hand_over.interpreted_at(built, kernels, tick)
    assert turns.done == tick
    for do in islice(hand_over.ahead(turns), 4):
        do()
    assert turns.done == tick + 3 * built.network.schedule.grid
    rest = hand_over.handed_over(turns, kernels)
    rest.go_to(rest.ticks)
    for signal in built.network.signals():
        np.testing.assert_array_equal(rest.value(signal), whole.value(signal), str(signal))


def test_points_ahead_end_with_the_run(wired):
    built, kernels = made(wired("run: {stop: 0.05, step: 0.01}\nblocks: {s: {type: Oscillator}}"))
    grid = built.network.schedule.grid
    run = hand_over.interpreted_at(built, kernels, 2 * grid)
    seen = []
    for do in hand_over.ahead(run):
        do()
        seen.append(run.done // grid)
    assert seen == [2, 3, 4, 5]


def test_a_condition_is_found_at_its_first_point(wired):
    network = wired(SINE)
    built, kernels = made(network)
    grid = network.schedule.grid
    truth = int(np.argmax(2 * np.sin(2 * np.pi * 0.5 * 0.01 * np.arange(201)) > 1.5))
    assert halts.first(built, kernels, "source.y > 1.5").tick == truth * grid  # of the second member alone
    assert halts.first(built, kernels, "source.y >= 0").tick == 0
    assert halts.first(built, kernels, "min(source.y) > 1.5") is None
    assert halts.first(built, kernels, "source.y[1] > 1.5") is None


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("always(source.y > 1)", FormulaError),
        ("1 > 0", FormulaError),
        ("source.z > 1", UnknownPort),
        ("source.y >", FormulaError),
        ("source.y > 1 m + 1 s", (FormulaError, WrongUnit)),
    ],
)
def test_a_condition_that_is_none_is_told(wired, text, error):
    built, kernels = made(wired(SINE))
    with pytest.raises(error):
        halts.first(built, kernels, text)


def test_a_time_is_the_last_point_that_is_not_after_it(wired):
    built, _ = made(wired(SINE))
    grid = built.network.schedule.grid
    assert [halts.at(built, time).tick // grid for time in (0.0, 0.029, 0.03, 0.31, 2.0)] == [0, 2, 3, 31, 200]
    for time in (-0.01, 2.02, float("nan")):
        with pytest.raises(WrongValue):
            halts.at(built, time)


# ---- from the command line ----


@pytest.fixture
def debug(tmp_path, monkeypatch, capfd):
    """Run `cosim debug` with what somebody types: (exit code, what is printed)."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tank.py").write_text(TANK)
    (tmp_path / "filled.yaml").write_text(FILLED)
    monkeypatch.setattr(sys, "gettrace", lambda: None)  # also where the tests themselves are traced

    def call(typed: str, *options: str, diagram: str = "filled.yaml") -> tuple[int, str]:
        bdb.Breakpoint.clearBreakpoints()  # which are those of the process
        monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
        code = cli.main(["debug", diagram, *options])
        return code, "".join(capfd.readouterr())

    return call


def test_the_debugger_stops_in_the_authors_function_at_that_time(debug):
    for member, level in ((1, 0.25), (2, 0.5)):  # filled for 0.5 s
        code, out = debug(f"p abs(level - {level}) < 1e-12\nq\n", "--at", "0.5", "--member", str(member))
        assert code == 0
        assert f"tank.py({LINE})derivatives()" in out
        assert "True" in out


def test_with_no_breakpoint_left_it_goes_on_to_the_end(debug):
    code, out = debug("c\n", "--at", "0.5", "--stop", "0.7")
    assert code == 0
    assert "t = 0.51 s to the end at t = 0.7 s" in out.replace("\n", " ")


def test_a_breakpoint_that_is_set_by_hand_holds(debug):
    code, out = debug(f"b tank.py:{LINE}\nc\nc\nq\n", "--at", "0.5")
    assert (code, out.count(f"tank.py({LINE})derivatives()")) == (0, 3)


def test_line_by_line_it_goes_from_one_call_into_the_next(debug):
    """Runge-Kutta calls the function four times a step for each of two members: more than one step is gone through."""
    code, out = debug("n\n" * 60 + "c\n", "--at", "0.2", "--stop", "0.4")
    assert code == 0
    assert out.count("derivatives()->None") > 8
    assert "to the end at t = 0.4 s" in out.replace("\n", " ")


def test_without_a_moment_it_stops_before_the_run_fails_and_then_where_it_does(debug):
    code, out = debug("c\np level > 0.75\nq\n")
    assert code == 1
    assert out.count("ValueError: it overflows") == 2 and "filled.yaml:4:" in out  # beforehand, and as it happens
    assert f"tank.py({LINE + 1})derivatives()" in out
    assert "True" in out


LATE = '''\
from cosim import Block, Input, Output, Parameter


class Late(Block):
    """It fails at a time, where its output is published."""

    u = Input()
    T = Parameter(default=0.5)
    y = Output()

    def outputs(time, u, T, y):
        if time >= T:
            raise ValueError("too late")
        y[0] = u
'''


@pytest.mark.parametrize(("T", "where"), [(0.5, "t = 0.4 s: compiled up to here"), (0.0, "Python from here on")])
def test_a_point_that_cannot_be_computed_is_computed_in_the_debugger(debug, T, where):
    """Also the first one, of which no run is initialized."""
    Path("late.py").write_text(LATE)
    block = f"{{python: late.py:Late, parameters: {{T: {T}}}, inputs: {{u: 1}}}}"
    Path("late.yaml").write_text(f"run: {{stop: 1, step: 0.1}}\nblocks: {{b: {block}}}\n")
    code, out = debug("c\np time >= T\nq\n", diagram="late.yaml")
    assert code == 1
    assert where in out
    assert f"late.py({1 + LATE[: LATE.index('            raise')].count(chr(10))})outputs()" in out
    assert "True" in out


def test_an_fmu_cannot_change_the_engine_on_the_way(debug):
    Path("gain.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {g: {block: Gain, start: {u: 1}}}\n")
    assert cli.main(["export", "gain.yaml", "-o", "gain.fmu"]) == 0
    code, out = debug("", "--swap", "g=gain.fmu", "--at", "0.5", diagram="gain.yaml")
    assert code == 2 and "--swap g=TYPE" in out


def test_a_run_that_fails_before_is_looked_at_there(debug):
    code, out = debug("c\nq\n", "--when", "tank.level > 3")
    assert code == 1
    assert "it overflows" in out and f"tank.py({LINE + 1})derivatives()" in out
    assert debug("", "--at", "1.5")[0] == 1  # behind the failure nobody can stop


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--stop", "0.5"], 0, "without a failure"),
        (["--stop", "0.5", "--when", "tank.level > 3"], 0, "does not hold"),
        (["--at", "1", "--when", "tank.level > 3"], 2, "exclude each other"),
        (["--at", "1", "--block", "tnk"], 2, "did you mean `tank`"),
        (["--at", "1", "--member", "0"], 2, "count from 1"),
        (["--at", "0.1", "--when", "tank.lvl > 3"], 2, "exclude"),
        (["--when", "tank.lvl > 3"], 2, "level"),
    ],
)
def test_what_cannot_be_looked_at_is_told(debug, options, code, said):
    found, out = debug("", *options)
    assert found == code
    assert said in " ".join(out.split())
