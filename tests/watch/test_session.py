"""What a session makes of saves, sliders, crashes and runs without end; files are edited as editors do it."""

import math
import shutil
import textwrap
import time

import numpy as np
import pytest

from cosim.engine import run as engine
from cosim.results.formatting import format_value
from cosim.watch.session import WatchSession
from tests.watch.conftest import BLOCK, LAG, ROOT, until

ENDLESS = LAG.replace("stop: 4", "stop: 1.0e+9").replace("period: 0.01", "period: 1000")


@pytest.fixture
def session(lag, tmp_path_factory):
    """Begin to watch a diagram of the folder, after its text is written; as `Follower`."""
    begun = []

    def begin(text=LAG, name="lag.yaml", *settings):
        if text is not None:
            (lag / name).write_text(textwrap.dedent(text), encoding="utf-8")
        one = WatchSession(lag / name, settings, (), tmp_path_factory.mktemp("samples"))
        begun.append(one)
        one.start()
        return Follower(one, lag / name)

    yield begin
    for one in begun:
        one.close()


class Follower:
    """Sees the states of a session as a page does."""

    def __init__(self, session: WatchSession, path) -> None:
        self.session, self.path, self.version, self.state = session, path, 0, {}

    def until(self, holds):
        """The first state for which something holds."""

        def seen():
            self.version, state = self.session.wait(self.version, 0.1)
            self.state = state or self.state
            return self.state and holds(self.state)

        until(seen, "a state")
        return self.state

    def rests(self, holds=lambda state: True):
        """The first state after which nothing goes on."""
        return self.until(lambda state: state["advance"] is None and holds(state))

    def figure(self, name="last") -> float:
        row = next(m for m in self.state["run"]["metrics"] if m["name"] == name)
        return float(row["value"])

    def save(self, text: str) -> None:
        """As many editors do: another file takes the place of the one before."""
        new = self.path.with_name("new~")
        new.write_text(textwrap.dedent(text), encoding="utf-8")
        new.replace(self.path)


def lagged(time: float, T: float) -> float:
    return float(f"{1.0 - math.exp(-time / T):.4g}")


def number(state) -> int:
    return state["run"]["number"] if state["run"] else 0


def test_a_save_by_rename_is_seen(session):
    one = session()
    first = number(one.rests())
    assert one.figure() == lagged(4, 0.5)
    one.save(LAG.replace("T: 0.5", "T: 2"))
    state = one.rests(lambda state: number(state) > first)
    assert one.figure() == lagged(4, 2) and state["run"]["before"] == first
    assert state["run"]["metrics"][0]["before"] == "0.9997"


def test_a_file_that_is_away_for_a_moment_is_none_that_is_gone(session):
    one = session()
    first = number(one.rests())
    text = one.path.read_text()
    one.path.unlink()
    time.sleep(0.1)
    one.path.write_text("")
    time.sleep(0.1)
    one.path.write_text(text.replace("T: 0.5", "T: 1"))
    one.until(lambda state: not state["mistakes"] and number(state) > first)
    assert one.figure() == lagged(4, 1)
    one.path.unlink()
    state = one.until(lambda state: state["mistakes"])
    assert "lag.yaml" in state["mistakes"][0]["message"] and number(state) > first
    one.path.write_text(text)
    one.until(lambda state: not state["mistakes"] and state["advance"] is None)
    until(lambda: one.rests() and one.figure() == lagged(4, 0.5))


def test_a_run_without_end_makes_way_for_the_next_save(session):
    one = session(ENDLESS)
    one.until(lambda state: state["advance"] and state["advance"]["part"])
    assert one.state["sketch"]["title"] == "A lag <b>of first order</b>"
    one.save(LAG)
    one.rests(lambda state: state["run"])
    assert one.figure() == lagged(4, 0.5)
    assert len([*one.session._folder.iterdir()]) == 1  # the samples of the run that was given up are gone


def test_sliders_do_not_wait_for_a_run_without_end(session):
    one = session(ENDLESS)
    one.until(lambda state: state["advance"] and state["advance"]["part"])
    one.session.slide({"blocks.lag.parameters.T": 1.0, "blocks.lag.parameters.none": 1.0})
    state = one.until(lambda state: state["chosen"] and state["advance"] and state["advance"]["part"])
    assert [line["option"] for line in state["chosen"]] == ["--set blocks.lag.parameters.T=1.0"]


def test_sliders_are_compared_with_the_file_and_dropped_by_a_save(session):
    one = session()
    first = number(one.rests())
    for T in (1.0, 2.0, 3.0):
        one.session.slide({"blocks.lag.parameters.T": T})
    state = one.rests(lambda state: state["run"]["metrics"][0]["value"] == f"{lagged(4, 3):.4f}")
    assert state["run"]["before"] == first
    one.save(LAG.replace("T: 0.5", "T: 4"))
    state = one.rests(lambda state: not state["chosen"] and number(state) > state["slid"] - 1 > first)
    assert one.figure() == lagged(4, 4) and state["run"]["before"] == first


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("import os; os._exit(7)", "exit() with code 7"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "segmentation fault"),
    ],
)
def test_a_block_that_ends_the_process_does_not_end_the_page(session, lag, code, how):
    one = session()
    one.rests(lambda state: state["run"])
    rule = f"\n    @rule('it holds')\n    def kept(T):\n        {code}\n"
    (lag / "lag.py").write_text(BLOCK.replace("State\n", "State, rule\n") + rule)
    state = one.rests(lambda state: state["mistakes"])
    assert how in state["mistakes"][0]["message"]
    assert one.figure() == lagged(4, 0.5)
    (lag / "lag.py").write_text(BLOCK.replace("(u - x)", "(2.0 * u - x)"))
    one.rests(lambda state: not state["mistakes"])
    assert one.figure() == float(f"{2 * (1 - math.exp(-8)):.4g}")


def test_exit_and_an_endless_rule_and_a_broken_import_are_told_and_replaced(session, lag):
    one = session()
    one.rests(lambda state: state["run"])
    head = BLOCK.replace("State\n", "State, rule\n") + "\n    @rule('it holds')\n    def kept(T):\n        "
    (lag / "lag.py").write_text(head + "raise SystemExit(3)\n")
    state = one.rests(lambda state: state["mistakes"])
    assert "SystemExit(3)" in state["mistakes"][0]["message"] and state["mistakes"][0]["lines"]
    (lag / "lag.py").write_text(head + "while True:\n            pass\n")
    one.until(lambda state: state["advance"])
    time.sleep(0.3)
    (lag / "lag.py").write_text("def broken(:\n")
    state = one.rests(lambda state: state["mistakes"] and "lag.py" in state["mistakes"][0]["place"])
    assert state["mistakes"][0]["line"] == 1
    (lag / "lag.py").write_text(BLOCK)
    one.rests(lambda state: not state["mistakes"])


def test_what_a_diagram_is_made_from_is_watched(session, lag):
    (lag / "inner.yaml").write_text(
        "blocks: {l: {python: lag.py:Lag, parameters: {T: 1}, inputs: {u: 1}}}\noutputs: {x: l.x}\n"
    )
    base = """
        run: {stop: 4, step: 1.0e-3, method: joint, integrator: rk4}
        blocks: {outer: {diagram: inner.yaml}}
        metrics: {last: {signal: outer.x, reduce: final}}
        """
    (lag / "base.yaml").write_text(textwrap.dedent(base))
    one = session("extends: base.yaml\n", "top.yaml")
    one.rests(lambda state: state["run"])
    assert one.figure() == lagged(4, 1)
    for name, old, new, figure in (
        ("inner.yaml", "T: 1", "T: 2", lagged(4, 2)),
        ("base.yaml", "stop: 4", "stop: 2", lagged(2, 2)),
        ("lag.py", "(u - x)", "(-u - x)", -lagged(2, 2)),
        ("top.yaml", "extends", "title: t\nextends", -lagged(2, 2)),
    ):
        path, before = lag / name, number(one.state)
        path.write_text(path.read_text().replace(old, new))
        one.rests(lambda state, before=before: number(state) > before)
        assert one.figure() == figure, name
    assert one.state["sketch"]["title"] == "t"
    one.session.slide({"blocks.outer/l.parameters.T": 1.0})
    one.rests(lambda state: state["chosen"])
    assert one.figure() == -lagged(2, 1)
    assert one.state["chosen"][0]["yaml"] == "blocks:\n  outer/l:\n    parameters: {T: 1.0}"
    found = one.session.block("outer")
    assert [part["name"] for part in found["parts"]] == ["outer/l"] and not one.session.block("none")


def test_a_run_that_diverges_shows_how_far_it_came(session):
    one = session()
    first = number(one.rests(lambda state: state["run"]))
    one.save(LAG.replace("u: 1}", "u: source.y}").replace("  lag:", '  source: {expression: "1/(1 - time)"}\n  lag:'))
    state = one.rests(lambda state: number(state) > first or state["mistakes"])
    assert state["run"]["status"] in ("diverged", "failed") and state["run"]["errors"]
    track = one.session.track(number(state))
    assert 90 <= len(track.times) <= 101 and np.isfinite(track.read("lag.x")).all()
    one.save(LAG)
    state = one.rests(lambda state: state["run"]["status"] == "completed")
    assert state["run"]["before"] == first  # a run that came to no end is nothing to be compared with


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("motor.yaml", "blocks.controller.parameters.k_p", 0.7),
        ("motor.yaml", "blocks.motor.parameters.A.1.1", -3.0),
        ("thermostat.yaml", "blocks.ambient.parameters.value", 3.0),
        ("sampled_pi.yaml", "blocks.reference.parameters.final", 2.5),
    ],
)
def test_a_slider_gives_the_figures_and_samples_of_the_command_line_to_the_bit(session, lag, name, path, value):
    shutil.copy(ROOT / "diagrams" / name, lag / name)
    one = session(None, name)
    one.rests(lambda state: state["run"] or state["mistakes"])
    one.session.slide({path: value})
    state = one.rests(lambda state: state["chosen"] and number(state) > state["slid"])
    network = engine.load(lag / name, [state["chosen"][0]["option"].removeprefix("--set ")])
    run = engine.Run(network, kept=True)
    outcome = run.execute()
    times, values = run.samples.flat()
    track = one.session.track(number(state))
    np.testing.assert_array_equal(track.times, times)
    for signal, expected in values.items():
        np.testing.assert_array_equal(track.read(signal), expected)
    shown = {metric["name"]: metric["value"] for metric in state["run"]["metrics"]}
    assert shown == {metric: format_value(figure) for metric, figure in outcome.metrics.items()}
    assert {w["message"] for w in state["run"]["warnings"]} == {w.message for w in outcome.warnings}
    before = one.session.track(state["run"]["before"])
    assert any(track.read(signal).tobytes() != before.read(signal).tobytes() for signal in values)


def test_more_signals_are_recorded_on_demand(session, lag):
    one = session(
        LAG.replace("signals: [lag.x]", "signals: []").replace("metrics:", "metrics_:").replace("metrics_", "#")
    )
    one.rests(lambda state: state["run"])
    assert one.state["run"]["signals"] == []
    one.session.show("lag.x")
    one.session.show("lag.none")
    state = one.rests(lambda state: state["run"]["signals"])
    assert [signal["name"] for signal in state["run"]["signals"]] == ["lag.x"]
    times = one.session.track(number(state)).times
    np.testing.assert_allclose(one.session.track(number(state)).read("lag.x"), 1 - np.exp(-times / 0.5), atol=1e-9)


def test_names_may_be_any_text(session, lag):
    text = LAG.replace("lag.py", "ö.py").replace("  lag:", '  "größe-µ":').replace("lag.x", "größe-µ.x")
    shutil.copy(lag / "lag.py", lag / "ö.py")
    one = session(text, "naïve <i>.yaml")
    state = one.rests(lambda state: state["run"] or state["mistakes"])
    if state["mistakes"]:
        pytest.fail(state["mistakes"][0]["message"])
    assert one.figure() == lagged(4, 0.5) and one.session.block("größe-µ")


def test_samples_of_runs_that_are_not_shown_are_deleted(session):
    one = session()
    one.rests(lambda state: state["run"])
    for k in range(1, 6):
        before = number(one.state)
        one.save(LAG.replace("T: 0.5", f"T: {k}"))
        one.rests(lambda state, before=before: number(state) > before)
        one.session.slide({"blocks.lag.parameters.T": 0.1})
        one.rests(lambda state: state["chosen"] and number(state) > state["slid"])
    assert len([*one.session._folder.iterdir()]) == 3  # what is shown, the file, and the save before
