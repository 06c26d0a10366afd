"""Settings of an FMU in a diagram: the experiment, event mode, what it logs and where; as the test FMU is told them."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors
from tests.fmu import told

EVENTFUL = 'hasEventMode="true"'
KINDS = {
    "2 cs": (2, "cs", ""),
    "3 cs": (3, "cs", ""),
    "3 events": (3, "cs", EVENTFUL),
    "2 me": (2, "me", 'completedIntegratorStepNotNeeded="true"'),
    "3 me": (3, "me", ""),
}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The test FMU by kind; `refusing` declares event mode and cannot do it."""
    folder = tmp_path_factory.mktemp("told")
    made = {kind: told.build(folder / kind.replace(" ", ""), *what) for kind, what in KINDS.items()}
    made["refusing"] = told.build(folder / "refusing", 3, "cs", EVENTFUL, ("-DREFUSES_EVENT_MODE",))
    return made


@pytest.fixture
def diagram(write, fmus):
    """Write a diagram of one FMU with these keys; more: of the diagram."""

    def write_keys(kind: str, keys: str = "", more: str = "", step: str = "0.25"):
        return write(f"run: {{stop: 1, step: {step}}}\nblocks: {{plant: {{fmu: {fmus[kind]}{keys}}}}}\n{more}")

    return write_keys


@pytest.fixture
def told_of(diagram, trajectories):
    """What an FMU with these keys has been told of its outputs, at every step."""

    def outputs(kind: str, keys: str, *names: str, engine: str = "native"):
        got = trajectories(run.load(diagram(kind, keys)), *(f"plant.{name}" for name in names), engine=engine)
        return [got[f"plant.{name}"].ravel() for name in names]

    return outputs


def mistake(path, *settings: str) -> str:
    """What is wrong with a diagram, which must have one mistake."""
    with pytest.raises(DiagramErrors) as caught:
        run.load(path, settings)
    (error,) = caught.value.errors
    return str(error)


# ---- the experiment ----


@pytest.mark.parametrize("isolated", ["false", "true"])
@pytest.mark.parametrize("kind", KINDS)
def test_tolerance_and_start_time_reach_the_fmu(told_of, kind, isolated):
    """Its clock is the run's, and the start time. Quarters are exact."""
    keys = f", tolerance: 1.0e-3, start_time: 8, isolate: {isolated}"
    tolerance, start, clock = told_of(kind, keys, "tolerance", "start", "clock")
    assert {*tolerance} == {1e-3} and {*start} == {8.0}
    assert np.array_equal(clock, 8.0 + np.arange(5) / 4)


@pytest.mark.parametrize("kind", KINDS)
def test_without_settings_an_fmu_is_told_of_no_tolerance_and_begins_at_0(told_of, kind):
    tolerance, start, clock = told_of(kind, "", "tolerance", "start", "clock", engine="python")
    assert {*tolerance} == {-1.0} and {*start} == {0.0}
    assert np.array_equal(clock, np.arange(5) / 4)


def test_time_events_and_ends_are_told_by_the_runs_clock(machines, write, trajectories):
    """The ball of `machine.c` ticks at every quarter of a second of its own clock, and ends at 1.5 s of it."""
    for name, mode in (
        ("2", "model-exchange"),
        ("3", "model-exchange"),
        ("3e", "co-simulation"),
        ("2", "co-simulation"),
    ):
        keys = f"fmu: {machines[name]}, mode: {mode}, start_time: 1, parameters: {{fault: FAULT, fault_time: 1.5}}"
        text = f"run: {{stop: 1, step: 0.01}}\nblocks: {{plant: {{{keys}}}}}\n"
        got = trajectories(run.load(write(text.replace("FAULT", "0"))), "plant.ticks")["plant.ticks"].ravel()
        assert np.array_equal(got[1:] - got[1], np.floor(np.arange(1, 101) / 25 + 1e-9)), (name, mode)
        if (name, mode) in (("2", "model-exchange"), ("3e", "co-simulation")):  # others tell of their end by other ways
            outcome = run.Run(run.load(write(text.replace("FAULT", "6")))).execute()
            assert "ended the simulation at t = 0.5 s" in outcome.reason, (name, mode)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (", tolerance: 0", "`blocks.plant.tolerance` must be a number from 1e-13 to 0.1, not `0`"),
        (", tolerance: small", "unknown name `small`"),
        (", start_time: .inf", "`blocks.plant.start_time` must be finite"),
        (", start_time: now", "unknown name `now`"),
        (", start_time: 1.0e+13", "begins at 1e+13 s goes in steps of 0.002 s, and `run.step` is 0.25 s"),
        (", start_time: -1.0e+17", "begins at -1e+17 s goes in steps of 16 s"),
        (", event_mode: maybe", "`blocks.plant.event_mode` cannot be the text `maybe`"),
        (", log: []", "`blocks.plant.log` is an empty list"),
        (", log: 3", "`blocks.plant.log` must be text"),
        (", log: [logEvent]", "`told3.fmu` has no log category `logEvent`\n    fix: did you mean `logEvents`?"),
        (", log: error", "has no log category `error`"),
        (", log_file: 3", "`blocks.plant.log_file` must be text"),
    ],
)
def test_what_is_wrong_is_said_where_it_stands(diagram, keys, words):
    text = mistake(diagram("3 events", keys))
    assert words in text
    assert "diagram.yaml:2:" in text


# ---- event mode ----


def test_event_mode_is_used_where_there_is_one_unless_it_is_switched_off(told_of):
    for keys, used in (("", 1), (", event_mode: auto", 1), (", event_mode: on", 1), (", event_mode: off", 0)):
        (events,) = told_of("3 events", keys, "events")
        assert {*events} == {used}, keys
    (events,) = told_of("3 cs", ", event_mode: off", "events")
    assert {*events} == {0}


def test_without_event_mode_feedthrough_has_a_step_of_delay(diagram):
    """As of any plain Co-Simulation."""
    declared = [
        run.load(diagram("3 events", keys)).components["plant"].declaration for keys in ("", ", event_mode: off")
    ]
    assert [bool(d.writer("y").reads) for d in declared] == [True, False]


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        ("3 cs", "its description declares none"),
        ("2 cs", "its description declares none"),
        ("3 me", "model exchange always has one"),
    ],
)
def test_event_mode_cannot_be_switched_on_where_there_is_none(diagram, kind, why):
    assert why in mistake(diagram(kind, ", event_mode: on"))


def test_an_fmu_that_refuses_its_event_mode_says_what_to_write(diagram, told_of):
    outcome = run.Run(run.load(diagram("refusing"))).execute()
    assert outcome.status == "failed"
    assert "fmi3Instantiate() gave no instance" in outcome.error.message
    assert "it says error: no event mode here" in outcome.error.message
    assert "--set blocks.plant.event_mode=off" in outcome.error.fix
    (events,) = told_of("refusing", ", event_mode: off", "events")
    assert {*events} == {0}


# ---- logging ----


@pytest.mark.parametrize("kind", ["2 cs", "3 cs", "2 me", "3 me"])
@pytest.mark.parametrize(
    ("keys", "logging", "categories"),
    [
        ("", 1, 1),  # logStatusWarning
        (", log: errors", 1, 1),
        (", log: all", 1, 0),
        (", log: none", 0, 0),
        (", log: [logEvents, logSteps]", 1, 2),
        (", log: logSteps", 1, 1),
    ],
)
def test_an_fmu_is_told_what_to_log(told_of, kind, keys, logging, categories):
    got = told_of(kind, keys, "logging", "categories")
    assert [{*values} for values in got] == [{logging}, {categories}]


@pytest.mark.parametrize("isolated", ["false", "true"])
@pytest.mark.parametrize("kind", ["2 cs", "3 cs"])
def test_messages_are_written_as_they_come(write, fmus, tmp_path, monkeypatch, kind, isolated):
    monkeypatch.chdir(tmp_path)
    text = f"""
        run: {{stop: 1, step: 0.5}}
        fleets: {{robot: 2}}
        blocks:
          plant:
            {{fmu: {fmus[kind]}, per: robot, log: all, log_file: logs/plant.log, isolate: {isolated}}}
        """
    for _ in range(2):  # a second run replaces the first one's
        outcome = run.Run(run.load(write(text))).execute()
        assert outcome.status == "completed", outcome.error
        lines = (tmp_path / "logs" / "plant.log").read_text().splitlines()
        assert lines[0] == f"# messages of plant (told{kind[0]}.fmu)"
        for robot in (1, 2):
            assert [line for line in lines if line.startswith(f"plant_{robot} ")] == [
                f"plant_{robot} [logEvents] ok: ready",
                f"plant_{robot} [logStatusWarning] warning: be careful",
                f"plant_{robot} [logSteps] ok: step to 0.5",
                f"plant_{robot} [logSteps] ok: step to 1",
            ]
        assert len(lines) == 9


def test_only_the_categories_that_are_named_are_written(diagram, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run.Run(run.load(diagram("3 cs", ", log: [logSteps], log_file: some.log"))).execute().status == "completed"
    assert (tmp_path / "some.log").read_text().count("\n") == 5
    assert "ready" not in (tmp_path / "some.log").read_text()


def test_a_log_file_replaces_nothing_else(diagram, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "precious.txt").write_text("precious")
    for name, words in (
        ("precious.txt", "`precious.txt` is no log of messages, and would be lost"),
        (".", "`.` is no log of messages"),
        ("precious.txt/x.log", "`precious.txt/x.log` cannot be written"),
    ):
        outcome = run.Run(run.load(diagram("3 cs", f", log_file: {name}"))).execute()
        assert outcome.status == "failed"
        assert words in outcome.error.message
        assert outcome.error.position.line == 2
    assert (tmp_path / "precious.txt").read_text() == "precious"


def test_a_long_message_is_cut_off_at_the_end_of_its_line(tmp_path):
    import ctypes

    from cosim.fmu import messages

    ring = np.zeros(messages.RING_BYTES, np.uint8)
    heard = messages.Messages(ring)
    with (tmp_path / "long.log").open("wb", buffering=0) as file:
        heard.write_to(file.fileno(), "p" * 200)
        log = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)(
            messages.logger(3)
        )
        log(heard.environment, 0, b"c", b"x" * 100_000)
        log(heard.environment, 77, None, None)
    first, second = (tmp_path / "long.log").read_bytes().splitlines()
    assert len(first) == messages.LINE_BYTES - 2  # with its end of line, and the end of the text
    assert first.startswith(b"p" * (messages.NAME_BYTES - 1) + b" [c] ok: xxx")
    assert second == b"p" * (messages.NAME_BYTES - 1) + b" [] error: "
