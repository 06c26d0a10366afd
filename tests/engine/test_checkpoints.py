"""A run that was killed and resumed is the run that was not, to the bit; a checkpoint of another one is refused."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest

from cosim.engine import recording, run, run_state
from cosim.engine.checkpoints import Interval
from cosim.engine.courses import Courses
from cosim.engine.run import Run
from cosim.errors import CheckpointError, NothingToResume, ResultError, WrongValue
from cosim.machine import object_code
from cosim.master import tables
from cosim.results.checkpoint_file import CheckpointFile, decoded, encoded
from cosim.results.result_file import open_result
from tests.engine.test_attempts import BLOCKS as STEPS
from tests.engine.test_attempts import MASSES, TRANSIENT
from tests.engine.test_crossings import BLOCKS as CROSSING
from tests.interrupted import HANDED_OVER, assert_same, assert_same_results, executed, killed

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
ALL = """
run: {stop: 2, step: 0.01, HOW}
fleets: {robot: 3}
blocks:
  source: {type: Sine, per: robot, parameters: {f: 3}}
  lag: {type: Lag, per: robot, inputs: {u: source.y}}
  late: {type: Lag, per: robot, inputs: {u: {from: lag.x, delay: 0.137}}, start: {u: [0.25, 0.5], x: [1, 2]}}
  swing: {type: Oscillator}
  tied: {type: Integrator, inputs: {u: [swing.x]}}
  clock: {type: Clock, period: 0.01}
  slow: {type: Counter, period: 1/7, offset: 0.03, inputs: {u: swing.x}}
  held: {type: Lag, period: 0.05, inputs: {u: "late.x[2]"}}
  heard: {type: Lag, inputs: {u: {from: held.y, delay: 0.0371}}, start: {u: [0.5, -0.5]}}
  ring: {type: Lag, inputs: {u: back.y}, start: {x: [1, -1]}}
  back: {type: Gain, parameters: {k: -0.5}, inputs: {u: ring.y}}
  mean: {type: Average, inputs: {u: late.y}}
record: {period: 0.02, signals: [lag.x, late.y, slow.count, held.y, heard.y, lag.large, mean.number, swing.x]}
metrics:
  top: {signal: late.y, reduce: max}
  low: {signal: lag.x, reduce: min, from: 0.5, to: 1.8}
  number: {signal: slow.count, reduce: max}
  mean: {signal: late.x, reduce: mean}
  rms: {signal: held.y, reduce: rms, from: 1}
  last: {signal: lag.x, reduce: final}
  early: {signal: lag.x, reduce: final, to: 0.8}
  happened: {signal: clock.log, reduce: events}
"""
HOW = {
    "jacobi": "method: jacobi, integrator: rk4, extrapolation: 2",
    "gauss-seidel": "method: gauss-seidel, integrator: heun, inner_steps: 2, extrapolation: 1",
    "joint": "method: joint, integrator: dormand-prince",
    "scipy": "method: joint, integrator: dop853, tolerance: 1.0e-6",
}
SMALL = """
title: small
run: {stop: 2, step: 0.01}
blocks:
  swing: {type: Oscillator, parameters: {w: 2}}
  gain: {type: Gain, parameters: {k: 2}, inputs: {u: [swing.x]}}
record: {period: 0.01, signals: [swing.x, gain.y]}
metrics:
  m: {signal: gain.y, reduce: rms}
"""


@pytest.fixture(autouse=True)
def _every_batch_is_flushed(monkeypatch):
    """So that a result has rows behind those of the checkpoint."""
    monkeypatch.setattr(recording, "FLUSH_SECONDS", 0.0)


@pytest.fixture
def small(wired):
    return wired(SMALL)


# ---- the same bits ----


@pytest.mark.parametrize("engine", run.ENGINES)
@pytest.mark.parametrize("method", HOW)
def test_a_run_that_was_killed_and_resumed_has_the_same_bits(wired, tmp_path, engine, method):
    """With sampled blocks, delays, extrapolation, an algebraic loop, and every reduction."""
    network = wired(ALL.replace("HOW", HOW[method]))
    whole = executed(network, tmp_path / "whole.nc", engine=engine)
    output = tmp_path / "resumed.nc"
    killed(network, output, 0.3, every="0.1", engine=engine)
    for at in (0.71, 1.6):
        killed(network, output, at, resume=True, engine=engine)
    resumed = executed(network, output, resume=True, engine=engine)
    assert_same(whole, resumed)
    assert resumed[1].resumed == pytest.approx(1.5, abs=0.11) and len(whole[1].events) == 2
    assert not output.with_suffix(".checkpoint").exists()


EVENTS = """
run: {stop: 4, step: 0.05, integrator: rk4, METHOD}
fleets: {ball: 2}
blocks:
  ball: {own:Ball, per: ball, parameters: {e: [0.7, 0.5]}}
  force: {own:Force}
  slide: {own:Friction, inputs: {F: force.F}, start: {v: 0.3, slip: 1}}
  count: {own:Switch, inputs: {u: force.F}}
record: {signals: [ball.h, ball.n, ball.last, slide.v, slide.slip, count.n, count.last]}
metrics: {low: {signal: ball.h, reduce: min}}
"""


@pytest.mark.parametrize("engine", run.ENGINES)
@pytest.mark.parametrize("text", [EVENTS, EVENTS.replace("METHOD", "method: gauss-seidel"), TRANSIENT, MASSES])
def test_events_and_steps_that_are_repeated_or_chosen_go_on_with_the_same_bits(tmp_path, engine, text):
    (tmp_path / "own.py").write_text(STEPS + CROSSING)
    diagram = tmp_path / "diagram.yaml"
    text = text.replace("METHOD", "method: jacobi").replace(
        "integrator: rk4, inner_steps: 4}", "integrator: rk4, method: iterated}"
    )
    diagram.write_text(text.replace("own:", "python: own.py:"))
    network, output = run.load(diagram), tmp_path / "run.nc"
    stop = network.diagram.run.stop
    whole = executed(network, tmp_path / "whole.nc", engine=engine)
    killed(network, output, 0.2 * stop, every=f"{0.03 * stop}", engine=engine)
    killed(network, output, 0.7 * stop, resume=True, engine=engine)
    resumed = executed(network, output, resume=True, engine=engine)
    assert_same(whole, resumed)
    assert resumed[1].stepping == whole[1].stepping and resumed[1].resumed > 0.4 * stop


def test_verdicts_along_the_run_are_of_all_of_it(formation, tmp_path):
    """The largest rate of the topology, by which Theorem 3 is judged, comes at 0.148 s, before the kill."""
    network = run.load(formation, ["run.stop=0.5"])
    whole = executed(network, tmp_path / "whole.nc")
    killed(network, tmp_path / "run.nc", 0.4, every="0.1")
    resumed = executed(network, tmp_path / "run.nc", resume=True)
    assert_same(whole, resumed)
    assert "at t = 0.148 s" in str([verdict["numbers"] for verdict in resumed[1].verdicts]) and resumed[1].resumed > 0.2


def test_checkpoints_change_no_bit_of_a_run_that_is_not_killed(wired, tmp_path):
    network = wired(ALL.replace("HOW", HOW["jacobi"]))
    plain = executed(network, tmp_path / "plain.nc")
    often = executed(network, tmp_path / "often.nc", every="1e-9")  # at every communication point
    assert_same(plain, often)
    assert sorted(path.suffix for path in tmp_path.glob("often*")) == [".nc"]


def test_a_run_that_is_killed_before_its_first_step_or_in_its_last_batch(small, tmp_path):
    whole = executed(small, tmp_path / "whole.nc")
    for at in (0.0, 2.0):
        output = tmp_path / f"{at}.nc"
        killed(small, output, at, every="0.7")
        assert_same(whole, executed(small, output, resume=True))


def test_a_run_of_one_step(wired, tmp_path):
    network = wired(SMALL.replace("stop: 2", "stop: 0.01"))
    killed(network, tmp_path / "run.nc", 0.0, every="1")
    assert_same(executed(network, tmp_path / "whole.nc"), executed(network, tmp_path / "run.nc", resume=True))


@pytest.mark.parametrize("seed", range(4))
def test_kills_at_random_times(wired, tmp_path, seed):
    draw = np.random.default_rng(seed)
    network = wired(ALL.replace("HOW", HOW[draw.choice([*HOW])]))
    whole = executed(network, tmp_path / "whole.nc")
    output = tmp_path / "run.nc"
    times = sorted(draw.uniform(0, 2) for _ in range(4))
    for k, at in enumerate(times):
        killed(network, output, at, every=f"{draw.uniform(0.005, 0.5):.3f}", resume=k > 0)
    assert_same(whole, executed(network, output, resume=True))


@pytest.mark.parametrize("kind", [float, np.int64, bool])
def test_what_conditions_are_judged_by_goes_on_from_its_state(kind):
    draw = np.random.default_rng(7)
    for _ in range(50):
        count, cut = 6, int(draw.integers(7))
        samples = draw.integers(-3, 3, (count, 2, 3)).astype(kind)
        if kind is float:
            samples[draw.random(samples.shape) < 0.05] = np.nan
        times, whole, first, second = np.arange(count) * 0.1, Courses(2), Courses(2), Courses(2)
        whole.update(times, samples)
        first.update(times[:cut], samples[:cut])
        second.restore(decoded(b"".join(map(bytes, encoded({}, first.state()))))[1])
        second.update(times[cut:], samples[cut:])
        assert second.seen and repr(second.of_members()) == repr(whole.of_members())


@pytest.mark.parametrize("engine", run.ENGINES)
def test_what_stays_the_own_of_a_run_is_addresses_and_constants(wired, engine):
    """All other words that differ from the program's are of the run itself; constants do not change in it."""
    one = Run(wired(ALL.replace("HOW", HOW["jacobi"])), engine)
    one.simulation.initialize()
    built, control = one.simulation.program, one.simulation.control
    addresses = np.flatnonzero(control != built.control())
    own = {*tables.ADDRESSES} - {tables.SOLVER}  # which is there with scipy's methods only
    assert own <= {*addresses} <= {*tables.ADDRESSES, tables.N_GROUPS, *HANDED_OVER, tables.PROPOSED}
    before = one.simulation.arena.copy()
    for _ in one.simulation.batches():
        pass
    changed = one.simulation.arena != before
    for begin, end in run_state._constants(built):
        if begin != built.clocks:  # whether they are due
            assert not changed[begin:end].any()
    assert changed.any()


# ---- how a run ends ----


def test_an_interrupted_run_leaves_a_checkpoint_of_its_last_step(small, tmp_path):
    import signal

    output = tmp_path / "run.nc"

    def watch(time: float) -> None:
        if time >= 1.0:
            os.kill(os.getpid(), signal.SIGTERM)

    one, outcome = executed(small, output, every="0.4", watch=watch)
    assert outcome.status == "interrupted" and outcome.checkpoint == (
        str(tmp_path / "run.checkpoint"),
        one.simulation.time,
    )
    resumed = executed(small, output, resume=True)
    assert resumed[1].resumed == one.simulation.time
    assert_same(executed(small, tmp_path / "whole.nc"), resumed)


def test_a_run_that_fails_on_the_way_keeps_its_checkpoint_and_fails_again(wired, tmp_path):
    network = wired(
        SMALL.replace("{type: Gain, parameters: {k: 2}", "{type: Picky, parameters: {limit: 0.9}, start: {}").replace(
            "swing: {type: Oscillator", "swing: {type: Oscillator, start: {x: -1}"
        )
    )
    _, outcome = executed(network, tmp_path / "run.nc", every="0.5")
    assert outcome.status == "failed" and outcome.checkpoint == (str(tmp_path / "run.checkpoint"), 1.0)
    _, again = executed(network, tmp_path / "run.nc", resume=True)
    assert again.status == "failed" and str(again.error) == str(outcome.error) and again.resumed == 1.0
    assert_same_results(tmp_path / "run.nc", executed(network, tmp_path / "whole.nc")[0].output)


def test_a_run_that_diverged_needs_none_any_more(wired, tmp_path):
    network = wired(SMALL[: SMALL.index("  gain")].replace("Oscillator, parameters: {w: 2}", "Explosive"))
    assert executed(network, tmp_path / "run.nc", every="0.5")[1].status == "diverged"
    assert not (tmp_path / "run.checkpoint").exists()
    with pytest.raises(NothingToResume, match=r"nothing to do: the run in .*run\.nc is diverged") as caught:
        executed(network, tmp_path / "run.nc", resume=True)
    assert caught.value.status == "diverged"


# ---- the interval ----


@pytest.mark.parametrize(
    ("text", "simulated", "passed"),
    [("0.5", 0.5, None), ("1e3", 1000, None), ("10min", None, 600), ("2 h", None, 7200)],
)
def test_intervals_are_simulated_or_of_wall_clock_time(text, simulated, passed):
    interval = Interval.read(text)
    assert interval.simulated == (simulated or np.inf) and interval.passed == (passed or np.inf)


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "inf", "1e999", "10s", "min", "0h", "1,5", "1 2", "--", "1e"])
def test_what_is_no_interval_is_said(text):
    with pytest.raises(WrongValue, match="is no interval of checkpoints"):
        Interval.read(text)


def times_of(network, output, every, monkeypatch) -> list[float]:
    taken = []
    write = CheckpointFile.write

    def noted(self, about, tree):
        taken.append(about["time"])
        write(self, about, tree)

    with monkeypatch.context() as patch:
        patch.setattr(CheckpointFile, "write", noted)
        assert executed(network, output, every=every)[1].status == "completed"
    return taken


def test_simulated_intervals_are_rounded_up_to_steps(small, wired, tmp_path, monkeypatch):
    assert times_of(small, tmp_path / "a.nc", "0.5", monkeypatch) == [0, 0.5, 1.0, 1.5]
    coarse = wired(SMALL.replace("step: 0.01", "step: 0.4").replace("record: {period: 0.01", "record: {period: 0.4"))
    assert times_of(coarse, tmp_path / "b.nc", "0.5", monkeypatch) == pytest.approx([0, 0.8, 1.6])
    assert times_of(small, tmp_path / "c.nc", "1e300", monkeypatch) == [0]


def test_wall_clock_time_is_counted_from_the_last_one(small, tmp_path, monkeypatch):
    hours = iter(range(0, 10**9, 3600))
    monkeypatch.setattr("cosim.engine.checkpoints.clock.perf_counter", lambda: float(next(hours)))
    assert len(times_of(small, tmp_path / "run.nc", "1h", monkeypatch)) > 1
    assert times_of(small, tmp_path / "run.nc", "1e6h", monkeypatch) == [0]


def test_a_resumed_run_goes_on_as_often_unless_it_is_told_otherwise(small, tmp_path):
    output = tmp_path / "run.nc"
    killed(small, output, 0.8, every="0.3")
    killed(small, output, 1.1, resume=True)
    assert decoded((tmp_path / "run.checkpoint").read_bytes())[0]["time"] == pytest.approx(0.9)
    killed(small, output, 1.75, resume=True, every="0.4")
    assert decoded((tmp_path / "run.checkpoint").read_bytes())[0]["time"] == pytest.approx(1.6)


# ---- what is refused ----

CHANGES = {
    "a parameter": ("{w: 2}", "{w: 2.5}", "`blocks.swing.parameters.w` was 2 and is 2.5"),
    "the step": ("step: 0.01", "step: 0.005", "`run.step` was 0.01 and is 0.005"),
    "the end": ("stop: 2", "stop: 3", "`run.stop` was 2.0 and is 3.0"),
    "a metric": ("reduce: rms", "reduce: mean", "`metrics.m.reduce` was rms and is mean"),
    "what is recorded": ("[swing.x, gain.y]", "[swing.x]", "`record.signals` was .* and is .*"),
    "a block's type": ("type: Gain, parameters: {k: 2}", "type: Picky", "`blocks.gain.python` is another"),
    "a block more": ("blocks:", "blocks:\n  more: {type: Oscillator}", "`blocks.more.python` is new"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_checkpoint_of_another_diagram_is_refused_with_what_has_changed(wired, tmp_path, what):
    old, new, words = CHANGES[what]
    output = tmp_path / "run.nc"
    killed(wired(SMALL), output, 1.0, every="0.4")
    content, result = (tmp_path / "run.checkpoint").read_bytes(), output.read_bytes()
    with pytest.raises(CheckpointError, match=words) as caught:
        executed(wired(SMALL.replace(old, new)), output, resume=True)
    assert "is of another run" in caught.value.message and "leave --resume out" in caught.value.fix
    assert (tmp_path / "run.checkpoint").read_bytes() == content and output.read_bytes() == result
    assert executed(wired(SMALL), output, resume=True)[1].status == "completed"


def test_words_and_patience_may_change(wired, tmp_path):
    killed(wired(SMALL), tmp_path / "run.nc", 1.0, every="0.4")
    text = SMALL.replace("title: small", "title: another").replace("step: 0.01", "step: 0.01, patience: 99")
    assert executed(wired(text + "# words\n"), tmp_path / "run.nc", resume=True)[1].status == "completed"


BLOCKS = """
from cosim import Block, Output

FACTOR = 2.0

class Wave(Block):
    y = Output()

    def outputs(time, y):
        y[0] = FACTOR * time
"""


def test_code_that_has_changed_is_refused(tmp_path):
    blocks, diagram = tmp_path / "blocks.py", tmp_path / "diagram.yaml"
    diagram.write_text(
        "run: {stop: 2, step: 0.01}\nblocks: {wave: {python: blocks.py:Wave}}\nrecord: {signals: [wave.y]}\n"
    )
    blocks.write_text(BLOCKS)
    killed(run.load(diagram), tmp_path / "run.nc", 1.0, every="0.4")
    blocks.write_text(BLOCKS.replace("2.0", "3.0"))
    with pytest.raises(CheckpointError, match="is of another run: the code of block wave is another\n"):
        executed(run.load(diagram), tmp_path / "run.nc", resume=True)
    blocks.write_text(BLOCKS + "\n# words\n")
    assert executed(run.load(diagram), tmp_path / "run.nc", resume=True)[1].status == "completed"


TRIPLE = object_code.host()[0]


@pytest.mark.parametrize(
    ("patched", "value", "words"),
    [
        ("cosim.results.software_versions.np.__version__", "1.0.0", r"numpy was \S+ and is 1\.0\.0"),
        ("cosim.results.software_versions.platform.python_version", lambda: "3.1", r"python was \S+ and is 3\.1"),
        ("cosim.machine.object_code.host", lambda: (TRIPLE, "generic", ""), "the processor was .* and is generic"),
        ("cosim.engine.run_key.own_files", lambda: b"other", "cosim's own code is another"),
    ],
)
def test_other_software_and_other_machines_are_refused(small, tmp_path, monkeypatch, patched, value, words):
    killed(small, tmp_path / "run.nc", 1.0, every="0.4")
    resumed = Run(small, output=tmp_path / "run.nc", resume=True)
    assert resumed.simulation  # compiled before, as nothing need be compiled for another processor
    monkeypatch.setattr(patched, value)
    with pytest.raises(CheckpointError, match=words):
        resumed.execute()


def test_the_other_engine_is_refused(small, tmp_path):
    killed(small, tmp_path / "run.nc", 1.0, every="0.4")
    with pytest.raises(CheckpointError, match="the engine was native and is python"):
        executed(small, tmp_path / "run.nc", resume=True, engine="python")


def test_without_a_checkpoint_there_is_nothing_to_go_on_from(small, tmp_path):
    with pytest.raises(CheckpointError, match=r"there is no checkpoint .*run\.checkpoint\n") as caught:
        executed(small, tmp_path / "run.nc", resume=True)
    assert caught.value.fix == "leave --resume out to begin anew" and list(tmp_path.glob("run*")) == []
    executed(small, tmp_path / "run.nc")
    with pytest.raises(CheckpointError, match=r"and the run in .*run\.nc, which is completed, kept none"):
        executed(small, tmp_path / "run.nc", resume=True)


def test_of_a_run_that_has_come_to_its_end_there_is_nothing_to_do(small, wired, tmp_path):
    executed(small, tmp_path / "run.nc", every="1")
    with pytest.raises(NothingToResume, match=r"nothing to do: the run in .*run\.nc is completed") as caught:
        executed(small, tmp_path / "run.nc", resume=True)
    assert caught.value.status == "completed"
    with pytest.raises(CheckpointError, match=r"no checkpoint .*, and the run in .*, which is completed, was another"):
        executed(wired(SMALL.replace("w: 2", "w: 3")), tmp_path / "run.nc", resume=True)


def test_the_result_of_another_run_is_not_gone_on_with(small, tmp_path):
    output, checkpoint = tmp_path / "run.nc", tmp_path / "run.checkpoint"
    killed(small, output, 1.0, every="0.4")
    executed(small, output)  # which has no checkpoints of its own, and leaves this one
    content = output.read_bytes()
    with pytest.raises(CheckpointError, match=r"another run has written .*run\.nc since") as caught:
        executed(small, output, resume=True)
    assert "run.previous.nc" in caught.value.fix and output.read_bytes() == content and checkpoint.exists()
    (tmp_path / "run.previous.nc").replace(output)
    assert executed(small, output, resume=True)[1].status == "completed"
    output.unlink()


@pytest.mark.parametrize("damage", ["the end", "an index", "more", "nothing"])
def test_what_a_kill_leaves_of_a_result_is_gone_on_with(small, tmp_path, damage):
    """When a machine stops, pieces may be missing: whatever is there is brought back to what the checkpoint has."""
    output = tmp_path / "run.nc"
    whole = executed(small, tmp_path / "whole.nc")
    killed(small, output, 1.0, every="0.4")
    content = bytearray(output.read_bytes())
    if damage == "the end":  # where the file ends, which is written last
        content[40:48] = (len(content) // 2).to_bytes(8, "little")
    elif damage == "an index":
        at = content.find(b"TREE")
        while at >= 0:
            content[at + 24 : at + 64] = bytes(40)
            at = content.find(b"TREE", at + 1)
    elif damage == "more":
        content += b"x" * 100_000
    output.write_bytes(content)
    assert_same(whole, executed(small, output, resume=True))


LONGER = SMALL.replace("stop: 2", "stop: 40")  # with some full chunks


@pytest.mark.parametrize("damage", ["gone", "empty", "another", "cut", "samples"])
def test_a_result_that_is_damaged_is_not_gone_on_with(wired, tmp_path, damage):
    network, output = wired(LONGER), tmp_path / "run.nc"
    killed(network, output, 36.0, every="35")
    content = output.read_bytes()
    if damage == "gone":
        output.unlink()
    elif damage == "another":
        executed(network, output)
    elif damage == "samples":
        with open_result(output) as result:
            at = content.find(result["gain.y"][500:501].tobytes())
        output.write_bytes(content[:at] + b"\0" + content[at + 1 :])
    else:
        output.write_bytes(content[: 2000 if damage == "cut" else 0])
    with pytest.raises((CheckpointError, ResultError), match=r"cannot be resumed: |is damaged: its samples") as caught:
        executed(network, output, resume=True)
    assert "leave --resume out to begin anew" in caught.value.fix
    output.write_bytes(content)
    assert executed(network, output, resume=True)[1].status == "completed"


def test_a_new_run_does_not_take_the_checkpoint_of_one_that_is_going_on(small, tmp_path, monkeypatch):
    """It would be removed by whichever comes to its end first, and the other could not be resumed."""
    monkeypatch.setattr("cosim.results.checkpoint_file.GRACE", 0.05)
    output, refused = tmp_path / "run.nc", []

    def watch(time: float) -> None:
        with pytest.raises(CheckpointError, match="still going on") as caught:
            executed(small, output, every="0.2")
        refused.append(caught.value)

    one = executed(small, output, every="0.2", watch=watch)
    assert len(refused) > 2 and not (tmp_path / "run.previous.nc").exists()
    assert_same(executed(small, tmp_path / "whole.nc"), one)
    killed(small, output, 0.5, every="0.2")  # whose checkpoint is nobody's any more
    assert_same(one, executed(small, output, every="0.2"))


def test_two_runs_do_not_go_on_from_one_checkpoint_at_once(small, tmp_path, monkeypatch):
    """The second one would write into the result of the first, and both would come to their end."""
    monkeypatch.setattr("cosim.results.checkpoint_file.GRACE", 0.05)
    output = tmp_path / "run.nc"
    killed(small, output, 0.5, every="0.2")
    refused = []

    def watch(time: float) -> None:
        with pytest.raises(CheckpointError, match="still going on") as caught:
            executed(small, output, resume=True)
        refused.append(caught.value)

    whole, resumed = executed(small, tmp_path / "whole.nc"), executed(small, output, resume=True, watch=watch)
    assert len(refused) > 2
    assert_same(whole, resumed)


# ---- damage ----


def test_any_damage_to_a_checkpoint_is_found(small, tmp_path):
    output, path = tmp_path / "run.nc", tmp_path / "run.checkpoint"
    killed(small, output, 1.0, every="0.4")
    whole, result = path.read_bytes(), output.read_bytes()
    draw = np.random.default_rng(1)
    damaged = [b"", whole[:7], whole[:8], whole[:60], whole[: len(whole) // 2], whole[:-1], whole + b"\0"]
    damaged += [whole[:8] + bytes(40) + whole[48:], b"x" * 5000, b"cosimCP1" + os.urandom(500)]
    for _ in range(60):
        at = int(draw.integers(len(whole)))
        damaged.append(whole[:at] + bytes([whole[at] ^ (1 << int(draw.integers(8)))]) + whole[at + 1 :])
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises((CheckpointError, ResultError), match=r"is damaged|is not a checkpoint"):
            executed(small, output, resume=True)
        assert path.read_bytes() == content and output.read_bytes() == result
    path.write_bytes(whole)
    assert executed(small, output, resume=True)[1].status == "completed"


FORGED = {
    "a smaller arena": lambda tree: tree["simulation"].update(arena=tree["simulation"]["arena"][:-8]),
    "fewer words": lambda tree: tree["simulation"].update(control=tree["simulation"]["control"][:3]),
    "no time of the run": lambda tree: tree["simulation"]["control"].__setitem__(
        run_state._TAKEN.index(tables.TICK), -5
    ),
    "instances": lambda tree: tree["simulation"].update(parts=[{}]),
    "no arena": lambda tree: tree["simulation"].pop("arena"),
    "no metric": lambda tree: tree["reductions"]["metrics"].pop("mean"),
    "no sum": lambda tree: tree["reductions"]["metrics"]["mean"].pop("units"),
    "no reductions": lambda tree: tree.update(reductions=[]),
}


@pytest.mark.parametrize("what", FORGED)
def test_a_state_that_does_not_fit_the_run_does_no_harm(wired, tmp_path, what):
    network = wired(ALL.replace("HOW", HOW["jacobi"]))
    output, path = tmp_path / "run.nc", tmp_path / "run.checkpoint"
    killed(network, output, 1.0, every="0.4")
    about, tree = decoded(path.read_bytes())
    FORGED[what](tree)
    path.write_bytes(b"".join(map(bytes, encoded(about, tree))))
    outcome = executed(network, output, resume=True)[1]
    assert outcome.status == "failed" and "is damaged" in outcome.error.message


def test_what_is_no_checkpoint_is_not_replaced(small, tmp_path):
    (tmp_path / "run.checkpoint").write_text("mine")
    with pytest.raises(ResultError, match="is not a checkpoint of a run: it is not replaced"):
        Run(small, output=tmp_path / "run.nc", checkpoint="1")
    assert (tmp_path / "run.checkpoint").read_text() == "mine"


# ---- a full disk ----


def test_a_full_disk_ends_the_run_and_the_last_checkpoint_stays(small, tmp_path, monkeypatch):
    """From the third checkpoint on there is no space: the run goes on from the second when there is some again."""
    output, path = tmp_path / "run.nc", tmp_path / "run.checkpoint"
    written, write = [], CheckpointFile.write

    def full(self, about, tree):
        with monkeypatch.context() as patch:
            if len(written) == 2:
                patch.setattr(os, "fsync", lambda file: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left")))
            write(self, about, tree)
        written.append(path.read_bytes())

    with monkeypatch.context() as patch:
        patch.setattr(CheckpointFile, "write", full)
        outcome = executed(small, output, every="0.4")[1]
    assert outcome.status == "failed" and isinstance(outcome.error, ResultError)
    assert outcome.error.message == f"cannot write {path}: No space left"
    assert path.read_bytes() == written[-1] and outcome.checkpoint == (str(path), 0.4)
    assert sorted(p.name for p in tmp_path.glob("*run*")) == ["run.checkpoint", "run.nc"]
    resumed = executed(small, output, resume=True)
    assert resumed[1].resumed == 0.4
    assert_same(executed(small, tmp_path / "whole.nc"), resumed)


def test_plain_python_is_warned_of(wired, tmp_path):
    network = wired(
        SMALL.replace(
            "gain: {type: Gain, parameters: {k: 2}, inputs: {u: [swing.x]}}",
            "gain: {type: Table, inputs: {u: swing.x}}",
        )
    )
    outcome = executed(network, tmp_path / "run.nc", every="1")[1]
    (warning,) = [w for w in outcome.warnings if isinstance(w, CheckpointError)]
    assert "block gain is plain Python" in warning.message and warning.position.line == 6
    assert not executed(network, tmp_path / "run.nc")[1].warnings


def test_a_run_without_checkpoints_writes_none(small, tmp_path):
    executed(small, tmp_path / "run.nc")
    assert [path.name for path in tmp_path.glob("run*")] == ["run.nc"]
    with open_result(tmp_path / "run.nc") as result:
        assert "checkpoints" not in result.attrs
